"""What a run without an end achieved, against the errors that were put in."""

import numpy as np
import pytest
import tautscope
from tautscope.loop.measurement import Tip
from tautscope.loop.rig import Sample
from tautscope.report.achieved import WINDOW, Achieved, achieved_text

CONFIG = tautscope.axes(2, width_limit=1.2).replace(**{"control.period": 0.05})
PERIOD = 0.05
FAR = 100.0


def run(
    achieved: Achieved,
    start: float,
    errors: list[float],
    share: float,
    *,
    is_measured: bool = False,
) -> None:
    """A tip that is off by each of these errors, and twice that in the second DOF, for 20 s.

    It is the true one, or measured without noise.
    """
    loop = tautscope.HysteresisReduction(CONFIG)
    reference = np.zeros(2)
    for number, error in enumerate(np.repeat(errors, round(20 / PERIOD))):
        now = start + number * PERIOD
        tip = reference + np.array([error, 2 * error])
        loop.step(reference, now)
        measured = Tip(tip if is_measured else np.zeros(2), now)
        achieved.add_update(now, measured, loop.on_sample(measured))
        sample = Sample(now, reference, true_state=None if is_measured else tip)
        achieved.add_tick(sample, reference, reference, share)


def test_it_is_the_error_with_and_without_compensation_that_is_told() -> None:
    achieved = Achieved(CONFIG)
    run(achieved, 0.0, [0.3, 0.3, 0.3], 0.0)
    run(achieved, 100.0, [FAR] * 3, 0.5)  # neither
    run(achieved, 200.0, [0.02, 0.05, 0.05], 1.0)
    first, second = achieved.results().values()
    assert first.uncompensated_rms == pytest.approx(0.3)
    assert first.compensated_rms == pytest.approx(0.05)  # after the first half
    assert second.compensated_rms == pytest.approx(0.1)
    text = achieved_text(achieved.results())
    assert text.startswith("Tip less reference, RMS: axis_1 0.05 rad, 0.3 without compensation,")


def test_updates_count_for_the_share_of_their_time() -> None:
    achieved = Achieved(CONFIG)
    for start, error, share in ((0.0, 0.3, 0.0), (100.0, 0.4, 0.5), (200.0, 0.05, 1.0)):
        run(achieved, start, [error, error, error], share, is_measured=True)
    first, second = achieved.results().values()
    for result, factor in ((first, 1), (second, 2)):
        assert result.uncompensated_rms == pytest.approx(0.3 * factor, rel=0.05)
        assert result.compensated_rms == pytest.approx(0.05 * factor, rel=0.05)


def test_only_the_last_minutes_count() -> None:
    achieved = Achieved(CONFIG)
    run(achieved, 0.0, [FAR] + [0.05] * round(WINDOW / 20), 1.0)
    (first, _) = achieved.results().values()
    assert first.largest == pytest.approx(0.05)
    assert np.isnan(first.uncompensated_rms)
    assert "without" not in achieved_text(achieved.results())


def test_nothing_is_told_where_nothing_was_measured() -> None:
    achieved = Achieved(CONFIG)
    assert achieved.results() == {}
    for number in range(10):
        now = number * PERIOD
        achieved.add_tick(Sample(now, np.zeros(2)), np.zeros(2), np.zeros(2), 1.0)
    assert achieved.results() == {}
