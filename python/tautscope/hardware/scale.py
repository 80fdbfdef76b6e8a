"""Conversion between SI units and the counts of an encoder, and the limits of a command."""

import math
from dataclasses import dataclass

from tautscope.config import AxisConfig
from tautscope.dof import Motor
from tautscope.errors import SignalError


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion of one DOF between SI units and encoder counts.

        x = home + sign counts / counts_per_unit

    `dof` is the motor, for errors.
    """

    axis: AxisConfig
    dof: Motor

    def to_counts(self, position: float) -> int:
        """Convert a position [m or rad] to the nearest count."""
        axis = self.axis
        return round(axis.sign * (position - axis.home) * axis.counts_per_unit)

    def to_position(self, counts: int) -> float:
        """Convert counts to a position [m or rad]."""
        axis = self.axis
        return axis.home + axis.sign * counts / axis.counts_per_unit

    def travel_counts(self) -> tuple[int, int]:
        """Both ends of the travel in counts, the smaller first."""
        lower, upper = sorted(self.to_counts(end) for end in self.axis.travel)
        return lower, upper

    def speed_counts(self) -> int:
        """The speed limit [counts/s], rounded up."""
        return math.ceil(self.axis.speed_limit * self.axis.counts_per_unit)

    def is_inside(self, position: float) -> bool:
        """Whether a position [m or rad] is inside the travel, give or take a count."""
        lower, upper = self.axis.travel
        count = 1 / self.axis.counts_per_unit
        return lower - count <= position <= upper + count

    def checked_counts(self, command: float, previous: float, cycle: float) -> int:
        """Convert a command to counts, after checking it against the limits.

        Args:
            command: [m or rad].
            previous: The previous command, or the position at the start [m or rad].
            cycle: Time between the two [s].

        Raises:
            SignalError: The command is not finite, outside the travel, or exceeds the speed limit.
        """
        axis, command = self.axis, float(command)  # as a number in messages
        field = f"command[{self.dof.label}]"
        if not math.isfinite(command):
            raise SignalError(field, command, "a finite number")
        if not self.is_inside(command):
            lower, upper = axis.travel
            raise SignalError(field, command, f"{lower} to {upper}, {self.dof.key}.travel")
        step = axis.speed_limit * cycle + 1 / axis.counts_per_unit
        if abs(command - previous) > step:
            raise SignalError(
                field,
                command,
                f"within {step:.6g} of {previous:.6g}, {self.dof.key}.speed_limit "
                f"over a cycle of {cycle} s",
            )
        return self.to_counts(command)
