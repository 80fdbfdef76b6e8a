"""Files of a run that ended because motion was held."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tautscope.errors import MotionHeldError


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
