"""Profile `best` with an operator in the loop, who corrects the observed tip error with a delay."""

from collections import deque

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction

PERIOD = 0.005
HALF = np.array([5e-3, 0.9, 0.55])
"""Half widths of the slack, which are the initial offsets of the loop."""


def run_with_operator(
    gain: float, delay: float, step: float, seed: int, off: tuple[str, ...] = ()
) -> tuple[NDArray[np.float64], set[str], float]:
    """Response to a step [m] of the target: error (n,) [m], raised flags, share of compensation.

    The operator moves the reference at `gain` [1/s] times the insertion error of `delay` [s] ago.
    """
    config = load_config(profile="best").replace(**{"safety.off": off})
    for dof in Dof:
        config = config.replace(
            **{f"{dof.label}.delta_minus": -float(HALF[dof])},
            **{f"{dof.label}.delta_plus": float(HALF[dof])},
        )
    loop, model = HysteresisReduction(config), build_feature_model(config)
    noise, seen = np.random.default_rng(seed), deque[tuple[int, NDArray[np.float64]]]()
    reference = np.array([config.experiment[dof].centre for dof in Dof])
    tip, target = reference.copy(), reference[0] + step
    past = deque([reference[0]] * (round(delay / PERIOD) + 1), maxlen=round(delay / PERIOD) + 1)
    errors, raised = [], set[str]()
    for tick in range(round(20 / PERIOD)):
        reference = reference + np.array([gain * (target - past[0]) * PERIOD, 0, 0])
        command = loop.step(reference)
        tip = np.clip(tip, command - HALF, command + HALF)
        past.append(tip[0])
        errors.append(target - tip[0])
        prediction = model.predict(tip) if tick % 8 == 0 else None
        if prediction is not None:
            seen.append((tick, prediction[0] + noise.normal(0, 0.2, 4)))
        if seen and seen[0][0] + 16 <= tick:
            captured, features = seen.popleft()
            loop.on_features(features, captured * PERIOD)
        raised.update(loop.supervision.flags)
    return np.array(errors), raised, loop.supervision.lead


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("gain", "delay"), [(4, 0.0), (4, 0.1), (3, 0.2), (2, 0.3), (1, 0.4)])
def test_operator_with_a_gain_margin_of_two_and_a_half_converges(
    gain: float, delay: float, seed: int
) -> None:
    # gain exp(-i w delay) / (i w) is real and negative first at w = pi / (2 delay).
    assert np.pi / 2 > 2.5 * gain * delay, "the gain margin without slack"
    errors, raised, lead = run_with_operator(gain, delay, 5e-3, seed)
    last = errors[round(15 / PERIOD) :]
    assert np.ptp(last) < 0.5e-3, f"seed {seed}: {np.ptp(last)} m"
    assert abs(last).max() < 0.5e-3, f"seed {seed}"
    assert "limit_cycle" not in raised
    assert lead == 1.0


@pytest.mark.parametrize("seed", [0, 1])
def test_operator_unstable_without_slack_is_limited_and_reported(seed: int) -> None:
    """Above the speed limit the oscillation grows no further."""
    gain, delay = 5.0, 0.4
    assert gain * delay > np.pi / 2, "unstable without slack"
    errors, raised, _ = run_with_operator(gain, delay, 1e-3, seed)
    assert "reference_fast" in raised
    before, last = np.split(errors[round(10 / PERIOD) :], 2)
    assert np.ptp(last) < 1.05 * np.ptp(before), f"seed {seed}"
    assert np.ptp(last) > 5 * np.ptp(errors[: round(1 / PERIOD)]), "it grew before"
