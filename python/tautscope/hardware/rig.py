"""A rig of CiA 402 drives and a live camera, in a laboratory or on the bench."""

from __future__ import annotations

import logging
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config, DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import CameraError, ConfigError, SignalError
from tautscope.hardware.cameras import Camera, CameraState, Capture
from tautscope.hardware.drives import open_drives
from tautscope.hardware.realtime import LOOP, realtime, short_switch_interval
from tautscope.hardware.setpoint_thread import Motors, SetpointThread
from tautscope.hardware.timing import Timing
from tautscope.loop.rig import Frame, Sample

_LOG = logging.getLogger(__name__)


class FrameSource(AbstractContextManager["FrameSource"], Protocol):
    """The part of `tautscope.hardware.cameras.Camera` that the rig uses."""

    @property
    def state(self) -> CameraState:
        """State of the camera."""
        ...

    def newest(self) -> Capture | None:
        """The newest frame not taken before, with times of the monotonic clock; else None."""
        ...


class HardwareRig:
    """Three drives and a live camera; implements `tautscope.loop.rig.Rig`.

    The rig's clock counts set-points: tick k begins when its set-point is sent, at time k times the
    cycle. A cycle without a new command repeats the last set-point and stops the clock, so that the
    reference has no jump after a delay of the loop. The capture time of a frame is converted with
    the set-point in force,

        captured_at = t_k + min(captured - sent_k, cycle),    sent_k <= captured < sent_(k+1)

    so that jitter of the cycles is not estimated as backlash. For use by one thread. The motors are
    quick-stopped before any error is raised.

    Args:
        config: With a section ``drives``; a run starts at the centres of ``experiment``.
        motors: Opens the drives.
        camera: Opens the camera.
        warn: Called once when a problem begins that does not stop the run, and when it ends.

    Raises:
        ConfigError: The section ``drives`` is missing, or ``control.period`` is not its cycle.
    """

    def __init__(
        self,
        config: Config,
        *,
        motors: Callable[[DrivesConfig], Motors] = open_drives,
        camera: Callable[[Config], FrameSource] | None = None,
        warn: Callable[[str], None] = _LOG.warning,
    ) -> None:
        self._drives = require_drives(config)
        self._config = config
        self._open_motors = motors
        self._open_camera = camera or (lambda config: Camera(config.camera, time.monotonic))
        self.warn = warn
        self.timing = Timing(self._drives.cycle)
        self._resources = ExitStack()
        self._camera: FrameSource | None = None
        self._setpoints: SetpointThread | None = None
        length = round(config.control.history / config.control.period)
        self._sent: deque[tuple[float, float]] = deque(maxlen=length)
        self._ticks = 0
        self._last_capture: Capture | None = None
        self._new_frame_at = 0.0
        self._trouble = ""
        self._is_frozen = False

    def __repr__(self) -> str:
        state = "closed" if self._setpoints is None else f"open, {self._ticks} cycles"
        return f"<HardwareRig: cycle {1e3 * self._drives.cycle:g} ms, {state}>"

    @property
    def control_period(self) -> float:
        """Time from one command to the next [s]."""
        return self._drives.cycle

    def reset(self) -> Sample:
        """Open and test the camera, enable the motors, move to the start; the clock is at 0.

        Raises:
            CameraError: The camera is missing, or its frames cannot be used.
            DriveError: A drive is missing, differs from its configuration, or failed.
        """
        self.close()
        self.timing = Timing(self._drives.cycle)
        start = np.array([self._config.experiment[dof].centre for dof in Dof])
        try:
            self._camera = self._resources.enter_context(self._open_camera(self._config))
            self._setpoints = SetpointThread(
                self._drives, lambda: self._open_motors(self._drives), start, self.timing
            )
            self._resources.callback(self._setpoints.stop)
            _LOG.info("camera %s: frames arrive", self._config.camera.source.url)
            applied = self._setpoints.start()
            _LOG.info("motors enabled and at the start")
            self._resources.enter_context(short_switch_interval())
            self._resources.enter_context(realtime(LOOP))
        except BaseException:
            self.close()
            raise
        if self.timing.realtime:
            self.warn(self.timing.realtime)
        self._sent.clear()
        self._ticks, self._last_capture, self._trouble, self._is_frozen = 0, None, "", False
        self._new_frame_at = time.monotonic()
        return Sample(0.0, applied)

    def step(self, command: ArrayLike) -> Sample:
        """Send command (3,) [m, rad, rad] in the next cycle; return when the drives answer.

        Raises:
            SignalError: The command is not three finite numbers, or outside the limits.
            DriveError: A drive failed, or no command came for ``command_timeout``.
            CameraError: No new frame came for ``camera.source.lost_timeout``.
        """
        if self._setpoints is None or self._camera is None:
            raise SignalError("rig", "closed", "a rig after reset() and before close()")
        try:
            target = np.array(command, dtype=np.float64)
            sent, applied = self._setpoints.send(target)
            self._sent.append((sent, self._ticks * self.control_period))
            self._ticks += 1
            frame = self._newest_frame(self._camera)
        except BaseException:
            self.close()
            raise
        return Sample(self._ticks * self.control_period, applied, frame)

    def interrupt(self) -> None:
        """Quick-stop the motors; for any thread, also during `reset` and `step`.

        These raise `StateError` if one of them runs. Call `close` afterwards.
        """
        if (setpoints := self._setpoints) is not None:
            setpoints.interrupt()

    def close(self) -> None:
        """Quick-stop the motors, release bus and camera; a second call does nothing.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        self._setpoints = self._camera = None
        self._resources.close()

    def disable(self) -> None:
        """Like `close`, and disable voltage: nothing holds the motors any more.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        try:
            if self._setpoints is not None:
                self._setpoints.stop(disable=True)
        finally:
            self.close()

    def to_rig_time(self, instant: float) -> float:
        """Convert a time of the monotonic clock to the rig's clock [s]."""
        if not self._sent:
            return 0.0
        index = bisect_right(self._sent, (instant, float("inf"))) - 1
        sent, at = self._sent[max(index, 0)]
        return at + min(instant - sent, self.control_period)

    def _newest_frame(self, camera: FrameSource) -> Frame | None:
        """The newest frame on the rig's clock; None if it repeats the last image."""
        now = time.monotonic()
        capture = camera.newest()
        is_new = capture is not None and not (
            self._last_capture is not None
            and np.array_equal(capture.frame.image, self._last_capture.frame.image)
        )
        if is_new:
            self._new_frame_at = now
        if capture is not None:
            self._is_frozen = not is_new
        self._check_camera(camera.state, now)
        if capture is None or not is_new:
            return None
        self._last_capture = capture
        self.timing.add_frame(capture.frame.captured_at, capture.arrived_at, now)
        captured_at = self.to_rig_time(capture.frame.captured_at)
        return Frame(capture.frame.image, captured_at, capture.frame.sequence)

    def _check_camera(self, state: CameraState, now: float) -> None:
        source = self._config.camera.source
        silence = now - self._new_frame_at
        trouble = state.trouble
        what = "only repetitions of one image" if self._is_frozen else "no image"
        if not trouble and silence > source.timeout:
            trouble = f"{what} for {source.timeout:g} s; is the camera on and connected?"
        if silence > source.lost_timeout:
            raise CameraError(
                "camera.source",
                f"{what} for {source.lost_timeout:g} s",
                "new images; the motors are stopped. Check the camera, its cable and the video "
                "processor, then start again",
            )
        if bool(trouble) != bool(self._trouble):
            self.warn(f"camera: {trouble}" if trouble else "camera: new frames again")
        self._trouble = trouble


def require_drives(config: Config) -> DrivesConfig:
    """Return the section ``drives`` of a configuration.

    Raises:
        ConfigError: The section is missing, or ``control.period`` is not its cycle.
    """
    drives = config.drives
    if drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    if config.control.period != drives.cycle:
        raise ConfigError(
            "control.period",
            config.control.period,
            f"drives.cycle = {drives.cycle}: every tick of the loop sends a set-point",
        )
    return drives
