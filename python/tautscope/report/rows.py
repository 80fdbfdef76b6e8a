"""The rows of Table 1 and of the table of the operator motion: titles, meanings and goals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tautscope.dof import Dof, NamedDof

Worst = Literal["min", "max"]


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table.

    Attributes:
        name: Field of `DofResult` or of the figures of an operator motion.
        title: Title in printed tables.
        meaning: What it is, in a sentence for a reader who has seen nothing else.
        kind: ``length`` is in the DOF's unit, ``share`` is printed in percent, ``number`` and
            ``count`` have no conversion.
        worst: Whether the worst value is the smallest or the largest; a goal is a lower or an upper
            limit accordingly.
        goal: Limit for profile ``best`` on the twin, of all DOFs or of each [m or rad, fraction];
            the goals of docs/hysteresis.md.
        in_summary: Whether ``--json`` contains it.
    """

    name: str
    title: str
    meaning: str
    kind: Literal["length", "share", "number", "count"]
    worst: Worst = "max"
    goal: float | tuple[float, float, float] | None = None
    in_summary: bool = False

    def limit(self, dof: NamedDof) -> float | None:
        """The goal of one DOF; another robot has none."""
        if not isinstance(dof, Dof):
            return None
        return self.goal[dof] if isinstance(self.goal, tuple) else self.goal

    def holds(self, dof: NamedDof, value: float) -> bool | None:
        """Whether a value meets the goal; None without one. An unknown value does not."""
        limit = self.limit(dof)
        if limit is None:
            return None
        rounding = 1e-9 * limit
        if self.worst == "max":
            return value <= limit + rounding
        return value >= limit - rounding


ROWS = (
    Row(
        "uncompensated",
        "uncompensated width",
        "Slack: how far the command moves after a reversal before the tip does. Mean width of the "
        "loop of the tip over the command, without compensation.",
        "length",
        in_summary=True,
    ),
    Row(
        "uncompensated_max",
        "uncompensated width, largest",
        "The same loop where it is widest.",
        "length",
    ),
    Row(
        "compensated",
        "compensated width",
        "What is left of the slack for the operator: mean width of the loop of the tip over the "
        "reference, with compensation. 0 is ideal; a negative width means that the tip leads.",
        "length",
        in_summary=True,
    ),
    Row("compensated_max", "compensated width, largest", "This loop where it is widest.", "length"),
    Row(
        "reduction",
        "reduction",
        "Share of the mean width that compensation removes: 1 - compensated / uncompensated.",
        "share",
        "min",
        0.95,
        in_summary=True,
    ),
    Row(
        "reduction_max",
        "reduction of the largest width",
        "The same share of the largest widths.",
        "share",
        "min",
        0.90,
        in_summary=True,
    ),
    Row(
        "uncompensated_estimate",
        "uncompensated width, by camera",
        "The uncompensated width with the tip as the camera measures it, like the article's.",
        "length",
    ),
    Row(
        "compensated_estimate",
        "compensated width, by camera",
        "The compensated width with the tip as the camera measures it.",
        "length",
    ),
    Row(
        "reduction_estimate",
        "reduction, by camera",
        "The reduction of the two widths by camera.",
        "share",
        "min",
    ),
    Row(
        "start_periods",
        "periods until settled",
        "Periods of the sine until the compensated width stays within 1.2 times its last value: "
        "how long the slack takes to be estimated.",
        "count",
        goal=1.0,
        in_summary=True,
    ),
    Row(
        "tracking_rms",
        "tracking error, RMS",
        "Distance of the tip from the reference, once settled.",
        "length",
        in_summary=True,
    ),
    Row(
        "tracking_estimate",
        "tracking error, RMS, by camera",
        "The tracking error with the tip as the camera measures it.",
        "length",
    ),
    Row(
        "state_rms",
        "state error, RMS",
        "Error of the loop's estimate of the tip at the time of each image.",
        "length",
        in_summary=True,
    ),
    Row(
        "marker_rms_px",
        "marker error, RMS [px]",
        "Distance of a band's measured position in the image from its true one.",
        "number",
        in_summary=True,
    ),
    Row(
        "frames_used",
        "frames used",
        "Share of the images that determined this degree of freedom. A straight instrument does "
        "not show its rotation.",
        "share",
        "min",
    ),
    Row(
        "tip_overspeed",
        "tip overspeed",
        "Largest speed of the tip over that of the reference (99.9th percentile). A tip that jumps "
        "has a large value; 1 is ideal.",
        "number",
        goal=2.0,
    ),
    Row(
        "actuator_gain",
        "actuator gain",
        "Largest step of the command over that of the reference: how hard the motor works while it "
        "crosses the slack.",
        "number",
        goal=5.0,
    ),
)

OPERATOR_ROWS = (
    Row(
        "uncompensated_rms",
        "uncompensated tracking error, RMS",
        "Distance of the tip from the reference without compensation.",
        "length",
    ),
    Row(
        "compensated_rms",
        "compensated tracking error, RMS",
        "Distance of the tip from the reference with compensation.",
        "length",
    ),
    Row(
        "reduction",
        "reduction",
        "Share of the tracking error that compensation removes.",
        "share",
        "min",
        (0.85, 0.78, 0.80),
    ),
    Row(
        "largest",
        "largest error",
        "Largest distance of the tip from the reference with compensation.",
        "length",
        goal=(2e-3, 0.5, 0.25),
    ),
    Row(
        "overspeed",
        "tip overspeed",
        "Largest speed of the tip over that of the reference (99.9th percentile).",
        "number",
        goal=2.0,
    ),
    Row(
        "creep",
        "creep",
        "Travel of the tip while the operator rests: it should stand still.",
        "length",
        goal=(0.5e-3, 0.05, 0.01),
    ),
    Row(
        "bound",
        "bound of the reduction",
        "Reduction of a law that knows tip and slack exactly: no goal, but what could be reached.",
        "share",
        "min",
    ),
    Row(
        "slack",
        "slack found",
        "Width of the slack that the loop has found by the end of the run.",
        "length",
    ),
)

ARTICLE: dict[str, dict[NamedDof, float]] = {
    "uncompensated": {Dof.INSERTION: 10e-3, Dof.ROTATION: 1.8, Dof.BENDING: 1.1},
    "compensated": {Dof.INSERTION: 2.5e-3, Dof.ROTATION: 0.4, Dof.BENDING: 0.3},
    "reduction": {Dof.INSERTION: 0.75, Dof.ROTATION: 0.78, Dof.BENDING: 0.73},
}
"""Table 1 of the article [m or rad, fraction]."""
