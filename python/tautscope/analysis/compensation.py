"""What compensation would do: the loop, simulated on many plays that are fitted to a record."""

import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tautscope.analysis.compensator import (
    GAP,
    LONGEST_GAP,
    MOST_DELAY,
    MOST_SPEED,
    Parts,
    compensator,
    late_by,
    scale_of,
    sensors_of,
    tip_interval,
)
from tautscope.analysis.delayed_play import turns
from tautscope.analysis.identification import Identification, Interval
from tautscope.analysis.models import prandtl_ishlinskii
from tautscope.analysis.models.prandtl_ishlinskii import PrandtlIshlinskii
from tautscope.analysis.models.task import Floats, extremes
from tautscope.analysis.setpoints import ramped
from tautscope.config import Config, from_document
from tautscope.loop.actuators import Actuators
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.safety import MEANINGS, Reaction, by_urgency
from tautscope.report.metrics import rms
from tautscope.runs.records import Record

LONGEST = 100.0
"""Simulated time [s]."""
STROKES = 20
"""Strokes of a longer record that are simulated, at their own speed where `LONGEST` is enough."""
UNTIMED = 0.02
"""Interval of samples without a time [s]."""
LEAST_REDUCTION = 0.1
"""Of the RMS error, from which on the compensator helps."""
FITTED = 16_000
"""Of a longer record, the plays of the simulation are fitted to at most so many tips, and to the
extremes of the command in as many parts."""
PERIOD = Config().control.period
CHECKED = 20
"""Ticks from one look at the supervision of the simulated loop to the next."""
_HELD = Reaction.HOLD_MOTION.rank


@dataclass(frozen=True, eq=False)
class Compensation:
    """The second half of a simulated motion [tip's unit].

    Attributes:
        reference: (n,).
        without: (n,) tip; the command is the reference.
        compensated: (n,) tip with the loop.
        held: Why the loop held its motion; empty if it did not.
    """

    reference: Floats
    without: Floats
    compensated: Floats
    held: str = ""

    @property
    def before(self) -> float:
        """RMS of tip minus reference without the loop."""
        return rms(self.without - self.reference)

    @property
    def after(self) -> float:
        """RMS of tip minus reference with the loop."""
        return rms(self.compensated - self.reference)

    @property
    def helps(self) -> bool:
        """Whether the loop reduces the error."""
        return not self.held and self.after < (1 - LEAST_REDUCTION) * self.before


def simulate(parts: Parts, name: str) -> Compensation:
    """Run the `compensator` of some records on plays that are fitted to one of them."""
    record, found = parts[name]
    played, late = as_played(record, found)
    settings, scale = compensator({name: (played, late)}), scale_of(played, late)
    if record.is_timed:
        rate = float(np.ptp(record.clock[_fastest(record, found)]) / np.ptp(played.clock))
        settings = _alone(compensator(parts), list(parts).index(name), sensors_of(parts)[0], rate)
        scale = scale_of(record, found)
    delay = max(late_by(played, late), 0.0)
    return run(settings, played, *plant(record, found), delay, scale=scale)


def _alone(
    document: dict[str, Any], index: int, sensors: Sequence[int], rate: float
) -> dict[str, Any]:
    """One degree of freedom of a `compensator`, in a time that runs faster by a rate."""
    dof, motors, usual = document["dof"][index], document["actuators"], Config().safety
    measurement, safety = dict(document["measurement"]), document.get("safety", {})
    if "delays" in measurement:
        measurement["delays"] = [measurement["delays"][sensors[index]] / rate]
    return document | {
        "dof": [dof | {"speed": min(dof["speed"] * rate, MOST_SPEED[dof["unit"]])}],
        "measurement": measurement,
        "actuators": {
            "matrix": [[motors["matrix"][index][index]]],
            "offsets": [motors["offsets"][index]],
            "units": [motors["units"][index]],
        },
        "safety": {key: max(value / rate, getattr(usual, key)) for key, value in safety.items()},
    }


