"""The article's protocol: one sine after the other, without a jump."""

import numpy as np
import pytest
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import Segment, SineSequence

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
