"""Sign convention of the offsets (decision 0001): the article's printed signs do not converge."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope import _core

Floats = NDArray[np.float64]

DISTANCE, TOLERANCE, FACTOR = 0.05, 0.4, 0.25


def signals(delta_minus: float, delta_plus: float) -> Iterator[tuple[float, float]]:
    """Command and tip of a simulated play over six periods of a sine."""
    tip = 0.0
    for command in 3.0 * np.sin(np.linspace(0.0, 12.0 * np.pi, 12_000)):
        tip = min(max(tip, command - delta_plus), command - delta_minus)
        yield float(command), tip


def as_printed(delta_minus: float, delta_plus: float) -> Floats:
    """Estimated width after each update with the printed signs.

    In (5) an offset is output minus input, in (4) and (6) input minus output.
    """
    minus = plus = last_c = last_m = 0.0
    widths = []
    for c, m in signals(delta_minus, delta_plus):
        moved, followed = c - last_c, m - last_m
        if abs(moved) < DISTANCE:
            continue
        last_c, last_m = c, m
        together = abs(moved - followed) < TOLERANCE * abs(moved)
        update_plus = (moved > 0 and together) or m > c + plus
        update_minus = (moved < 0 and together) or m < c + minus
        if update_plus:
            plus = (1 - FACTOR) * plus + FACTOR * (c - m)
        if update_minus:
            minus = (1 - FACTOR) * minus + FACTOR * (c - m)
        widths.append(plus - minus)
    return np.array(widths)


def consistent(delta_minus: float, delta_plus: float) -> Floats:
    """Estimated width after each sample; every offset is input minus output."""
    estimator = _core.Estimator(
        update_distance=DISTANCE,
        contact_tolerance=TOLERANCE,
        smoothing_factor=FACTOR,
        delta_minus=0.0,
        delta_plus=0.0,
    )
    command, measured = np.array(list(signals(delta_minus, delta_plus))).T
    _, minus, plus = estimator.run(command, measured)
    assert (minus[-1], plus[-1]) == pytest.approx((delta_minus, delta_plus), abs=1e-3)
    return plus - minus


def second_half(widths: Floats) -> Floats:
    return widths[len(widths) // 2 :]


@pytest.mark.parametrize("truth", [(-0.5, 0.5), (-1.0, 0.2), (-0.2, 1.4)])
def test_printed_signs_collapse_and_consistent_signs_converge(truth: tuple[float, float]) -> None:
    width = truth[1] - truth[0]
    assert np.abs(second_half(as_printed(*truth))).min() < 1e-3 * width
    assert np.abs(second_half(consistent(*truth)) - width).max() < 1e-3 * width


def test_printed_signs_lose_the_width_of_a_centred_play() -> None:
    assert np.abs(second_half(as_printed(-0.5, 0.5))).mean() < 0.1
