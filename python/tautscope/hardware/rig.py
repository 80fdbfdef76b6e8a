"""Drives and camera as a rig: what `run_experiment` runs on in a lab, and on the bench."""

from __future__ import annotations

import sys
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
from tautscope.hardware.realtime import LOOP, quick_switching, realtime
from tautscope.hardware.setpoints import Motors, Setpoints
from tautscope.hardware.timing import Timing
from tautscope.loop.rig import Frame, Sample


class Eye(AbstractContextManager["Eye"], Protocol):
    """What `tautscope.hardware.cameras.Camera` is to the rig."""

    @property
    def state(self) -> CameraState:
        """How it is doing."""
        ...

    def newest(self) -> Capture | None:
        """The newest frame that was not taken yet, times on the monotonic clock."""
        ...


def _say(text: str) -> None:
    print(f"warning: {text}", file=sys.stderr, flush=True)


class HardwareRig:
    """Motors on a bus and a live camera; implements `tautscope.loop.rig.Rig`.

    The rig's clock counts set-points: tick k is at k times the cycle, from the instant its
    set-point is sent. In a cycle that finds no new command the motors are held and the clock
    stands, so that a loop that was late goes on where it was; nothing is made up for by a jump.
    Frames are put on this clock by the set-point that was in force when they were captured,

        captured_at = t_k + min(captured - sent_k, cycle),    sent_k <= captured < sent_(k+1)

    so that unpunctual cycles do not read as slack. One thread may call it. Whatever it raises, the
    motors have been brought to quick stop.

    Args:
        config: With a section ``drives``; its centres of ``experiment`` are where a run starts.
        motors: Opens the drives.
        eye: Opens the camera.
        say: Told once of each trouble that does not stop the run, and of its end.

    Raises:
        ConfigError: There is no section ``drives``, or ``control.period`` is not its cycle.
    """

    def __init__(
        self,
        config: Config,
        *,
        motors: Callable[[DrivesConfig], Motors] = open_drives,
        eye: Callable[[Config], Eye] | None = None,
        say: Callable[[str], None] = _say,
    ) -> None:
        self._drives = rig_drives(config)
        self._config = config
        self._open_motors = motors
        self._open_eye = eye or (lambda known: Camera(known.camera, time.monotonic))
        self.say = say
        self.timing = Timing(self._drives.cycle)
        self._held = ExitStack()
        self._eye: Eye | None = None
        self._setpoints: Setpoints | None = None
        span = round(config.control.history / config.control.period)
        self._sent: deque[tuple[float, float]] = deque(maxlen=span)
        self._ticks = 0
        self._last: Capture | None = None
        self._news_at = 0.0
        self._trouble = ""
        self._is_frozen = False

    @property
    def control_period(self) -> float:
        """Time from one command to the next [s]."""
        return self._drives.cycle

    def reset(self) -> Sample:
        """Open the camera and test it, enable the motors, go to the start; the clock is at 0.

        Raises:
            CameraError: The camera is not there, or what it gives cannot be used.
            DriveError: A drive is not there, or not as configured, or did not do as told.
        """
        self.close()
        self.timing = Timing(self._drives.cycle)
        start = np.array([self._config.experiment[dof].centre for dof in Dof])
        try:
            self._eye = self._held.enter_context(self._open_eye(self._config))
            self._setpoints = Setpoints(
                self._drives, lambda: self._open_motors(self._drives), start, self.timing
            )
            self._held.callback(self._setpoints.stop)
            applied = self._setpoints.start()
            self._held.enter_context(quick_switching())
            self._held.enter_context(realtime(LOOP))
        except BaseException:
            self.close()
            raise
        if self.timing.realtime:
            self.say(self.timing.realtime)
        self._sent.clear()
        self._ticks, self._last, self._trouble, self._is_frozen = 0, None, "", False
        self._news_at = time.monotonic()
        return Sample(0.0, applied)

    def step(self, command: ArrayLike) -> Sample:
        """Send command (3,) [m, rad, rad] with the next cycle; return when the drives answered.

        Raises:
            SignalError: The command is not three finite numbers, or outside the limits.
            DriveError: The drives, or the loop was away for longer than ``command_timeout``.
            CameraError: No frame for ``camera.source.lost_timeout``.
        """
        if self._setpoints is None or self._eye is None:
            raise SignalError("rig", "closed", "a rig after reset() and before close()")
        try:
            target = np.array(command, dtype=np.float64)
            sent, applied = self._setpoints.send(target)
            self._sent.append((sent, self._ticks * self.control_period))
            self._ticks += 1
            frame = self._look(self._eye)
        except BaseException:
            self.close()
            raise
        return Sample(self._ticks * self.control_period, applied, frame)

    def close(self) -> None:
        """Quick stop, confirmed; release bus and camera. May be called twice.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        self._setpoints = self._eye = None
        self._held.close()

    def disable(self) -> None:
        """`close`, and the motors are without power: nothing holds them any more.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        try:
            if self._setpoints is not None:
                self._setpoints.stop(disable=True)
        finally:
            self.close()

    def on_clock(self, instant: float) -> float:
        """An instant of the computer's monotonic clock on the rig's clock [s]."""
        if not self._sent:
            return 0.0
        index = bisect_right(self._sent, (instant, float("inf"))) - 1
        sent, at = self._sent[max(index, 0)]
        return at + min(instant - sent, self.control_period)

    def _look(self, eye: Eye) -> Frame | None:
        """The newest frame on the rig's clock; a picture that is the last one again is no news."""
        now = time.monotonic()
        capture = eye.newest()
        is_new = capture is not None and not (
            self._last is not None and np.array_equal(capture.frame.image, self._last.frame.image)
        )
        if is_new:
            self._news_at = now
        if capture is not None:
            self._is_frozen = not is_new
        self._mind(eye.state, now)
        if capture is None or not is_new:
            return None
        self._last = capture
        self.timing.add_frame(capture.frame.captured_at, capture.arrived_at, now)
        captured_at = self.on_clock(capture.frame.captured_at)
        return Frame(capture.frame.image, captured_at, capture.frame.sequence)

    def _mind(self, state: CameraState, now: float) -> None:
        source = self._config.camera.source
        away = now - self._news_at
        trouble = state.trouble
        what = "the same picture again and again" if self._is_frozen else "no picture"
        if not trouble and away > source.timeout:
            trouble = f"{what} for {source.timeout:g} s; is the camera on and connected?"
        if away > source.lost_timeout:
            raise CameraError(
                "camera.source",
                f"{what} for {source.lost_timeout:g} s",
                "new ones; the motors are stopped. See to the camera, its cable and the video "
                "processor, then start again",
            )
        if bool(trouble) != bool(self._trouble):
            self.say(f"camera: {trouble}" if trouble else "camera: frames again")
        self._trouble = trouble


def rig_drives(config: Config) -> DrivesConfig:
    """The section ``drives`` of a rig's configuration.

    Raises:
        ConfigError: There is none, or ``control.period`` is not its cycle.
    """
    drives = config.drives
    if drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    if config.control.period != drives.cycle:
        raise ConfigError(
            "control.period",
            config.control.period,
            f"drives.cycle = {drives.cycle}: every tick of the loop is a set-point",
        )
    return drives
