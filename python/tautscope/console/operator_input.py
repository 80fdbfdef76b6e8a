"""The reference from the operator's commands, and the supervision of these: the dead man's switch.

It runs in the process of the control loop, once per control tick. Whatever happens to the page, the
browser, the network or the web server, the reference rests when no acceptable command arrives.
"""

from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.console.lease import Lease
from tautscope.console.messages import Received, Servo
from tautscope.console.pointing import Point, Pointing
from tautscope.console.programs import Program, motion_limits
from tautscope.loop.kinematics import Floats

COMMAND_TIMEOUT = 0.1
"""Time without an accepted command after which motion by hand stops [s]."""
IDLE_TIMEOUT = 0.5
"""The same while no hand moves anything, at rest and in a program [s]. A page may be busy for a
moment: browsers hold its timers back for about 0.1 s when a touch begins."""
LARGEST_SPEED = 0.75
"""Speed at full deflection and scale 1 [of the largest speed that the loop follows]."""
DEAD_BAND = 0.2
"""Deflection of an axis that counts as rest; sticks that are worn rest at up to 0.15."""
RAMP_TIME = 0.15
"""Time from rest to the largest speed [s]; deceleration is immediate."""


class OperatorInput:
    """Integrates the commands of the holder of the lease into a reference.

    At each tick v is the commanded speed, ramped up from rest, and u <- u + v dt. It is that of the
    deflections, or by `Pointing` towards a pixel. The reference rests, and moves again only after
    the operator has let go of the input device once, when

    - no command was accepted for `COMMAND_TIMEOUT`, or at rest for `IDLE_TIMEOUT`,
    - the lease changes,
    - motion is stopped (`stop`) or held by the supervisor.

    It is let go when nothing is held and every axis is within `DEAD_BAND`: one that never rests, as
    a trigger in place of a stick, moves nothing.

    Attributes:
        reference: u (n,) [m or rad].
        scale: (n,) share of the largest speed at full deflection.
        is_coupled: (n,) whether the input device moves each DOF (clutch).
        program: The motion that runs by itself, if there is one.
        program_ended: How the last program ended; empty before one has.
        age: None, because the reference is made in the tick.
        rested_by: Why the last motion ended, if the operator did not end it.
        stopped_by: Why motion is stopped until it is enabled; empty if it is not.
        must_release: Whether the operator has to let go of the input device before it moves
            anything.
        is_off_centre: Whether the device moves nothing because an axis does not rest.
        refused: Reason -> number of refused commands.
    """

    age: None = None

    def __init__(self, config: Config, lease: Lease) -> None:
        self._lease = lease
        limits: Final = motion_limits(config)
        self._speed: Final = LARGEST_SPEED * limits.speed
        self._limits: Final = limits.least, limits.most
        self.reference = limits.start
        count = len(self.reference)
        self.scale = np.full(count, 0.4)
        self.is_coupled = np.ones(count, bool)
        self.program: Program | None = None
        self.program_ended = ""
        self.stopped_by = self.rested_by = ""
        self.refused: Counter[str] = Counter()
        self._pointing: Final = None if config.dof else Pointing(config)
        self._point: Point | None = None
        self._axes = np.zeros(count)
        self._velocity = np.zeros(count)
        self._accepted_at = -float("inf")
        self.must_release = True
        self.is_off_centre = False

    @property
    def is_moving(self) -> bool:
        """Whether the reference moves."""
        return self.program is not None or bool(self._velocity.any())

    def is_present(self, now: float) -> bool:
        """Whether a command was accepted lately, at a time [s]."""
        return now - self._accepted_at <= self._timeout

    @property
    def _timeout(self) -> float:
        is_held = self._point is not None or self._axes.any()
        by_hand = self.program is None and (is_held or self._velocity.any())
        return COMMAND_TIMEOUT if by_hand else IDLE_TIMEOUT

    def receive(self, received: Received, now: float) -> None:
        """Take a deflection of the input device, unless the lease refuses it."""
        servo = received.message
        assert isinstance(servo, Servo)
        # While a rig opens there are no images yet; then only the page's presence counts.
        moves = servo.is_holding or self.program is not None
        reason = self._fault(servo)
        if reason := reason or self._lease.refusal(received.client, servo, now, needs_image=moves):
            self.count_refusal(reason)
            return
        # Its age counts from the arrival, also if the control loop reads it late.
        self._accepted_at = min(received.at, now)
        axes = np.array(servo.axes)
        beyond = np.maximum(np.abs(axes) - DEAD_BAND, 0)
        if not servo.is_holding:
            self.must_release &= bool(beyond.any())
            self.is_off_centre = self.must_release
            self._axes[:], self._point = 0, None
        elif not self.must_release:
            self.rested_by = ""
            self._end_program("the operator moves")
            self._axes[:] = np.sign(axes) * beyond / (1 - DEAD_BAND)
            self._point = servo.point

    def count_refusal(self, reason: str) -> None:
        """Count a refused command, without the figures of its reason."""
        self.refused[reason.partition(":")[0]] += 1

    def start(self, program: Program) -> None:
        """Let a program move the reference from now on."""
        self.interrupt()
        self.program, self.program_ended = program, ""

    def reset(self, reference: Floats) -> None:
        """Continue from another reference (n,) [m or rad], at the start of a new run."""
        self.interrupt()
        self.reference = reference.copy()

    def stop(self, reason: str) -> None:
        """Stop motion until `enable`."""
        self.interrupt(reason)
        self.stopped_by = reason

    def enable(self) -> None:
        """End a stop; nothing moves before the operator has let go of the input device."""
        self.interrupt()
        self.stopped_by = ""

    def interrupt(self, reason: str = "") -> None:
        """Rest until the operator has let go of the input device; `reason` is shown."""
        if self.is_moving or not reason:
            self.rested_by = "" if self.program else reason
        self.must_release = True
        self._axes[:], self._point = 0, None
        self._velocity[:] = 0
        self._end_program(reason)

    def update(self, now: float, period: float, command: Floats, *, is_held: bool) -> Floats:
        """The reference (n,) [m or rad] of a control tick.

        Args:
            now: Time [s, monotonic clock].
            period: Control period [s].
            command: The last command of the loop (n,) [m or rad].
            is_held: Whether the supervisor holds motion.
        """
        if is_held or self.stopped_by:
            self.interrupt("the supervisor holds motion" if self.program else "")
        elif not self.is_present(now):
            self.interrupt(f"no accepted command for {self._timeout:g} s")
        elif self.program is not None:
            self.reference = self.program.advance(period)
            if self.program.is_over:
                self.interrupt()
        else:
            self._integrate(period, command)
        return self.reference.copy()

    def _fault(self, servo: Servo) -> str:
        """Why a deflection is none of this instrument, else empty."""
        if len(servo.axes) != len(self._axes):
            return "not one deflection per degree of freedom"
        if servo.point is None or (self._pointing and self._pointing.is_in_image(servo.point)):
            return ""
        return "no point in an image of the bands"

    def _end_program(self, reason: str) -> None:
        if (program := self.program) is not None:
            share = f"{program.elapsed / program.duration:.0%}"
            early = f" ended early, at {share}{': ' if reason else ''}{reason}"
            self.program_ended = program.name + (": done" if program.is_over else early)
        self.program = None

    def _integrate(self, period: float, command: Floats) -> None:
        speed = self.scale * self._speed * self.is_coupled
        lower, upper = self._limits
        low, high = np.minimum(self.reference, command), np.maximum(self.reference, command)

        def is_blocked(direction: Floats) -> NDArray[np.bool_]:
            return (high >= upper) & (direction > 0) | (low <= lower) & (direction < 0)

        allowed = np.abs(self._velocity) + period / RAMP_TIME * self._speed
        if self._pointing is None or self._point is None:
            target = self._axes * speed
            target[is_blocked(target)] = 0
        else:
            place = self.reference, self._point
            target = self._pointing.velocity(*place, speed, period, is_blocked)
            # All by one factor, so that the direction stays that towards the pixel.
            target /= max(1.0, np.max(np.abs(target) / allowed))
        ramped = np.clip(target, -allowed, allowed)
        ramped[ramped * self._velocity < 0] = 0
        self._velocity = ramped
        self.reference = self.reference + ramped * period
