"""Cameras: the devices there are, and whether the configured one gives what was calibrated."""

from __future__ import annotations

import math
import os
import statistics
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from tautscope.config import CameraConfig
from tautscope.errors import CameraError
from tautscope.hardware.cameras import Camera, CameraState, Capture
from tautscope.hardware.doctor.finding import Finding, absent, failed

WATCHED = 25
"""Frames from which rate and age are told."""
DV_PIPE = "ffmpeg -f iec61883 -i auto -c copy -f dv - |"


def check_devices(*, needed: bool) -> Finding:
    """The V4L2 devices of this computer; `needed` if there should be one."""
    devices = sorted(Path("/dev").glob("video[0-9]*"))
    if not devices:
        todo = (
            "Connect a camera or grabber, then: ls /dev/video*; the kernel's word: sudo dmesg | "
            "tail. FireWire and network cameras are no V4L2 devices: set camera.source"
        )
        return absent("camera", "V4L2 devices", todo, needed=needed)
    names = {str(device): _name(device) for device in devices}
    closed = [path for path in names if not os.access(path, os.R_OK | os.W_OK)]
    found = ", ".join(f"{path} ({name})" for path, name in names.items())
    data = {"devices": names}
    if closed:
        todo = "sudo usermod -aG video $USER, then log in again"
        return Finding(
            "camera", "V4L2 devices", "missing", f"{found}; not yours: {closed}", todo, data
        )
    return Finding("camera", "V4L2 devices", "ok", found, data=data)


def check_source(config: CameraConfig) -> list[Finding]:
    """Open the configured source, have it tested, and watch it for a second."""
    source = config.source
    what, piped = f"source {source.url}", f"{DV_PIPE} uv run tautscope doctor CONFIG"
    if source.url.startswith("pipe:") and sys.stdin.isatty():
        return [Finding("camera", what, "missing", "nothing is piped in", piped)]
    if source.url.startswith("/dev/") and not Path(source.url).exists():
        todo = "Connect it, or name another in camera.source.url: ls /dev/video*"
        return [Finding("camera", what, "missing", "no such device", todo)]
    try:
        with Camera(config) as camera:
            seen = _watch(camera, 2 * source.timeout)
            state = camera.state
    except CameraError as error:
        found = failed("camera", what, error)
        if source.url.startswith("pipe:"):
            found = replace(found, todo=f"{found.todo}; for DV over FireWire: {piped}")
        return [found]
    return [_judge(what, config, seen, state), *_delay(config)]


def _watch(camera: Camera, patience: float) -> list[Capture]:
    seen: list[Capture] = []
    deadline = time.monotonic() + patience
    while len(seen) < WATCHED and time.monotonic() < deadline:
        capture = camera.newest()
        if capture is None:
            time.sleep(0.002)
        else:
            seen.append(capture)
    return seen


def _judge(what: str, config: CameraConfig, seen: list[Capture], state: CameraState) -> Finding:
    if len(seen) < 2:
        todo = "Is the camera on and connected, and does nobody else use it?"
        return Finding("camera", what, "missing", state.trouble or "it stopped", todo)
    frames = [capture.frame for capture in seen]
    period = statistics.median(
        (two.captured_at - one.captured_at) / ((two.sequence or 0) - (one.sequence or 0))
        for one, two in pairwise(frames)
    )
    rate = 1 / period if period > 0 else math.nan
    age = statistics.median(one.arrived_at - one.frame.captured_at for one in seen)
    kind = "fields of interlaced frames" if state.is_interlaced else "progressive frames"
    found = (
        f"{config.width} x {config.height}, {rate:.1f} {kind} per second, not black, not frozen; "
        f"they arrive {1e3 * age:.0f} ms after their time stamps"
    )
    data = {
        "width": config.width,
        "height": config.height,
        "rate": None if math.isnan(rate) else rate,
        "interlaced": state.is_interlaced,
        "age": age,
        "received": state.received,
        "lost": state.lost,
    }
    if state.lost:
        todo = "See whether cable, hub or processor is too slow; other programs closed?"
        lost = f"{state.lost} frame{'s' if state.lost > 1 else ''} lost"
        return Finding("camera", what, "note", f"{found}; {lost}", todo, data)
    return Finding("camera", what, "ok", found, data=data)


def _delay(config: CameraConfig) -> list[Finding]:
    source = config.source
    if source.delay > 0:
        found = f"{1e3 * source.delay:.0f} ms, as configured"
        return [Finding("camera", "constant delay", "note", found)]
    todo = (
        "Film a clock on a screen, and set camera.source.delay: what is not told is read as slack"
    )
    return [Finding("camera", "constant delay", "note", "0 ms: as if it were not measured", todo)]


def _name(device: Path) -> str:
    try:
        return (Path("/sys/class/video4linux") / device.name / "name").read_text().strip()
    except OSError:
        return "no name"
