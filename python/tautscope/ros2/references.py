"""Sources of the operator's reference: ``servo_jp``, and ``sensor_msgs/Joy``."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tautscope.config import Config
from tautscope.console.lease import ImageTimes, Lease
from tautscope.console.messages import Command, Received, Servo
from tautscope.console.operator_input import DEAD_BAND, OperatorInput
from tautscope.errors import MessageError
from tautscope.loop.kinematics import Floats
from tautscope.loop.operating_state import OperatingState, StateMachine
from tautscope.ros2.endpoints import Refuse
from tautscope.ros2.inputs import JoyAxes, Stamps, joint_positions, joy_deflection
from tautscope.ros2.session import Clock, Node
from tautscope.ros2.wire import Qos

QUEUE = 10
"""Number of references that wait for a tick; it takes the newest."""


class ServoReference:
    """The reference of a stream of positions, with its date.

    The first message after `reset` and `engage` clutches in: the reference is where it was, and
    follows the increments,

        reference = position + offset

    A stream that begins at ``setpoint_js`` has the offset 0. Between messages the last reference
    remains, and its age grows, by which the loop detects a silent device
    (``safety.reference_age``). While motion is held, by the supervisor or by request, the reference
    rests.
    """

    def __init__(
        self, node: Node, joints: Sequence[str], clock: Clock, refuse: Refuse, states: StateMachine
    ) -> None:
        self._messages = node.subscription(
            "instrument/servo_jp", "sensor_msgs/msg/JointState", Qos(depth=QUEUE)
        )
        self._joints, self._clock, self._refuse, self._states = joints, clock, refuse, states
        self._stamps = Stamps(self._messages.topic)
        self.reference = self._before = np.full(len(joints), np.nan)
        self._offset: Floats | None = None
        self._made_at: int | None = None
        self.age: float | None = None

    def reset(self, reference: Floats) -> None:
        """Start at a reference (n,) [m or rad]; what arrived before is discarded."""
        self.reference = self._before = reference.copy()
        self._take()
        self._stamps.reset()
        self.engage()

    def engage(self) -> None:
        """Follow the next message's increments."""
        self._offset = self._made_at = self.age = None
        self._stamps.release()

    def update(self, now: float, period: float, command: Floats, *, is_held: bool) -> Floats:
        """The newest reference (n,) [m or rad]; sets `age`."""
        found = self._take()
        if is_held or self._states.goal is OperatingState.PAUSED:
            # The increment with which motion was stopped has not been followed.
            if self._made_at is not None:
                self.reference = self._before
            self.engage()
            return self.reference.copy()
        self._before = self.reference
        if found:
            if self._offset is None:
                self._offset = self.reference - found[0][0]
            position, self._made_at = found[-1]
            # Bit for bit, for a stream that begins at the set-point.
            self.reference = position + self._offset if self._offset.any() else position
        if self._made_at is not None:
            self.age = (self._clock.wall() - self._made_at) / 1e9
        return self.reference.copy()

    def _take(self) -> list[tuple[Floats, int]]:
        """Position and stamp of the valid messages that wait."""
        return self._messages.read(self._position, self._refuse, QUEUE)

    def _position(self, message: Any) -> tuple[Floats, int]:
        position = joint_positions(self._messages.topic, message, self._joints)
        source = self._messages.source
        return position, self._stamps.check(message.header, self._clock.wall(), source)


class JoyReference:
    """The reference of a gamepad: deflections are speeds, while the dead man's button is held.

    Speed, ramp, travel, and rest without messages are those of the operator's console,
    `tautscope.console.operator_input.OperatorInput`.
    """

    age: float | None = None

    def __init__(
        self,
        config: Config,
        node: Node,
        layout: JoyAxes,
        *,
        clock: Clock,
        refuse: Refuse,
        states: StateMachine,
    ) -> None:
        self._messages = node.subscription("joy", "sensor_msgs/msg/Joy")
        self._layout, self._clock, self._refuse, self._states = layout, clock, refuse, states
        self._stamps = Stamps(self._messages.topic)
        self._operator = OperatorInput(config, _OneOperator(ImageTimes()))

    @property
    def reference(self) -> Floats:
        """Reference u (n,) [m or rad] of the last tick."""
        return self._operator.reference

    def reset(self, reference: Floats) -> None:
        """Start at a reference (n,) [m or rad], after the button was released once."""
        self._stamps.reset()
        self._operator.reset(reference)

    def engage(self) -> None:
        """Move again, after the button was released once."""
        self._stamps.release()
        self._operator.interrupt()

    def update(self, now: float, period: float, command: Floats, *, is_held: bool) -> Floats:
        """The reference (n,) [m or rad] of a tick at a time of the monotonic clock [s]."""
        self._messages.read(lambda message: self._receive(message, now), self._refuse)
        is_held = is_held or self._states.goal is OperatingState.PAUSED
        return self._operator.update(now, period, command, is_held=is_held)

    def _receive(self, message: Any, now: float) -> None:
        deflection, is_holding = joy_deflection(self._messages.topic, message, self._layout)
        wall = self._clock.wall()
        age = (wall - self._stamps.check(message.header, wall, self._messages.source)) / 1e9
        axes = tuple(deflection.tolist())
        servo = Servo(lease=0, sequence=0, image=0, axes=axes, is_holding=is_holding)
        self._operator.receive(Received(0, now - age, servo), now)
        if self._operator.is_off_centre:
            allowed = f"each at most {DEAD_BAND} once, at rest; else --axes names a trigger"
            raise MessageError(f"{self._messages.topic} axes", axes, allowed)


class _OneOperator(Lease):
    """The lease of the only publisher."""

    def refusal(self, client: int, command: Command, now: float, *, needs_image: bool) -> str:
        return ""
