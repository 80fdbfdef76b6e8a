"""Output folders that appear complete or not at all, and what an interrupted run leaves."""

import logging
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from os import PathLike
from pathlib import Path

from tautscope.errors import MotionHeldError, OutputError

_LOG = logging.getLogger(__name__)


def check_free(path: str | PathLike[str]) -> Path:
    """The path of an empty folder, or where a new one can be made; else an `OutputError`."""
    target = Path(path)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise OutputError("out", str(target), "a folder that is empty or does not exist yet")
    check_writable(target)
    return target


def check_free_file(path: str | PathLike[str]) -> Path:
    """The path, where a new file can be made in a folder that exists; else an `OutputError`."""
    target = Path(path)
    if target.exists():
        raise OutputError("out", str(target), "a file that does not exist yet")
    if not target.absolute().parent.is_dir():
        raise OutputError("out", str(target), "a file in a folder that exists")
    check_writable(target)
    return target


def check_writable(path: Path) -> None:
    """Make and remove a folder in or above a path; an `OutputError` if that cannot be done."""
    from tempfile import TemporaryDirectory  # noqa: PLC0415  a tenth of the time to import the loop

    path = path.resolve()
    above = next(folder for folder in (path, *path.parents) if folder.is_dir())
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
    partial = _beside(target)
    try:
        yield partial
        if target.exists():
            raise OutputError("out", str(target), "still free at the end")
        partial.rename(target)
    except OSError as error:
        raise _as_output(error, target, partial) from None
    finally:
        partial.unlink(missing_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Replace a file in one step: after an error, an `OSError`, it is as before."""
    partial = _beside(path)
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _beside(target: Path) -> Path:
    """A path for the time until an output is complete, of this process alone."""
    return target.with_name(f".{target.name}.{os.getpid()}.partial")


def _as_output(error: OSError | OutputError, target: Path, partial: Path) -> OSError | OutputError:
    """The error of an output, unless it names another file, such as an input."""
    if isinstance(error, OutputError):
        is_part = str(error.value).startswith(str(partial))
        return OutputError("out", str(target), error.allowed) if is_part else error
    if not str(error.filename or partial).startswith(str(partial)):
        return error
    return OutputError("out", str(target), f"a place that can be written ({error})")


def default_folder(verb: str) -> Path:
    """runs/<date-time>-<verb>, to the millisecond: commands may start in the same second."""
    now = f"{datetime.now():%Y-%m-%d-%H%M%S-%f}"[:-3]
    return Path("runs") / f"{now}-{verb}"


@contextmanager
def new_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Make a folder that gets its name only when the block has ended without an error.

    Yields:
        A temporary folder to write into, beside the new one or in one that exists, which may be a
        mount point. It is removed on an error, but not if only its name was taken meanwhile.

    Raises:
        OutputError: The path is taken, or cannot be written.
    """
    target = check_free(path).resolve()
    is_new = not target.exists()
    partial = _beside(target) if is_new else target / _beside(target).name
    try:
        partial.mkdir(parents=True)
    except OSError as error:
        raise OutputError("out", str(target), f"a place that can be written ({error})") from None
    try:
        yield partial
    except BaseException as error:
        shutil.rmtree(partial, ignore_errors=True)
        if isinstance(error, OSError | OutputError):
            raise _as_output(error, target, partial) from None
        raise
    try:
        if is_new:
            partial.rename(target)
        else:
            _move_up(partial)
    except OSError as error:
        allowed = f"still free at the end ({error}); the results are in {partial}"
        raise OutputError("out", str(target), allowed) from None
    _LOG.info("written: %s", target)


def _move_up(partial: Path) -> None:
    """Move what a folder has into the one above, in which there is nothing else."""
    if [*partial.parent.iterdir()] != [partial]:
        raise OSError("it is no longer empty")
    for each in partial.iterdir():
        each.rename(partial.parent / each.name)
    partial.rmdir()


@contextmanager
def recording_saved(folder: Path) -> Iterator[None]:
    """If the block ends with `MotionHeldError`, write the error's recording into the folder.

    The folder is made if it does not exist; the error gets a note that names it.
    """
    try:
        yield
    except MotionHeldError as error:
        if error.recording is not None:
            suffix, note = "" if error.recording.compensated else "_uncompensated", str(folder)
            try:
                folder.mkdir(parents=True, exist_ok=True)
                error.recording.write(folder, suffix)
            except OSError as failure:  # the held motion is the more important error
                note = f"not written ({failure})"
            error.add_note(f"What was recorded until then: {note}")
        raise
