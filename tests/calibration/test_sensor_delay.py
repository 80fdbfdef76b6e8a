"""Delay of a sensor's time stamps, found by the filter that predicts it best."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike
from tautscope import Sample, Tip, axes
from tautscope.calibration.sensor_delay import find_delay, move
from tautscope.config import Sine
from tautscope.errors import CalibrationError
from tautscope.loop.references import OperatorMotion

PERIOD = 0.01
CONFIG = axes(1, width_limit=1.0).replace(**{"control.period": PERIOD})


class LateRig:
    """A play whose tip is measured `delay` ticks before the time stamp says."""

    control_period = PERIOD

    def __init__(self, delay: int, width: float = 0.5) -> None:
        self._delay, self._half = delay, width / 2

    def reset(self) -> Sample:
        self._ticks, self._tips = 0, [0.0] * (self._delay + 1)
        self._rng = np.random.default_rng(0)
        return self.step([0.0])

    def step(self, command: ArrayLike) -> Sample:
        (motor,) = np.asarray(command)
        self._ticks += 1
        tip = float(np.clip(self._tips[-1], motor - self._half, motor + self._half))
        self._tips.append(tip)
        now = self._ticks * PERIOD
        # The tip of this tick follows the command of the last one: one period is of the rig.
        seen = Tip([self._tips[-1 - self._delay] + self._rng.normal(0, 0.005)], now)
        measurement = (seen,) if self._ticks % 4 == 0 else ()
        return Sample(now, np.array([motor]), measurement=measurement)

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("ticks", "width"), [(0, 0.5), (3, 0.5), (10, 0.5), (10, 1e-6)])
def test_the_delay_is_found_with_and_without_slack(ticks: int, width: float) -> None:
    motion = OperatorMotion([Sine(centre=0.0, amplitude=1.0)], 3, 40.0)
    passage = move(LateRig(ticks, width), motion, CONFIG)
    found = find_delay(passage, CONFIG)
    assert found.delay == pytest.approx((ticks + 1) * PERIOD, abs=0.02)
    assert 0.01 <= found.std < 0.02
    corrected = CONFIG.replace(**{"measurement.delays": [found.delay]})
    assert find_delay(passage, corrected).delay == found.delay


def test_a_delay_needs_measurements_and_a_limit() -> None:
    motion = OperatorMotion([Sine(centre=0.0, amplitude=1.0)], 3, 40.0)
    passage = move(LateRig(40), motion, CONFIG)
    with pytest.raises(CalibrationError, match="or longer"):
        find_delay(passage, CONFIG)
    with pytest.raises(CalibrationError, match="sensor 1 measured 0 times"):
        find_delay(passage, CONFIG, sensor=1)
    short = replace(passage, measurements=passage.measurements[:100])
    with pytest.raises(CalibrationError, match="measured 100 times"):
        find_delay(short, CONFIG)