def plant(record: Record, found: Identification) -> tuple[PrandtlIshlinskii, float]:
    """Plays of many radii that explain a record, and the RMS error of its tip [tip's unit].

    Without the drift, and with the command as late as the tip. They differ from the plays of
    `found`, of which the compensator knows.
    """
    seen = np.flatnonzero(np.isfinite(record.measured))
    kept = np.union1d(
        extremes(record.command, -(-len(record.command) // FITTED)),
        seen[:: -(-len(seen) // FITTED)],
    )
    clock = record.clock
    command = np.interp(clock[kept] - found.delay.value, clock, record.command)
    tip = (record.measured - found.drift)[kept]
    plays = prandtl_ishlinskii.fit(command, tip)
    return plays, rms(plays.predict(command) - tip)


def as_played(record: Record, found: Identification) -> tuple[Record, Identification]:
    """A record with a time from 0 to at most `LONGEST`, and its delay and strokes in this time.

    Of a longer record it is the part whose strokes are the fastest. A loop does worse on a motion
    that is played faster than it is. Without a time the delay is at most `MOST_DELAY`, too.
    """
    clock = record.clock * (1.0 if record.is_timed else UNTIMED)
    kept = _fastest(record, found)
    speed = max(1.0, float(np.ptp(clock[kept])) / LONGEST)
    if not record.is_timed:
        speed = max(speed, UNTIMED * found.delay.value / MOST_DELAY)
    time = (clock[kept] - clock[kept][0]) / speed
    scale = (1.0 if record.is_timed else UNTIMED) / speed
    delay = Interval(*(scale * each for each in vars(found.delay).values()))
    played = replace(found, delay=delay, stroke=scale * found.stroke)
    return replace(record.part(kept), time=time), played


def _fastest(record: Record, found: Identification) -> slice:
    """`LONGEST` of a record, or `STROKES` strokes if they take longer: the fastest ones."""
    clock = record.clock * (1.0 if record.is_timed else UNTIMED)
    at = clock[turns(record.command, found.width.value / abs(found.gain))]
    if clock[-1] - clock[0] <= LONGEST or len(at) <= STROKES:
        return slice(None)
    first = int(np.argmin(at[STROKES:] - at[:-STROKES]))
    start = at[first]
    end = max(at[first + STROKES], min(start + LONGEST, clock[-1]))
    start = max(min(start, end - LONGEST), clock[0])
    part = slice(*np.searchsorted(clock, [start, end]).tolist())
    has_tips = np.count_nonzero(np.isfinite(record.measured[part])) > 1
    return part if has_tips else slice(None)


@contextmanager
def _silent() -> Iterator[None]:
    """Without the log messages of a loop, whose motors nobody has."""
    log = logging.getLogger("tautscope.loop")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(level)


@_silent()
def run(
    settings: dict[str, Any],
    record: Record,
    plays: PrandtlIshlinskii,
    noise: float,
    delay: float | None = None,
    *,
    scale: float,
) -> Compensation:
    """Run a `compensator` of one degree of freedom on plays, with a record's motion as reference.

    Metres or radians per unit of the tip are those of the settings (`scale_of`).

    The tip is measured as often as in the record, with noise, and arrives late by a delay [s], by
    default that of the settings, with a time stamp that is as late. The delay belongs to the
    measurement, not to the motion.
    """
    config = from_document(settings)
    actuators, loop = Actuators(config), HysteresisReduction(config)
    time = record.clock
    ticks = np.arange(0, time[-1], PERIOD)
    motors = np.interp(ticks, time, ramped(record))
    reference = np.array([actuators.dofs([each]) for each in motors.tolist()])
    every = max(1, round(min(tip_interval(record), LONGEST_GAP / GAP) / PERIOD))
    if delay is None:
        delay = max(config.measurement.delays, default=0.0)
    late = math.ceil(delay / PERIOD - 1e-6)
    noises = scale * np.random.default_rng(0).normal(0, noise, len(ticks))
    radii, weights = np.array(plays.radii), scale * plays.direction * np.array(plays.weights)
    tips, outputs = np.empty(len(ticks)), np.full(len(radii), motors[0])
    held = ""
    for k, now in enumerate(ticks.tolist()):
        motor = actuators.motors(loop.step(reference[k], now))
        outputs = np.minimum(np.maximum(outputs, motor - radii), motor + radii)
        tips[k] = weights @ outputs + scale * plays.offset
        if k % every == 0 and k >= late:
            loop.on_tip([tips[k - late] + noises[k]], float(ticks[k - late]) + delay)
        if k % CHECKED == 0 and not held and (state := loop.supervision).reaction.rank >= _HELD:
            held = f"after {now:.3g} s: {MEANINGS[by_urgency(state.flags)[0]]}"
    half = slice(len(ticks) // 2, None)
    without = plays.predict(motors)[half]
    return Compensation(reference[half, 0] / scale, without, tips[half] / scale, held)
