"""Checks of the computer: libraries, real-time priority, locked memory, disk."""

import math
import os
import platform
import shutil
import tempfile
import time
from contextlib import AbstractContextManager
from pathlib import Path

from tautscope._core import __version__
from tautscope.config import Config
from tautscope.config.servos import PORTS
from tautscope.extras import MODULES, missing_modules
from tautscope.hardware.doctor.check_result import CheckResult, Status, result
from tautscope.hardware.realtime import REMEDY, SETPOINTS, locked_memory, realtime
from tautscope.loop.frame_layout import FrameLayout

COMPRESSION = {"png": 0.55, "jpeg": 0.12}
"""Size of a compressed image relative to its pixels (docs/decisions/0020-logs-are-mcap.md)."""
FRAME_RATE = 50.0
"""Field rate of PAL [1/s]."""
MIN_RECORDING_TIME = 600.0
"""Length of a run that the disk must have room for [s]."""
_PROBE_SIZE = 32 << 20
"""Size of the file that measures the speed of the disk [byte]."""


def check_computer(config: Config) -> list[CheckResult]:
    """Check libraries, real-time priority and locked memory."""
    system = f"tautscope {__version__}, Python {platform.python_version()}, {platform.platform()}"
    try:
        load = f", load {os.getloadavg()[0]:.1f}"
    except (OSError, AttributeError):
        load = ""
    cores = f"{os.cpu_count()} cores{load}"
    protocol = config.drives.protocol if config.drives is not None else ""
    return [
        CheckResult("computer", "system", "note", f"{system}, {cores}"),
        _extra("hardware"),
        *([_extra("ethercat")] if protocol == "ethercat" else []),
        *([_extra("servo")] if protocol in PORTS else []),
        _permission(
            "real-time priority",
            realtime(SETPOINTS),
            f"SCHED_FIFO {SETPOINTS} is permitted",
            "SCHED_FIFO is not permitted",
            "missing",
        ),
        _permission(
            "memory kept",
            locked_memory(),
            "memory can be locked",
            "memory may be paged out, and set-points may wait for the disk",
            "note",
        ),
    ]


def bytes_per_second(config: Config) -> float:
    """Largest data rate of a log: images at the field rate of PAL."""
    frame = math.prod(FrameLayout(config.camera).shape)
    return frame * FRAME_RATE * COMPRESSION[config.recording.image_format]


def check_disk(config: Config, folder: Path) -> CheckResult:
    """Check free space and write speed in `folder` against the data rate of the camera."""
    needed = bytes_per_second(config)
    try:
        free = shutil.disk_usage(folder).free
        speed = _speed(folder, min(_PROBE_SIZE, free // 4))
    except OSError as error:
        todo = f"Make it writable: ls -ld {folder}"
        return CheckResult("recording", "disk", "missing", f"{folder}: {error}", todo)
    minutes = free / needed / 60
    found = (
        f"{free / 1e9:.0f} GB free, {speed / 1e6:.0f} MB/s to the disk; a run writes up to "
        f"{needed / 1e6:.0f} MB/s: {minutes:.0f} min"
    )
    data = {"free": free, "bytes_per_second": speed, "needed_per_second": needed}
    todo = ""
    if minutes * 60 < MIN_RECORDING_TIME:
        todo = f"Run in a folder with more space: df -h {folder}"
    elif speed < needed:
        todo = "Run in a folder on a faster disk"
    if todo:
        todo += '; or record smaller images: recording.image_format = "jpeg"'
    return result("recording", "disk", found, data, missing=todo)


def _extra(name: str) -> CheckResult:
    what, missing = f"extra '{name}'", missing_modules(name)
    if missing:
        todo = f'python -m pip install "tautscope[{name}]"'
        return CheckResult("computer", what, "missing", f"no {', '.join(missing)}", todo)
    return CheckResult("computer", what, "ok", ", ".join(MODULES[name]))


def _permission(
    what: str, setting: AbstractContextManager[str], granted: str, refused: str, status: Status
) -> CheckResult:
    with setting as refusal:
        if not refusal:
            return CheckResult("computer", what, "ok", granted)
    if platform.system() != "Linux":
        return CheckResult("computer", what, "note", refusal, "Use Linux for a rig")
    return CheckResult("computer", what, status, refused, REMEDY)


def _speed(folder: Path, size: int) -> float:
    """Measure the write speed of the disk [byte/s]."""
    block = os.urandom(1 << 20)
    with tempfile.TemporaryFile(dir=folder) as file:
        began = time.monotonic()
        for _ in range(max(size >> 20, 1)):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        return file.tell() / max(time.monotonic() - began, 1e-6)
