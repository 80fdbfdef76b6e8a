"""Fault models of the operator input, the drives, the encoders and the plant.

A model of an axis maps the value of one DOF [m or rad] to the faulty value.
"""

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from tautscope.twin.fault_state import FaultState, Floats
from tautscope.twin.plant import Plant

AxisFault = Callable[[float, FaultState], float]

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
    if int(fault.elapsed / fault.size) % 2 or "held" not in fault.memory:
        fault.memory["held"] = value
    return float(fault.memory["held"])


def _delay(value: float, fault: FaultState) -> float:
    """The delayed value; the first one until the delay has passed."""
    past: deque[tuple[float, float]] = fault.hold("past", deque())
    past.append((fault.elapsed, value))
    while len(past) > 1 and past[1][0] <= fault.elapsed - fault.size:
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
    return start + fault.size * (value - start)


def _unscale(value: float, fault: FaultState) -> float:
    """The encoder position in the wrong counts: it agrees with the command."""
    start = fault.memory.get("held", value)
    return float(start + (value - start) / fault.size)


def _add_noise(value: float, fault: FaultState) -> float:
    return value + fault.amplitude * fault.rng.uniform(-1, 1)


def _add_offset(value: float, fault: FaultState) -> float:
    return value + fault.signed_amplitude


def _add_spikes(value: float, fault: FaultState) -> float:
    if int(fault.elapsed * EVENT_RATE) != fault.memory.get("period"):
        fault.memory["period"] = int(fault.elapsed * EVENT_RATE)
        return value + fault.amplitude * float(fault.rng.choice((-1, 1)))
    return value


def _resample(value: float, fault: FaultState) -> float:
    if fault.elapsed >= fault.memory.get("next", 0.0):
        fault.memory["next"] = fault.elapsed + 1 / fault.size
        fault.memory["held"] = value
    return float(fault.memory["held"])


def _add_tremor(value: float, fault: FaultState) -> float:
    frequency = fault.hold("frequency", fault.rng.uniform(6, 12))
    return value + fault.amplitude * float(np.sin(2 * np.pi * frequency * fault.elapsed))


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
    "axis_runs": lambda value, fault: _hold(value, fault) + fault.signed_amplitude * fault.elapsed,
    "encoder_jump": _add_offset,
}
"""Kind -> model from the command to the set-point of the motor."""
ENCODER_FAULTS: dict[str, AxisFault] = {
    "axis_scaled": _unscale,
    # Only the jump itself is visible to the drive.
    "encoder_jump": lambda value, fault: value - fault.signed_amplitude,
    "encoder_stuck": _hold,
    "encoder_noisy": _add_noise,
}
"""Kind -> model from the motor position to the position the drive reports."""
REFERENCE_FAULTS: dict[str, AxisFault] = {
    "hand_step": _add_offset,
    "hand_spikes": _add_spikes,
    "hand_fast": lambda value, fault: value + fault.signed_amplitude * fault.elapsed,
    "hand_noisy": _add_noise,
    "hand_nan": lambda _, fault: float(fault.rng.choice([np.nan, np.inf, -np.inf])),
    "hand_silent": _hold,
    "hand_late": _delay,
    "hand_slow": _resample,
    "hand_tremor": _add_tremor,
    "hand_displaced": _add_offset,
}
"""Kind -> model from the operator's reference to the reference of the input device."""


def _changed_bends(plant: Plant, fault: FaultState, duration: float) -> dict[str, float]:
    before = fault.hold("bends", plant.bends)
    share = min(1.0, fault.elapsed / duration) if duration else 1.0
    return {"bends": before + share * (fault.size - before)}


PLANT_FAULTS: dict[str, Callable[[Plant, FaultState], dict[str, float]]] = {
    "straightens": lambda plant, fault: _changed_bends(plant, fault, STRAIGHTENING_TIME),
    "straightens_suddenly": lambda plant, fault: _changed_bends(plant, fault, 0.0),
    "winds": lambda plant, fault: _changed_bends(plant, fault, WINDING_TIME),
    "tissue_pushes": lambda _, fault: {"tip_force": fault.size},
    "tissue_jerks": lambda _, fault: {
        "tip_force": fault.size * (int(2 * JERK_RATE * fault.elapsed) % 2 == 0)
    },
    "section_stiff": lambda _, fault: {"section_friction": fault.size},
    "section_loose": lambda _, fault: {"section_friction": fault.size},
}
"""Kind -> attributes that the plant has before each of its steps."""
