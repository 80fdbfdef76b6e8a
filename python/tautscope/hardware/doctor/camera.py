"""Checks of cameras: V4L2 devices, and the frames of the configured source."""

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
from tautscope.hardware.doctor.check_result import CheckResult, from_error, none_found, result

FRAMES = 25
"""Number of frames from which rate and age are measured."""
DV_PIPE = "ffmpeg -f iec61883 -i auto -c copy -f dv - |"


def check_devices(*, needed: bool) -> CheckResult:
    """Find the V4L2 devices of this computer; it is missing only if one is `needed`."""
    devices = sorted(Path("/dev").glob("video[0-9]*"))
    if not devices:
        todo = (
            "Connect a camera or grabber, then: ls /dev/video*; kernel messages: sudo dmesg | "
            "tail. FireWire and network cameras are no V4L2 devices: set camera.source"
        )
        return none_found("camera", "V4L2 devices", todo, needed=needed)
    names = {str(device): _name(device) for device in devices}
    forbidden = [path for path in names if not os.access(path, os.R_OK | os.W_OK)]
    found = ", ".join(f"{path} ({name})" for path, name in names.items())
    todo = ""
    if forbidden:
        found += f"; no permission: {forbidden}"
        todo = "sudo usermod -aG video $USER, then log in again"
    return result("camera", "V4L2 devices", found, {"devices": names}, missing=todo)


def check_source(config: CameraConfig) -> list[CheckResult]:
    """Open and test the configured source, and measure its frame rate and age."""
    source = config.source
    what, piped = f"source {source.url}", f"{DV_PIPE} tautscope doctor --config CONFIG"
    if source.url.startswith("pipe:") and sys.stdin.isatty():
        return [CheckResult("camera", what, "missing", "no data on the pipe", piped)]
    if source.url.startswith("/dev/") and not Path(source.url).exists():
        todo = "Connect it, or name another in camera.source.url: ls /dev/video*"
        return [CheckResult("camera", what, "missing", "no such device", todo)]
    try:
        with Camera(config) as camera:
            captures = _collect(camera, 2 * source.timeout)
            state = camera.state
    except CameraError as error:
        found = from_error("camera", what, error)
        if source.url.startswith("pipe:"):
            found = replace(found, todo=f"{found.todo}; for DV over FireWire: {piped}")
        return [found]
    return [_check_captures(what, config, captures, state), _check_delay(source.delay)]


def _collect(camera: Camera, timeout: float) -> list[Capture]:
    captures: list[Capture] = []
    deadline = time.monotonic() + timeout
    while len(captures) < FRAMES and time.monotonic() < deadline:
        capture = camera.newest()
        if capture is None:
            time.sleep(0.002)
        else:
            captures.append(capture)
    return captures


def _check_captures(
    what: str, config: CameraConfig, captures: list[Capture], state: CameraState
) -> CheckResult:
    if len(captures) < 2:
        todo = "Is the camera on, connected, and used by no other program?"
        return CheckResult("camera", what, "missing", state.trouble or "it stopped", todo)
    frames = [capture.frame for capture in captures]
    period = statistics.median(
        (two.captured_at - one.captured_at) / ((two.sequence or 0) - (one.sequence or 0))
        for one, two in pairwise(frames)
    )
    rate = 1 / period if period > 0 else math.nan
    age = statistics.median(one.arrived_at - one.frame.captured_at for one in captures)
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
        "damaged": state.damaged,
    }
    todo = ""
    if state.lost or state.damaged:
        found += f"; frames lost: {state.lost}, of them damaged: {state.damaged}"
        todo = "Check whether cable, hub or processor is too slow; end other programs"
    return result("camera", what, found, data, note=todo)


def _check_delay(delay: float) -> CheckResult:
    if delay > 0:
        found, todo = f"{1e3 * delay:.0f} ms, as configured", ""
    else:
        found = "0 ms: not measured yet"
        todo = "tautscope calibrate geometry measures it: an unknown delay is estimated as slack"
    return CheckResult("camera", "constant delay", "note", found, todo)


def _name(device: Path) -> str:
    try:
        return (Path("/sys/class/video4linux") / device.name / "name").read_text().strip()
    except OSError:
        return "no name"
