"""Results appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from tautscope.errors import OutputError


def check_free(path: str | PathLike[str]) -> Path:
    """The path as one where a new folder may be made: nothing there, or an empty folder.

    Raises:
        OutputError: Something is there already.
    """
    target = Path(path)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise OutputError("out", str(target), "a folder that is empty or does not exist yet")
    return target


def default_folder(verb: str) -> Path:
    """runs/<date-time>-<verb>."""
    return Path("runs") / f"{time.strftime('%Y-%m-%d-%H%M%S')}-{verb}"


@contextmanager
def new_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Make a folder that appears under its name only when the block has ended well.

    Yields:
        A temporary folder beside it to write into; renamed at the end, removed on any error.

    Raises:
        OutputError: Something is there already, or the place cannot be written.
    """
    target = check_free(path).absolute()
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.mkdir()
    except OSError as error:
        raise OutputError("out", str(target), f"a place that can be written ({error})") from None
    try:
        yield partial
        if check_free(target).exists():
            target.rmdir()
        partial.rename(target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
