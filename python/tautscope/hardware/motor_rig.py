"""A rig of the motors of section ``drives``, with any sensors."""

import logging
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config, DrivesConfig, check_config
from tautscope.errors import ConfigError, SignalError
from tautscope.hardware.drives import Drives, as_vector, open_drives
from tautscope.hardware.realtime import LOOP, realtime, short_switch_interval
from tautscope.hardware.setpoint_thread import SetpointThread
from tautscope.hardware.timing import Timing
from tautscope.loop.actuators import Actuators
from tautscope.loop.measurement import Measurement
from tautscope.loop.rig import Sample

_LOG = logging.getLogger(__name__)


class MotorRig:
    """The motors of section ``drives``; implements `tautscope.loop.rig.Rig`.

    A subclass has the sensors of a robot with ``[[dof]]``:

        class Arm(MotorRig):
            def measure(self):
                found = tracker.newest()  # without waiting; None if there is no new one
                if found is None:
                    return ()
                return Pose(found.position, self.to_rig_time(found.time), found.rotation)

    The rig's clock counts set-points: tick k begins when its set-point is sent, at time k times the
    cycle. A cycle without a new command repeats the last set-point and stops the clock, so that the
    reference has no jump after a delay of the loop. A time of the monotonic clock is converted with
    the set-point in force,

        captured_at = t_k + min(captured - sent_k, cycle),    sent_k <= captured < sent_(k+1)

    so that jitter of the cycles is not estimated as backlash. For use by one thread. The motors are
    quick-stopped before any error is raised.

    Args:
        config: With a section ``drives``.

    Attributes:
        control_period: Time from one command to the next [s].
        timing: Timing of the set-points and frames since `reset`.
        warn: Called once when a problem begins that does not stop the run, and when it ends.

    Raises:
        ConfigError: The section ``drives`` is missing, or ``control.period`` is not its cycle.
    """

    def __init__(self, config: Config) -> None:
        self._drives = require_drives(config)
        self._config = config
        self.control_period = self._drives.cycle
        self.warn: Callable[[str], None] = _LOG.warning
        self.timing = Timing(self._drives.cycle)
        self._resources = ExitStack()
        self._setpoints: SetpointThread | None = None
        length = round(config.control.history / config.control.period)
        self._sent: deque[tuple[float, float]] = deque(maxlen=length)
        self._ticks = 0

    def __repr__(self) -> str:
        state = "closed" if self._setpoints is None else f"open, {self._ticks} cycles"
        return f"<{type(self).__name__}: cycle {1e3 * self._drives.cycle:g} ms, {state}>"

    @property
    def start(self) -> NDArray[np.float64] | None:
        """Where `reset` moves the motors (m,): by default where each DOF is amid its ``range``.

        None without [[dof]], or if a DOF has no range: they stay where they are.
        """
        if not self._config.dof or any(dof.range is None for dof in self._config.dof):
            return None
        middle = np.array([np.mean(dof.range) for dof in self._config.dof if dof.range])
        if self._config.actuators is None:
            return middle
        return Actuators(self._config).motors(middle)

    def measure(self) -> Measurement | tuple[Measurement, ...]:
        """What the sensors have delivered since the last call; it must not wait.

        Times are those of `to_rig_time`.
        """
        return ()

    def reset(self) -> Sample:
        """Enable the motors and move them to `start`; the clock is at 0.

        Raises:
            DriveError: A drive is missing, differs from its configuration, or failed.
        """
        self.close()
        self.timing = Timing(self._drives.cycle)
        try:
            self._open_sensors(self._resources)
            self._setpoints = SetpointThread(
                self._drives, self._open_motors, self.start, self.timing
            )
            self._resources.callback(self._setpoints.stop)
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
        self._ticks = 0
        return Sample(0.0, applied)

    def step(self, command: ArrayLike) -> Sample:
        """Send command (m,) [m or rad] in the next cycle; return when the drives answer.

        Raises:
            SignalError: The command is not m finite numbers, or outside the limits.
            DriveError: A drive failed, or no command came for ``command_timeout``.
        """
        if self._setpoints is None:
            raise SignalError("rig", "closed", "a rig after reset() and before close()")
        try:
            target = as_vector(command, len(self._drives.all_motors))
            sent, applied = self._setpoints.send(target)
            self._sent.append((sent, self._ticks * self.control_period))
            self._ticks += 1
            return self._sample(self._ticks * self.control_period, applied)
        except BaseException:
            self.close()
            raise

    def interrupt(self) -> None:
        """Quick-stop the motors; for any thread, also during `reset` and `step`.

        These raise `StateError` if one of them runs. Call `close` afterwards.
        """
        if (setpoints := self._setpoints) is not None:
            setpoints.interrupt()

    def close(self) -> None:
        """Quick-stop the motors, release bus and sensors; a second call does nothing.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        self._setpoints = None
        self._resources.close()

    def disable(self) -> None:
        """Like `close`, and disable voltage: nothing holds the motors any more.

        Does nothing if the rig is closed; the motors stay held.

        Raises:
            StateError: A drive does not confirm; use the emergency stop. Or the motors were
                stopped before, and stay held.
        """
        try:
            if self._setpoints is not None:
                self._setpoints.stop(disable=True)
        finally:
            self.close()

    def to_rig_time(self, instant: float) -> float:
        """Convert a time of the monotonic clock, `time.monotonic`, to the rig's clock [s]."""
        if not self._sent:
            return 0.0
        index = bisect_right(self._sent, (instant, float("inf"))) - 1
        sent, at = self._sent[max(index, 0)]
        return at + min(instant - sent, self.control_period)

    def _open_motors(self) -> Drives:
        return open_drives(self._drives)

    def _open_sensors(self, resources: ExitStack) -> None:
        """Open what measures, before the motors are enabled."""

    def _sample(self, time: float, applied: NDArray[np.float64]) -> Sample:
        return Sample(time, applied, measurement=self.measure())


def require_drives(config: Config) -> DrivesConfig:
    """Return the section ``drives`` of a configuration.

    Raises:
        ConfigError: The section is missing, or ``control.period`` is not its cycle.
    """
    drives = check_config(config).drives
    if drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    if config.control.period != drives.cycle:
        raise ConfigError(
            "control.period",
            config.control.period,
            f"drives.cycle = {drives.cycle}: every tick of the loop sends a set-point",
        )
    return drives
