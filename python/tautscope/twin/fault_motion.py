"""Fault models of the operator input, the drives, the encoders and the plant.

A model of an axis maps the value of one DOF [m or rad] to the faulty value.
"""

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from tautscope.twin.fault_state import FaultState, Floats
from tautscope.twin.plant import Plant

AxisFault = Callable[[float, FaultState], float]
PlantFault = Callable[[Plant, FaultState], None]

EVENT_RATE = 5.0
"""Rate of intermittent spikes and stalls [1/s]."""
JERK_RATE = 2.0
"""Rate at which an intermittent tissue force is applied [1/s]."""
WINDING_TIME = 5.0
"""Time in which the number of bends grows [s]."""
STRAIGHTENING_TIME = 1.0
"""Time in which the number of bends falls [s]."""


def apply_to_axes(
    models: dict[str, AxisFault], values: Floats, faults: Sequence[FaultState]
) -> Floats:
    """Values (3,) [m, rad, rad] with the faults that have one of the models, in their order."""
    for fault in faults:
        if (model := models.get(fault.spec.kind)) is not None:
            values = values.copy()
            values[fault.spec.dof] = model(float(values[fault.spec.dof]), fault)
    return values


def _hold(value: float, fault: FaultState) -> float:
    return float(fault.hold("held", value))


def _hold_intermittently(value: float, fault: FaultState) -> float:
    if int(fault.elapsed / fault.spec.size) % 2 or "held" not in fault.memory:
        fault.memory["held"] = value
    return float(fault.memory["held"])


def _delay(value: float, fault: FaultState) -> float:
    """The delayed value; the first one until the delay has passed."""
    past: deque[tuple[float, float]] = fault.hold("past", deque())
    past.append((fault.elapsed, value))
    while len(past) > 1 and past[1][0] <= fault.elapsed - fault.spec.size:
        past.popleft()
    return past[0][1]


def _limit_speed(value: float, fault: FaultState) -> float:
    last, at = fault.memory.get("last", (value, fault.elapsed))
    reach = fault.amplitude * (fault.elapsed - at)
    moved = float(np.clip(value, last - reach, last + reach))
    fault.memory["last"] = moved, fault.elapsed
    return moved


def _limit_range(value: float, fault: FaultState) -> float:
    start, room = _hold(value, fault), fault.amplitude
    return float(np.clip(value, start - room, start + room))


def _scale(value: float, fault: FaultState) -> float:
    start = _hold(value, fault)
    return start + fault.spec.size * (value - start)


def _unscale(value: float, fault: FaultState) -> float:
    """The encoder position in the wrong counts: it agrees with the command."""
    start = fault.memory.get("held", value)
    return float(start + (value - start) / fault.spec.size)


def _add_noise(value: float, fault: FaultState) -> float:
    return value + fault.amplitude * fault.rng.uniform(-1, 1)


def _hold_and_ramp(value: float, fault: FaultState) -> float:
    return _hold(value, fault) + fault.sign * fault.amplitude * fault.elapsed


def _add_ramp(value: float, fault: FaultState) -> float:
    return value + fault.sign * fault.amplitude * fault.elapsed


def _add_offset(value: float, fault: FaultState) -> float:
    return value + fault.sign * fault.amplitude


def _subtract_offset(value: float, fault: FaultState) -> float:
    """The encoder position without the jump: only the jump itself is visible to the drive."""
    return value - fault.sign * fault.amplitude


DRIVE_FAULTS: dict[str, AxisFault] = {
    "axis_off": _hold,
    "axis_stuck": _hold,
    "axis_some": _hold_intermittently,
    "axis_slow": _limit_speed,
    "axis_late": _delay,
    "axis_limited": _limit_range,
    "axis_reversed": lambda value, fault: 2 * _hold(value, fault) - value,
    "axis_scaled": _scale,
    "axis_shaking": _add_noise,
    "axis_runs": _hold_and_ramp,
    "encoder_jump": _add_offset,
}
"""Kind -> model from the command to the set-point of the motor."""

ENCODER_FAULTS: dict[str, AxisFault] = {
    "axis_scaled": _unscale,
    "encoder_jump": _subtract_offset,
    "encoder_stuck": _hold,
    "encoder_noisy": _add_noise,
}
"""Kind -> model from the motor position to the position the drive reports."""


def _add_spikes(value: float, fault: FaultState) -> float:
    if int(fault.elapsed * EVENT_RATE) != fault.memory.get("period"):
        fault.memory["period"] = int(fault.elapsed * EVENT_RATE)
        return value + fault.amplitude * float(fault.rng.choice((-1, 1)))
    return value


def _resample(value: float, fault: FaultState) -> float:
    if fault.elapsed >= fault.memory.get("next", 0.0):
        fault.memory["next"] = fault.elapsed + 1 / fault.spec.size
        fault.memory["held"] = value
    return float(fault.memory["held"])


def _add_tremor(value: float, fault: FaultState) -> float:
    frequency = fault.hold("frequency", fault.rng.uniform(6, 12))
    return value + fault.amplitude * float(np.sin(2 * np.pi * frequency * fault.elapsed))


REFERENCE_FAULTS: dict[str, AxisFault] = {
    "hand_step": _add_offset,
    "hand_spikes": _add_spikes,
    "hand_fast": _add_ramp,
    "hand_noisy": _add_noise,
    "hand_nan": lambda _, fault: float(fault.rng.choice([np.nan, np.inf, -np.inf])),
    "hand_silent": _hold,
    "hand_late": _delay,
    "hand_slow": _resample,
    "hand_tremor": _add_tremor,
    "hand_displaced": _add_offset,
}
"""Kind -> model from the operator's reference to the reference of the input device."""


def _change_bends(plant: Plant, fault: FaultState, duration: float) -> None:
    before = fault.hold("bends", plant.bends)
    share = min(1.0, fault.elapsed / duration) if duration else 1.0
    plant.bends = before + share * (fault.spec.size - before)


def _push_tip(plant: Plant, fault: FaultState) -> None:
    plant.tip_force = fault.spec.size


def _jerk_tip(plant: Plant, fault: FaultState) -> None:
    plant.tip_force = fault.spec.size * (int(2 * JERK_RATE * fault.elapsed) % 2 == 0)


def _set_section_friction(plant: Plant, fault: FaultState) -> None:
    plant.section_friction = fault.spec.size


PLANT_FAULTS: dict[str, PlantFault] = {
    "straightens": lambda plant, fault: _change_bends(plant, fault, STRAIGHTENING_TIME),
    "straightens_suddenly": lambda plant, fault: _change_bends(plant, fault, 0.0),
    "winds": lambda plant, fault: _change_bends(plant, fault, WINDING_TIME),
    "tissue_pushes": _push_tip,
    "tissue_jerks": _jerk_tip,
    "section_stiff": _set_section_friction,
    "section_loose": _set_section_friction,
}
"""Kind -> model that changes the plant before each of its steps."""
