"""The article's protocol: one sine after the other, without a jump."""

import numpy as np
import pytest
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion, Segment, SineSequence

EXPERIMENT = Config().experiment
REFERENCE = SineSequence(EXPERIMENT)
TIMES = np.arange(0, REFERENCE.duration, 0.005)
POSITIONS = np.array([REFERENCE(time) for time in TIMES])


def test_segments_follow_each_other_in_the_order_of_the_dof() -> None:
    assert [segment.dof for segment in REFERENCE.segments] == list(Dof)
    starts = [segment.start for segment in REFERENCE.segments]
    ends = [segment.end for segment in REFERENCE.segments]
    assert starts == [0.0, *ends[:-1]]
    assert REFERENCE.duration == ends[-1]


@pytest.mark.parametrize("segment", REFERENCE.segments, ids=lambda segment: segment.dof.label)
def test_in_a_segment_one_dof_moves_and_the_others_rest(segment: Segment) -> None:
    sine = EXPERIMENT[segment.dof]
    inside = (segment.start <= TIMES) & (segment.end > TIMES)
    moving = POSITIONS[inside, segment.dof]
    assert moving.max() == pytest.approx(sine.centre + sine.amplitude, rel=1e-4)
    assert moving.min() == pytest.approx(sine.centre - sine.amplitude, rel=1e-4, abs=1e-9)
    spectrum = np.abs(np.fft.rfft(moving - moving.mean()))
    assert np.argmax(spectrum) == EXPERIMENT.periods
    for other in set(Dof) - {segment.dof}:
        assert np.all(POSITIONS[inside, other] == EXPERIMENT[other].centre)


def test_the_position_never_jumps() -> None:
    speed = [EXPERIMENT[dof].amplitude * 2 * np.pi / EXPERIMENT[dof].period for dof in Dof]
    steps = np.abs(np.diff(POSITIONS, axis=0)).max(axis=0)
    assert np.all(steps <= np.array(speed) * 0.005 * (1 + 1e-6))


def test_before_and_after_it_rests_at_the_centres() -> None:
    centres = [EXPERIMENT[dof].centre for dof in Dof]
    for time in (-1.0, 0.0, REFERENCE.duration, REFERENCE.duration + 1):
        np.testing.assert_array_equal(REFERENCE(time), centres)


SEEDS = pytest.mark.parametrize("seed", [0, 1, 2])
TICKS = np.arange(0, 120, 0.005)


def sampled(seed: int, *, is_disturbed: bool = False) -> np.ndarray:
    motion = OperatorMotion(EXPERIMENT, seed, is_disturbed=is_disturbed)
    return np.array([motion(time) for time in TICKS])


@SEEDS
def test_an_operator_stays_in_the_range_and_below_the_speed(seed: int) -> None:
    positions = sampled(seed)
    amplitudes = np.array([EXPERIMENT[dof].amplitude for dof in Dof])
    centres = np.array([EXPERIMENT[dof].centre for dof in Dof])
    assert np.all(np.abs(positions - centres) <= amplitudes * (1 + 1e-12))
    speeds = np.abs(np.diff(positions, axis=0)).max(axis=0) / 0.005
    assert np.all(speeds <= 1.2 * amplitudes * (1 + 1e-9))
    assert np.all(speeds >= 0.8 * amplitudes), "some move is as quick as it may be"


@SEEDS
def test_an_operator_moves_all_dofs_at_once_and_rests(seed: int) -> None:
    is_moving = np.diff(sampled(seed), axis=0) != 0
    assert 0.5 < is_moving.mean() < 0.95
    assert np.mean(is_moving.all(axis=1)) > 0.3
    correlations = np.corrcoef(sampled(seed).T)
    assert np.abs(correlations[np.triu_indices(3, 1)]).max() < 0.6


@SEEDS
def test_a_move_has_the_least_jerk(seed: int) -> None:
    """Of the polynomial of fifth order alone, the sixth difference is zero within a move."""
    position = sampled(seed)[:, 0] / EXPERIMENT.insertion.amplitude
    sixth = np.diff(position[::20], n=6)
    assert np.mean(np.abs(sixth) < 1e-9) > 0.3


def test_a_seed_gives_the_same_motion_and_another_another() -> None:
    np.testing.assert_array_equal(sampled(0), sampled(0))
    assert np.any(sampled(0) != sampled(1))


@SEEDS
def test_disturbances_are_tremor_flicks_and_pauses(seed: int) -> None:
    positions = sampled(seed, is_disturbed=True)
    amplitudes = np.array([EXPERIMENT[dof].amplitude for dof in Dof])
    speeds = np.abs(np.diff(positions, axis=0)).max(axis=0) / 0.005
    tremor = 2 * np.pi * 8 * np.array([0.1e-3, 0.01, 0.01])
    assert np.all(speeds <= 3 * amplitudes + tremor)
    assert np.all(speeds >= 2 * amplitudes), "some flick"
    spectrum = np.abs(np.fft.rfft(np.diff(positions[:, 1])))
    frequencies = np.fft.rfftfreq(len(TICKS) - 1, 0.005)
    high = frequencies > 4
    assert frequencies[high][np.argmax(spectrum[high])] == pytest.approx(8, abs=0.02)
