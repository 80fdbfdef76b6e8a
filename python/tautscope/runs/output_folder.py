"""Output folders that appear complete or not at all, and what an interrupted run leaves."""

from __future__ import annotations

import logging
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from tautscope.errors import MotionHeldError, OutputError

_LOG = logging.getLogger(__name__)


def check_free(path: str | PathLike[str]) -> Path:
    """Return the path if a new folder can be made there: nothing exists, or an empty folder.

    Raises:
        OutputError: The path is taken, or cannot be written.
    """
    target = Path(path)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise OutputError("out", str(target), "a folder that is empty or does not exist yet")
    check_writable(target)
    return target


def check_free_file(path: str | PathLike[str]) -> Path:
    """Return the path if a new file can be made there, in a folder that exists.

    Raises:
        OutputError: The path is taken, or cannot be written.
    """
    target = Path(path)
    if target.exists():
        raise OutputError("out", str(target), "a file that does not exist yet")
    if not target.absolute().parent.is_dir():
        raise OutputError("out", str(target), "a file in a folder that exists")
    check_writable(target)
    return target


def check_writable(path: Path) -> None:
    """Check that something can be made at a path, by making and removing a folder above it.

    Raises:
        OutputError: It cannot.
    """
    from tempfile import TemporaryDirectory  # noqa: PLC0415  a tenth of the time to import the loop

    above = next(folder for folder in path.absolute().parents if folder.exists())
    try:
        with TemporaryDirectory(prefix=".tautscope-", dir=above):
            pass
    except OSError as error:
        allowed = f"a place that can be written ({error.strerror})"
        raise OutputError("out", str(path), allowed) from None


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Make a file that gets its name only when the block has ended without an error.

    Yields:
        The path of a temporary file beside it to write: renamed at the end, removed on an error.

    Raises:
        OutputError: The path is taken, or cannot be written.
    """
    target = check_free_file(path)
    partial = target.with_name(f".{target.name}.partial")
    try:
        yield partial
        partial.rename(target)
    except OSError as error:
        raise OutputError("out", str(target), f"a place that can be written ({error})") from None
    finally:
        partial.unlink(missing_ok=True)


def default_folder(verb: str) -> Path:
    """runs/<date-time>-<verb>."""
    return Path("runs") / f"{time.strftime('%Y-%m-%d-%H%M%S')}-{verb}"


@contextmanager
def new_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Make a folder that gets its name only when the block has ended without an error.

    Yields:
        A temporary folder beside it to write into: renamed at the end, removed on an error.

    Raises:
        OutputError: The path is taken, or cannot be written.
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
        _LOG.info("written: %s", target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


@contextmanager
def recording_saved(folder: Path) -> Iterator[None]:
    """If the block ends with `MotionHeldError`, write the error's recording into the folder.

    The folder is made if it does not exist; the error gets a note that names it.
    """
    try:
        yield
    except MotionHeldError as error:
        if error.recording is not None:
            folder.mkdir(parents=True, exist_ok=True)
            error.recording.write(folder, "" if error.recording.compensated else "_uncompensated")
            error.add_note(f"What was recorded until then: {folder}")
        raise
