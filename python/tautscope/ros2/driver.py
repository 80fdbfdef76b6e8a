"""A rig whose drives, and the camera if it has one, are nodes of ROS."""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.errors import DriveError, MessageError
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.signal_checks import check_signal
from tautscope.ros2 import messages
from tautscope.ros2.endpoints import IMAGE, Refuse, Subscription
from tautscope.ros2.inputs import ImageReader, Stamps, joint_positions
from tautscope.ros2.session import SENSOR_DATA, Clock, Node

DRIVER_TIMEOUT = 0.1
"""Longest time without positions from the driver [s]."""
START_TIMEOUT = 2.0
"""How long the first positions of the driver are waited for [s]."""
_POLL = 1_000_000


class DriverRig:
    """Drives behind ``actuators/setpoint_js`` and ``actuators/measured_js``.

    The article's instrument also has a camera; other sensors are `tautscope.ros2.sensors.Sensors`.

    Implements `tautscope.loop.rig.Rig`. Its clock is the monotonic one, from `reset` on; a stamp is
    converted by its age. The first command should be the applied position of the first sample.
    After `close`, and if this process ends, no set-point is sent, by which the driver has to stop.
    """

    def __init__(self, config: Config, node: Node, clock: Clock, refuse: Refuse) -> None:
        kind = "sensor_msgs/msg/JointState"
        self._setpoints = node.publisher("instrument/actuators/setpoint_js", kind)
        self._positions = node.subscription("instrument/actuators/measured_js", kind)
        self._position_stamps = Stamps(self._positions.topic)
        self._images: Subscription | None = None
        if not config.dof:
            self._images = node.subscription("endoscope/image_raw", IMAGE, SENSOR_DATA)
            self._image_stamps = Stamps(self._images.topic)
            self._reader = ImageReader(self._images.topic, config.camera)
        self._joints = [dof.label for dof in config.dofs]
        self._clock, self._refuse = clock, refuse
        self._period = round(config.control.period * 1e9)
        self.control_period = self._period / 1e9
        self._applied: NDArray[np.float64] | None = None
        self._start = self._due = self._moved_at = self._frames = 0

    def reset(self) -> Sample:
        """Wait for new positions of the driver, else a `DriveError`; the clock is at 0."""
        with suppress(MessageError):
            self._positions.take()  # one from before, of any age
        self._applied = None
        self._position_stamps.reset()
        if self._images is not None:
            self._image_stamps.reset()
        give_up = self._clock.monotonic() + round(START_TIMEOUT * 1e9)
        while self._newest_position() is None:
            if self._clock.monotonic() > give_up:
                raise self._silent(START_TIMEOUT, "Start the driver")
            self._clock.sleep_until(self._clock.monotonic() + _POLL)
        self._newest_frame()  # one from before the start
        self._start = self._due = self._clock.monotonic()
        return self._sample()

    def step(self, command: ArrayLike) -> Sample:
        """Publish command (n,) [m or rad]; return at the end of the control period.

        A tick that wakes late does not catch up. A driver that is silent for `DRIVER_TIMEOUT` is a
        `DriveError`.
        """
        positions = check_signal("command", command, (len(self._joints),))
        stamp = self._clock.wall()
        self._setpoints.publish(messages.joint_state(stamp, self._joints, positions))
        self._due += self._period
        self._due = max(self._due, self._clock.monotonic())
        self._clock.sleep_until(self._due)
        self._newest_position()
        if self._clock.monotonic() - self._moved_at > DRIVER_TIMEOUT * 1e9:
            raise self._silent(DRIVER_TIMEOUT, "The node sends no set-point any more")
        return self._sample()

    def close(self) -> None:
        """Send no set-point any more; a second call does nothing."""

    def _sample(self) -> Sample:
        assert self._applied is not None
        now = (self._clock.monotonic() - self._start) / 1e9
        return Sample(now, self._applied, self._newest_frame())

    def _newest_position(self) -> NDArray[np.float64] | None:
        self._positions.read(self._set_position, self._refuse)
        return self._applied

    def _set_position(self, message: Any) -> None:
        applied = joint_positions(self._positions.topic, message, self._joints)
        wall, source = self._clock.wall(), self._positions.source
        self._position_stamps.check(message.header, wall, source)
        self._applied, self._moved_at = applied, self._clock.monotonic()

    def _newest_frame(self) -> Frame | None:
        frames = [] if self._images is None else self._images.read(self._frame, self._refuse)
        self._frames += len(frames)
        return frames[0] if frames else None

    def _frame(self, message: Any) -> Frame:
        wall = self._clock.wall()
        age = wall - self._image_stamps.check(message.header, wall)
        captured_at = (self._clock.monotonic() - age - self._start) / 1e9
        return self._reader.read(message, captured_at, self._frames)

    def _silent(self, time: float, remedy: str) -> DriveError:
        return DriveError(self._positions.topic, f"no message for {time:g} s", remedy)
