"""The tip without compensation, and the tracking errors with and without it."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tautscope._core import Play
from tautscope.config import load_config
from tautscope.console.live_twin import LiveTwin
from tautscope.console.uncompensated import ComparedRig, PlayTip, Score
from tautscope.twin.rig import Twin


@given(arrays(np.float64, 30, elements=st.floats(-1, 1)), st.floats(-0.5, 0), st.floats(0, 0.5))
def test_the_model_is_the_play_of_eq_1(inputs: np.ndarray, minus: float, plus: float) -> None:
    play, tip = Play(delta_minus=minus, delta_plus=plus, output=0.0), PlayTip([0.0])
    for each in inputs:
        found = tip.step(np.array([each]), np.array([minus]), np.array([plus]))
        assert found[0] == play.step(each)


def test_the_second_instrument_is_the_twin_that_gets_the_reference() -> None:
    config = load_config()
    live, plain = LiveTwin(config), Twin(config, images=False)
    assert isinstance(live, ComparedRig)
    start = live.reset().applied
    plain.reset()
    live._pace.wait = lambda: None  # type: ignore[method-assign]
    for k in range(60):
        reference = start + np.array([2e-3, 0.3, 0.2]) * np.sin(k / 10)
        live.step(start - reference)  # what the first one does changes nothing
        found = live.step_uncompensated(reference)
        assert (found == plain.step(reference).true_state).all()
    live.close()


@given(
    arrays(np.float64, (90, 2), elements=st.floats(-1, 1)),
    arrays(np.float64, (90, 2), elements=st.floats(-1, 1)),
    st.sampled_from([0.5, 0.1]),
)
def test_the_score_is_the_rms_error_of_the_last_minute_of_motion(
    references: np.ndarray, tips: np.ndarray, period: float
) -> None:
    references[5] = references[4]  # it rests, which does not count
    tips[7, 0] = np.nan
    score = Score(2, period)
    for reference, tip in zip(references, tips, strict=True):
        score.add(reference, tip, 2 * reference)
    moved = [k + 1 for k, (a, b) in enumerate(pairwise(references)) if (a != b).any()]
    size = round(1 / period)
    moved = moved[: len(moved) // size * size][-60 * size :]  # whole seconds
    for dof, found in enumerate(score.errors):
        own = references[:, dof]
        known = [k for k in moved if np.isfinite(tips[k, dof]) and own[k] != own[k - 1]]
        error, without = (values[known, dof] for values in (tips - references, references))
        expected = [np.sqrt(np.mean(each**2)) for each in (error, without)] if known else None
        assert (found is None) == (expected is None)
        assert found is None or np.allclose(found, expected, atol=1e-12)
