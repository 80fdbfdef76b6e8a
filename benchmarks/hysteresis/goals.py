"""Goals of the hysteresis benchmark, and the conditions under which they are measured."""

from dataclasses import dataclass

from tautscope.config import DISTURBANCES, LawConfig
from tautscope.dof import Dof

OPERATORS = ("operator", "disturbed operator")
LATENCIES = {"0 ms": 0.0, "200 ms": 0.2}
SEVERAL = ("highlights", "debris", "smoke", "inset")
CONDITIONS: dict[str, tuple[str, ...]] = {
    name.replace("_", " "): (name,) for name in DISTURBANCES if name != "no_instrument"
} | {", ".join(SEVERAL): SEVERAL}


@dataclass(frozen=True)
class Goal:
    """Goal of a quantity.

    Attributes:
        unit: "share", "ratio", "tip" (the display unit of the DOF), or what is counted.
        value: Limit in that unit, for all DOFs or each; None if there is no goal.
        sense: Whether it is an upper ("max") or a lower ("min") limit.
        paired: The quantity is the ratio of this one in profile `best` to that in profile `paper`.
    """

    unit: str
    value: float | tuple[float, float, float] | None = None
    sense: str = "max"
    paired: str | None = None

    def limit(self, dof: Dof) -> float | None:
        """Limit for one DOF."""
        return self.value[dof] if isinstance(self.value, tuple) else self.value


GOALS = {
    "operator: reduction of tracking error": Goal("share", (0.91, 0.81, 0.81), "min"),
    "operator: tracking error": Goal("tip"),
    "operator: largest error": Goal("tip", (1.8, 0.38, 0.24)),
    "operator: tip overspeed": Goal("ratio", 2.0),
    "operator: creep": Goal("tip", (0.5, 0.05, 0.01)),
    "operator: bound of the reduction": Goal("share", None, "min"),
    "disturbed operator: reduction of tracking error": Goal("share", (0.78, 0.74, 0.85), "min"),
    "disturbed operator: tracking error": Goal("tip"),
    "disturbed operator: largest error": Goal("tip"),
    "disturbed operator: tip overspeed": Goal("ratio"),
    "reduction of mean width": Goal("share", (0.98, 0.96, 0.95), "min"),
    "reduction of max width": Goal("share", (0.92, 0.88, 0.87), "min"),
    "actuator gain": Goal("ratio", LawConfig().free_gain),
    "tip overspeed": Goal("ratio", 2.0),
    "tip overspeed over paper's": Goal("ratio", 1.0, paired="tip overspeed"),
    "start": Goal("periods", 1.0),
    "second period's width left": Goal("share"),
    "three DOFs at once: reduction": Goal("share", 0.90, "min"),
    "width 10-2-10 mm: overshoot": Goal("tip", 1.0),
    "width 10-2-10 mm: strokes until within 10 %": Goal("strokes", 2.0),
    "start 50 % too wide: overshoot": Goal("tip", 1.0),
    "start 50 % too wide: periods until gone": Goal("periods", 1.0),
    **{f"latency {name}: change of reduction": Goal("share", 0.02) for name in LATENCIES},
    "tremor at rest: motor": Goal("tip", 4.0),
    "tremor at rest: tip": Goal("tip", 2.0),
    "tremor: motor travel over reference's": Goal("ratio"),
    **{f"{name}: change of reduction": Goal("share", 0.03) for name in CONDITIONS},
    "tracking error": Goal("tip"),
    "state error": Goal("tip"),
    "frames used": Goal("share", None, "min"),
    "three DOFs at once: tracking error": Goal("tip"),
    "three DOFs at once: state error": Goal("tip"),
    "three DOFs at once: frames used": Goal("share", None, "min"),
}
"""In the order of the table."""
