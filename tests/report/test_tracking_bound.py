"""Laws of the bound's plays and of its law, against closed forms and the play of Eq. (1)."""

import numpy as np
import pytest
from numpy.typing import NDArray
from play_model import play
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.loop.references import OperatorMotion
from tautscope.report.tracking_bound import play_bound, track_ideal_plays, tracking_bound

CONFIG = Config()
GAIN = CONFIG.law.free_gain
HALF = np.array([5e-3, 0.9, 0.55])  # of the article's Table 1
RADIUS = CONFIG.instrument.diameter / 2
MEMORY = 1e-4
SHAFT, SECTION = slice(0, 2), slice(2, 3)
SEEDS = (40, 41, 42)

Floats = NDArray[np.float64]


def operator(seed: int) -> Floats:
    motion = OperatorMotion(CONFIG.experiment, seed, duration=30.0)
    return np.array([motion(time) for time in np.arange(0, motion.duration, 5e-3)])


def alone(dof: Dof, signal: Floats) -> Floats:
    reference = np.tile([25e-3, 0.0, 0.9], (len(signal), 1))
    reference[:, dof] = signal
    return reference


def norm(steps: Floats, group: slice) -> Floats:
    return np.asarray(np.linalg.norm((steps / HALF)[:, group], axis=1))


@pytest.mark.parametrize("dof", Dof)
def test_reduction_of_a_triangle_is_that_of_the_closed_form(dof: Dof) -> None:
    """One DOF alone, in strokes of length L, half width h.

    Without compensation, after a reversal, the error u - q changes from -h to h over a travel of 2
    h and stays. With it, the direction changes after a travel d; the command then crosses the
    rest of the gap, 2 h - d, at K_b times the speed of the reference, so the error grows to
    p = d + (2 h - d) / K_b; it is then compensated at twice the speed, over a travel of p.
    """
    h, surface = HALF[dof], (1.0, RADIUS, 1.0)[dof]
    length, delay = 4 * h, np.log(2) * MEMORY / surface
    phase = np.arange(0, 4, 1e-4) % 1
    signal = length * (np.abs(2 * phase - 1) - 0.5)
    peak = delay + (2 * h - delay) / GAIN
    expected = 1 - np.sqrt(2 / 3 * peak**3 / (h**2 * (length - 4 / 3 * h)))
    found = tracking_bound(alone(dof, signal), CONFIG, first=20_000)
    assert found[dof] == pytest.approx(expected, abs=2e-3)
    assert np.isnan(np.delete(found, dof)).all()


def test_reduction_of_a_play_by_itself_is_that_of_the_closed_form() -> None:
    """The triangle above, in units in which the travel that forgets a direction is nothing."""
    h = 50.0
    phase = np.arange(0, 4, 1e-4) % 1
    signal = 4 * h * (np.abs(2 * phase - 1) - 0.5)
    expected = 1 - np.sqrt(2 / 3 * (2 * h / GAIN) ** 3 / (h**2 * (4 * h - 4 / 3 * h)))
    assert play_bound(signal, h, first=20_000) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("dof", Dof)
def test_one_dof_alone_is_the_play_of_the_article(dof: Dof) -> None:
    signal = operator(40)[:, dof]
    command, tip = track_ideal_plays(alone(dof, signal), CONFIG, compensate=False)
    np.testing.assert_array_equal(command[:, dof], signal)
    expected = play(signal, -HALF[dof], HALF[dof], start=signal[0])
    np.testing.assert_allclose(tip[:, dof], expected, atol=1e-12)


@pytest.mark.parametrize("compensate", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_shaft_slides_on_its_ellipse_along_the_friction(seed: int, compensate: bool) -> None:
    command, tip = track_ideal_plays(operator(seed), CONFIG, compensate=compensate)
    offset = (command - tip) / HALF
    for group in (SHAFT, SECTION):
        length = np.linalg.norm(offset[:, group], axis=1)
        slides = np.append(False, norm(np.diff(tip, axis=0), group) > 1e-9)
        assert length.max() < 1 + 1e-9
        np.testing.assert_allclose(length[slides], 1, atol=1e-9)
        assert slides.sum() > 100
    surface = np.diff(tip, axis=0)[:, :2] * [1, RADIUS]
    speed = np.linalg.norm(surface, axis=1)
    slides = speed > 1e-7  # m; less is rounding
    along = np.sum(surface * offset[1:, :2], axis=1)
    np.testing.assert_allclose(along[slides], speed[slides], rtol=1e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_command_and_tip_are_limited_by_the_reference(seed: int) -> None:
    reference = operator(seed)
    command, tip = track_ideal_plays(reference, CONFIG)
    for group in (SHAFT, SECTION):
        moved, commanded, followed = (
            norm(np.diff(each, axis=0), group) for each in (reference, command, tip)
        )
        assert (commanded <= GAIN * moved + 1e-12).all()
        assert (followed <= 2 * moved * (1 + 1e-3) + 1e-12).all()
        assert (commanded > 0.998 * GAIN * moved)[moved > 0].any()
        assert (followed > 1.99 * moved)[moved > 0].any()
        rests = moved == 0
        assert rests.sum() > 10
        assert not commanded[rests].any()


def test_the_pace_of_the_reference_does_not_matter() -> None:
    reference = operator(40)
    command, tip = track_ideal_plays(reference, CONFIG)
    slow_command, slow_tip = track_ideal_plays(np.repeat(reference, 3, axis=0), CONFIG)
    np.testing.assert_array_equal(slow_command[::3], command)
    np.testing.assert_array_equal(slow_tip[::3], tip)


def test_a_reference_of_another_shape_is_named() -> None:
    with pytest.raises(SignalError, match=r"reference: got .*expected an array of shape"):
        tracking_bound(np.zeros((5, 2)), CONFIG)
