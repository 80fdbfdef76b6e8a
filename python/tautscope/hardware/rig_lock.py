"""One master per bus: a lock that ends with the process, however it ends."""

import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Self

from tautscope.config import DrivesConfig
from tautscope.errors import SecondMasterError

if sys.platform != "win32":
    import fcntl


class RigLock:
    """An exclusive lock on the bus of a configuration, for all programs on this computer.

    A context manager; `release` may be called twice. On Windows it locks nothing: there, as for
    programs on other computers, foreign frames on the bus end in a quick stop.

    Raises:
        SecondMasterError: Another program has the lock.
    """

    def __init__(self, config: DrivesConfig) -> None:
        self._file: int | None = None
        if sys.platform == "win32":
            return
        self._file = _open(lock_path(config))
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.release()
            raise SecondMasterError(
                f"bus {config.channel}",
                "another program commands these drives",
                "End it: another console, `tautscope run` or `tautscope jog`",
            ) from None

    def release(self) -> None:
        """Let another program have the bus."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.release()


def lock_path(config: DrivesConfig) -> Path:
    """The file that is locked; it has no content and stays."""
    channel = Path(config.channel)  # of a port also a link to it, as in /dev/serial/by-id
    channel = channel.resolve() if channel.is_absolute() else channel
    bus = f"{config.protocol} {config.interface} {channel}"
    name = hashlib.sha256(bus.encode()).hexdigest()[:16]
    return Path(tempfile.gettempdir()) / f"tautscope-{name}.lock"


def _open(path: Path) -> int:
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        # Without O_CREAT, because Linux refuses it for another user's file in /tmp.
        file = os.open(path, flags)
    except FileNotFoundError:
        file = os.open(path, flags | os.O_CREAT, 0o644)
    with suppress(PermissionError):  # another user's
        os.fchmod(file, 0o644)  # for other users, whatever the umask
    return file
