"""Profile `best`, one DOF, on simulated mechanisms with the effects of real records.

The plants are independent of the package: a tip rests until a contact moves it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.construction import build_adaptive_axis
from tautscope.report.metrics import loop_width

Floats = NDArray[np.float64]
Contacts = Callable[[float, float], tuple[float, float]]
"""From tip and time to the command's offsets (minus, plus) at the two contacts."""

CONFIG = load_config(profile="best")
TICK = CONFIG.control.period
AMPLITUDE, PERIOD = 40.0, 10.0
"""Of the reference [update distances, s]."""


class Trial:
    """A run of the loop with a plant; lengths in update distances, periods from 0."""

    def __init__(
        self,
        contacts: Contacts,
        *,
        gain: float = 1.0,
        start: tuple[float, float] = (0.0, 0.0),
        seed: int = 0,
        periods: int = 5,
        compensate: bool = True,
        dof: Dof = Dof.INSERTION,
        **settings: float,
    ) -> None:
        unit = CONFIG[dof].update_distance
        changes = {f"adaptive.{name}": value for name, value in settings.items()}
        changes |= {
            f"{dof.label}.delta_minus": start[0] * unit,
            f"{dof.label}.delta_plus": start[1] * unit,
        }
        config = CONFIG.replace(**changes)
        axis = build_adaptive_axis(config, dof, compensate)
        noise, seen = np.random.default_rng(seed), deque[tuple[int, float]]()
        tip, commands, rows = 0.0, [], []
        for tick in range(round(periods * PERIOD / TICK)):
            reference = AMPLITUDE * np.sin(2 * np.pi * tick * TICK / PERIOD)
            commands.append(axis.step(reference * unit))
            if seen and seen[0][0] + 16 <= tick:
                captured, measured = seen.popleft()
                axis.update_offsets(
                    commands[captured], measured * unit, 0.0, np.array(commands[captured + 1 :])
                )
            minus, plus = contacts(tip, tick * TICK)
            command = commands[-1] / unit
            tip = gain * np.clip(tip / gain, command - plus, command - minus)
            if tick % 8 == 0:
                seen.append((tick, tip + 0.2 * noise.standard_normal()))
            rows.append((reference, tip, axis.delta_minus / unit, axis.delta_plus / unit))
        self.reference, self.tip, self.minus, self.plus = np.array(rows).T
        self.gain, self.gain_std = axis.gain

    def _rows(self, first: float, last: float) -> slice:
        return slice(round(first * PERIOD / TICK), round(last * PERIOD / TICK))

    def width(self, first: float, last: float) -> float:
        rows = self._rows(first, last)
        return loop_width(self.reference[rows], self.tip[rows]).mean

    def overshoot(self, first: float, last: float) -> float:
        """Largest distance of the tip beyond the reference in its direction of motion."""
        rows = self._rows(first, last)
        beyond = np.sign(np.gradient(self.reference)) * (self.tip - self.reference)
        return float(beyond[rows].max())

    def error(self, first: float, last: float) -> float:
        """Largest error of the tip in the second half of the strokes."""
        rows = self._rows(first, last)
        error = np.abs(self.tip - self.reference)[rows]
        moving = np.gradient(self.reference)[rows] * self.reference[rows]
        return float(error[moving > 0].max())


def constant(minus: float, plus: float) -> Contacts:
    return lambda tip, time: (minus, plus)


SEEDS = pytest.mark.parametrize("seed", [0, 1])


@SEEDS
@pytest.mark.parametrize("gain", [0.5, 0.6, 0.75, 0.9, 1.0])
def test_a_gain_error_is_estimated_and_compensated(gain: float, seed: int) -> None:
    trial = Trial(constant(-10, 10), gain=gain, seed=seed, gain_deviation=0.3)
    assert abs(trial.gain - gain) < 0.05, f"seed {seed}: {trial.gain} +- {trial.gain_std}"
    assert abs(trial.width(3, 5)) < 0.05 * 20, f"seed {seed}: {trial.width(3, 5)}"
    assert trial.error(3, 5) < 1.0, f"seed {seed}: {trial.error(3, 5)}"


