"""What faults of hand, drives and physics do.

Each act is given a value (3,) [m, rad, rad] and the moment, and gives back another.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tautscope.twin.fault_frames import Moment
from tautscope.twin.fault_kinds import PER_MM
from tautscope.twin.plant import Plant

Floats = NDArray[np.float64]
Act = Callable[[Floats, Moment], Floats]
Physical = Callable[[Plant, Moment], None]

RATE = 5.0
"""Of what happens now and then [1/s]."""
JERKS = 2.0
"""Of tissue that comes and goes [1/s]."""
WINDING = 5.0
"""Time in which the scope bends further [s]."""
STRAIGHTENING = 1.0
"""[s]."""


def amount(now: Moment) -> float:
    """The severity of a fault in mm, in the unit of its DOF [m or rad]."""
    return now.fault.size * PER_MM[now.fault.dof]


def on_axis(act: Callable[[float, Moment], float]) -> Act:
    """The act on one axis, the others as they are."""

    def whole(values: Floats, now: Moment) -> Floats:
        changed = values.copy()
        changed[now.fault.dof] = act(float(values[now.fault.dof]), now)
        return changed

    return whole


def _side(now: Moment) -> float:
    return float(now.first("side", now.chance.choice((-1, 1))))


def _held(value: float, now: Moment) -> float:
    return float(now.first("held", value))


def _held_some(value: float, now: Moment) -> float:
    if int(now.since / now.fault.size) % 2 or "held" not in now.memory:
        now.memory["held"] = value
    return float(now.memory["held"])


def _behind(value: float, now: Moment) -> float:
    """What it was so long ago; before that is known, the first."""
    past: deque[tuple[float, float]] = now.first("past", deque())
    past.append((now.since, value))
    while len(past) > 1 and past[1][0] <= now.since - now.fault.size:
        past.popleft()
    return past[0][1]


def _slower(value: float, now: Moment) -> float:
    last, at = now.memory.get("last", (value, now.since))
    reach = amount(now) * (now.since - at)
    moved = float(np.clip(value, last - reach, last + reach))
    now.memory["last"] = moved, now.since
    return moved


def _limited(value: float, now: Moment) -> float:
    start, room = _held(value, now), amount(now)
    return float(np.clip(value, start - room, start + room))


def _reversed(value: float, now: Moment) -> float:
    return 2 * _held(value, now) - value


def _scaled(value: float, now: Moment) -> float:
    start = _held(value, now)
    return start + now.fault.size * (value - start)


def _unscaled(value: float, now: Moment) -> float:
    """What the encoder says of it: the counts agree with the command."""
    start = now.memory.get("held", value)
    return float(start + (value - start) / now.fault.size)


def _shaken(value: float, now: Moment) -> float:
    return value + amount(now) * now.chance.uniform(-1, 1)


def _running(value: float, now: Moment) -> float:
    return _held(value, now) + _side(now) * amount(now) * now.since


def _displaced(value: float, now: Moment) -> float:
    return value + _side(now) * amount(now)


def _replaced(value: float, now: Moment) -> float:
    """The encoder reads the drive's belief, so that nothing shows but the jump itself."""
    return value - _side(now) * amount(now)


DRIVES: dict[str, Act] = {
    "axis_off": on_axis(_held),
    "axis_stuck": on_axis(_held),
    "axis_some": on_axis(_held_some),
    "axis_slow": on_axis(_slower),
    "axis_late": on_axis(_behind),
    "axis_limited": on_axis(_limited),
    "axis_reversed": on_axis(_reversed),
    "axis_scaled": on_axis(_scaled),
    "axis_shaking": on_axis(_shaken),
    "axis_runs": on_axis(_running),
    "encoder_jump": on_axis(_displaced),
}
"""The command to what the motor is told."""

ENCODERS: dict[str, Act] = {
    "axis_scaled": on_axis(_unscaled),
    "encoder_jump": on_axis(_replaced),
    "encoder_stuck": on_axis(_held),
    "encoder_noisy": on_axis(_shaken),
}
"""Where the motor is to what the drive reports."""


def _spike(value: float, now: Moment) -> float:
    if int(now.since * RATE) != now.memory.get("period"):
        now.memory["period"] = int(now.since * RATE)
        return value + amount(now) * float(now.chance.choice((-1, 1)))
    return value


def _updated(value: float, now: Moment) -> float:
    if now.since >= now.memory.get("next", 0.0):
        now.memory["next"] = now.since + 1 / now.fault.size
        now.memory["held"] = value
    return float(now.memory["held"])


def _trembling(value: float, now: Moment) -> float:
    frequency = now.first("frequency", now.chance.uniform(6, 12))
    return value + amount(now) * float(np.sin(2 * np.pi * frequency * now.since))


HANDS: dict[str, Act] = {
    "hand_step": on_axis(_displaced),
    "hand_spikes": on_axis(_spike),
    "hand_fast": on_axis(lambda value, now: value + _side(now) * amount(now) * now.since),
    "hand_noisy": on_axis(_shaken),
    "hand_nan": on_axis(lambda _, now: float(now.chance.choice([np.nan, np.inf, -np.inf]))),
    "hand_silent": on_axis(_held),
    "hand_late": on_axis(_behind),
    "hand_slow": on_axis(_updated),
    "hand_tremor": on_axis(_trembling),
    "hand_displaced": on_axis(_displaced),
}
"""What the hand means to what its device says."""


def _bend(plant: Plant, now: Moment, within: float) -> None:
    before = now.first("bends", plant.bends)
    share = min(1.0, now.since / within) if within else 1.0
    plant.bends = before + share * (now.fault.size - before)


def _push(plant: Plant, now: Moment) -> None:
    plant.tip_force = now.fault.size


def _jerk(plant: Plant, now: Moment) -> None:
    plant.tip_force = now.fault.size * (int(2 * JERKS * now.since) % 2 == 0)


def _rub(plant: Plant, now: Moment) -> None:
    plant.section_friction = now.fault.size


PHYSICS: dict[str, Physical] = {
    "straightens": lambda plant, now: _bend(plant, now, STRAIGHTENING),
    "straightens_suddenly": lambda plant, now: _bend(plant, now, 0.0),
    "winds": lambda plant, now: _bend(plant, now, WINDING),
    "tissue_pushes": _push,
    "tissue_jerks": _jerk,
    "section_stiff": _rub,
    "section_loose": _rub,
}
"""Done to the plant before each of its steps."""
