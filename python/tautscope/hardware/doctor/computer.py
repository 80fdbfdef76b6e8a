"""The computer a rig runs on: libraries, priority, memory, disk."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

from tautscope._core import __version__
from tautscope.config import Config
from tautscope.hardware.doctor.finding import Finding
from tautscope.hardware.realtime import REMEDY, SETPOINTS, memory_kept, realtime
from tautscope.loop.frame_layout import FrameLayout

PACKED = {"png": 0.55, "jpeg": 0.12}
"""Size of an image in a log, as a share of its pixels' (decision 0020)."""
FRAME_RATE = 50.0
"""As many images per second as PAL's fields."""
LEAST_RECORDING = 600.0
"""A disk should have room for so long a run [s]."""
_PROBE = 32 << 20


def check_computer(config: Config) -> list[Finding]:
    """Libraries, priority, memory."""
    system = f"tautscope {__version__}, Python {platform.python_version()}, {platform.platform()}"
    try:
        load = f", load {os.getloadavg()[0]:.1f}"
    except (OSError, AttributeError):
        load = ""
    cores = f"{os.cpu_count()} cores{load}"
    is_ethercat = config.drives is not None and config.drives.protocol == "ethercat"
    return [
        Finding("computer", "system", "note", f"{system}, {cores}"),
        _extra("hardware", ("av", "can", "canopen")),
        *([_extra("ethercat", ("pysoem",))] if is_ethercat else []),
        _priority(),
        _memory(),
    ]


def check_disk(config: Config, folder: Path) -> Finding:
    """Room and speed for recordings in `folder`, against what the camera would fill."""
    frame = 1
    for length in FrameLayout(config.camera).shape:
        frame *= length
    needed = frame * FRAME_RATE * PACKED[config.recording.image_format]
    try:
        free = shutil.disk_usage(folder).free
        speed = _speed(folder, min(_PROBE, free // 4))
    except OSError as error:
        todo = f"Make it one that can be written: ls -ld {folder}"
        return Finding("recording", "disk", "missing", f"{folder}: {error}", todo)
    minutes = free / needed / 60
    found = (
        f"{free / 1e9:.0f} GB free, {speed / 1e6:.0f} MB/s to the disk; a run writes up to "
        f"{needed / 1e6:.0f} MB/s: {minutes:.0f} min"
    )
    data = {"free": free, "bytes_per_second": speed, "needed_per_second": needed}
    smaller = 'or record smaller images: recording.image_format = "jpeg"'
    if minutes * 60 < LEAST_RECORDING:
        todo = f"Run in a folder with more room: df -h {folder}; {smaller}"
        return Finding("recording", "disk", "missing", found, todo, data)
    if speed < needed:
        todo = f"Run in a folder on a quicker disk; {smaller}"
        return Finding("recording", "disk", "missing", found, todo, data)
    return Finding("recording", "disk", "ok", found, data=data)


def _extra(name: str, modules: tuple[str, ...]) -> Finding:
    absent = [module for module in modules if find_spec(module) is None]
    what = f"extra '{name}'"
    if absent:
        todo = f"pip install 'tautscope[{name}]'"
        return Finding("computer", what, "missing", f"no {', '.join(absent)}", todo)
    return Finding("computer", what, "ok", ", ".join(modules))


def _priority() -> Finding:
    what = "real-time priority"
    with realtime(SETPOINTS) as refusal:
        if not refusal:
            return Finding("computer", what, "ok", f"SCHED_FIFO {SETPOINTS} is permitted")
    if platform.system() != "Linux":
        return Finding("computer", what, "note", refusal, "Use Linux for a rig")
    return Finding("computer", what, "missing", "SCHED_FIFO is not permitted", REMEDY)


def _memory() -> Finding:
    what = "memory kept"
    with memory_kept() as refusal:
        if not refusal:
            return Finding("computer", what, "ok", "what a run uses is not paged out")
    if platform.system() != "Linux":
        return Finding("computer", what, "note", refusal)
    found = "it may be paged out, and set-points wait for the disk"
    return Finding("computer", what, "note", found, REMEDY)


def _speed(folder: Path, size: int) -> float:
    """Bytes per second through to the disk."""
    block = os.urandom(1 << 20)
    with tempfile.TemporaryFile(dir=folder) as file:
        began = time.monotonic()
        for _ in range(max(size >> 20, 1)):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        return file.tell() / max(time.monotonic() - began, 1e-6)