@pytest.mark.parametrize("gain", [0.5, 0.6])
def test_without_gain_estimation_the_tip_error_is_large(gain: float) -> None:
    trial = Trial(constant(-10, 10), gain=gain, gain_deviation=0.0)
    # Three times the limit with gain estimation.
    assert trial.error(3, 5) > 3.0, str(trial.error(3, 5))


@SEEDS
@pytest.mark.parametrize(("minus", "plus"), [(0.0, 20.0), (-18.0, 2.0), (-25.0, -5.0), (3.0, 19.0)])
def test_offsets_need_not_be_symmetric(minus: float, plus: float, seed: int) -> None:
    trial = Trial(constant(minus, plus), seed=seed)
    found = np.median(trial.minus[-2000:]), np.median(trial.plus[-2000:])
    np.testing.assert_allclose(found, (minus, plus), atol=1.0, err_msg=f"seed {seed}")
    assert abs(trial.width(1, 2)) < 1.0, f"seed {seed}: {trial.width(1, 2)}"


@SEEDS
@pytest.mark.parametrize("slack", [4.0, 8.0])
def test_offsets_may_change_where_the_other_cable_takes_over(slack: float, seed: int) -> None:
    def contacts(tip: float, time: float) -> tuple[float, float]:
        """Beyond the middle, both offsets are larger by `slack`."""
        share = np.clip(tip / 0.5, 0.0, 1.0)
        return -10 + slack * share, 10 + slack * share

    trial = Trial(contacts, seed=seed, dof=Dof.BENDING)
    assert abs(trial.width(3, 5)) < 1.0, f"seed {seed}: {trial.width(3, 5)}"
    assert trial.error(3, 5) < 0.75 * slack + 0.5, f"seed {seed}: {trial.error(3, 5)}"


@SEEDS
def test_the_width_may_depend_on_position(seed: int) -> None:
    def contacts(tip: float, time: float) -> tuple[float, float]:
        half = 9.0 + 4.0 * np.sin(tip / 12.0)
        return -half, half

    trial = Trial(contacts, seed=seed)
    constant_width = Trial(contacts, seed=seed, local_deviation=0.0, local_drift=0.0)
    errors = [np.abs(x.tip - x.reference)[-4000:].mean() for x in (trial, constant_width)]
    assert abs(trial.width(3, 5)) < 0.05 * 18, f"seed {seed}: {trial.width(3, 5)}"
    assert errors[0] < 0.85 * errors[1], f"seed {seed}: {errors}"


@SEEDS
def test_the_width_may_change_over_time(seed: int) -> None:
    """Widths of 10, 2 and 10 mm; each change takes a period."""

    def contacts(tip: float, time: float) -> tuple[float, float]:
        half = float(np.interp(time / PERIOD, [3, 4, 6, 7], [12.5, 2.5, 2.5, 12.5]))
        return -half, half

    trial = Trial(contacts, seed=seed, periods=9)
    for half, first, last in ((2.5, 5, 6), (12.5, 8, 9)):
        rows = slice(round(first * PERIOD / TICK), round(last * PERIOD / TICK))
        width = np.median((trial.plus - trial.minus)[rows])
        assert abs(width - 2 * half) < 0.2 * half, f"seed {seed}: {width}"
        assert abs(trial.width(first, last)) < 1.0, f"seed {seed}: {trial.width(first, last)}"
    assert trial.overshoot(2, 9) < 2.5, f"seed {seed}: {trial.overshoot(2, 9)}"


@SEEDS
@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_wrong_start_values_are_corrected(factor: float, seed: int) -> None:
    start = (-12.5 * factor, 12.5 * factor)
    trial = Trial(constant(-12.5, 12.5), start=start, seed=seed)
    assert trial.overshoot(0, 1) < 2.5, f"seed {seed}: {trial.overshoot(0, 1)}"
    assert abs(trial.width(1, 2)) < 1.0, f"seed {seed}: {trial.width(1, 2)}"


@SEEDS
def test_a_correct_start_value_reduces_the_first_width(seed: int) -> None:
    """With a small `level_deviation` the loop uses a correct start value at once."""
    correct = Trial(constant(-12.5, 12.5), start=(-12.5, 12.5), seed=seed, level_deviation=0.5)
    zero = Trial(constant(-12.5, 12.5), seed=seed)
    assert abs(correct.width(0, 1)) < abs(zero.width(0, 1)), f"seed {seed}"
