"""What compensation would do: the loop, simulated on the model that was fitted to a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tautscope.analysis.identification import Identification
from tautscope.analysis.models.task import Floats
from tautscope.config import Config, axes
from tautscope.loop.reduction import HysteresisReduction
from tautscope.report.metrics import rms
from tautscope.runs.records import Record

LONGEST = 100.0
"""Simulated time [s]; a longer record is played faster."""
UNTIMED = 0.02
"""Interval of samples without a time [s]."""
LONGEST_INTERVAL = 0.1
"""Between two measured tips of the simulation [s]."""
LEAST_REDUCTION = 0.1
"""Of the RMS error, from which on the compensator helps."""
PERIOD = Config().control.period


@dataclass(frozen=True)
class Compensation:
    """RMS of tip minus reference over the second half of the motion [tip's unit].

    Attributes:
        before: The reference is the command.
        after: With the loop.
    """

    before: float
    after: float

    @property
    def helps(self) -> bool:
        """Whether the loop reduces the error."""
        return self.after < (1 - LEAST_REDUCTION) * self.before


def simulate(record: Record, found: Identification) -> Compensation:
    """Run the loop of any robot on the fitted plays, with the record's motion as reference.

    The tip is measured as often as in the record, with its noise, and arrives late by the delay
    that was found; its time stamps are right. The delay belongs to the measurement, not to the
    motion. The simulation's unit is the width.
    """
    clock = 1.0 if record.is_timed else UNTIMED
    time = clock * record.clock
    clock *= min(1.0, LONGEST / float(time[-1] - time[0]))
    time = clock * (record.clock - record.clock[0])
    unit = found.width.value
    path = found.gain * record.command / unit
    ticks = np.arange(0, time[-1], PERIOD)
    reference = np.interp(ticks, time, path - (path.max() + path.min()) / 2)
    size, step = np.abs(reference).max(), np.abs(np.diff(reference)).max()
    noise = found.noise / unit
    delay = max(clock * found.delay.value, 0.0)
    config = axes(
        1, width_limit=1.5, range=[-size - 2, size + 2], speed=2 * step / PERIOD + 0.1
    ).replace(
        **{
            "measurement.tip_deviation": max(noise / 1.5, 1e-3),
            "safety.frame_age": max(Config().safety.frame_age, 1.5 * delay),
        }
    )
    interval = float(np.median(np.diff(time[np.isfinite(record.measured)])))
    every = max(1, round(min(interval, LONGEST_INTERVAL) / PERIOD))
    halves = found.half_widths * abs(found.gain) / unit
    loop, rng = HysteresisReduction(config), np.random.default_rng(0)
    plain, plays = np.zeros(len(halves)), np.zeros(len(halves))
    tips = np.empty((len(ticks), 2))
    late = round(delay / PERIOD)
    for k, now in enumerate(ticks.tolist()):
        command = loop.step(reference[k : k + 1], now)[0]
        plain = np.clip(plain, reference[k] - halves, reference[k] + halves)
        plays = np.clip(plays, command - halves, command + halves)
        tips[k] = plain.mean(), plays.mean()
        if k % every == 0 and k >= late:
            loop.on_tip([tips[k - late, 1] + rng.normal(0, noise)], float(ticks[k - late]))
    errors: Floats = tips - reference[:, None]
    before, after = (unit * rms(each[len(ticks) // 2 :]) for each in errors.T)
    return Compensation(before, after)
