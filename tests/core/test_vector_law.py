"""Vector law of profile `best`: bounds of the commands, whatever images and references are."""

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import OperatorMotion

Floats = NDArray[np.float64]
CONFIG = load_config(profile="best").replace(
    # Features that do not belong to the commands would be refused.
    **{"safety.off": ["innovation", "frozen", "dropped", "overcompensation", "limit_cycle"]}
)
PERIOD = CONFIG.control.period
UNIT = np.array(CONFIG.safety.width_limit) / 2
GROUPS = (slice(0, 2), slice(2, 3))
SEEDS = pytest.mark.parametrize("seed", range(3))


def run(references: Floats, seed: int) -> Floats:
    """Commands (n, 3); images show random tips within the slack of the command."""
    loop, model = HysteresisReduction(CONFIG), build_feature_model(CONFIG)
    rng = np.random.default_rng(seed)
    half = np.array([5e-3, 0.9, 0.5])
    commands = []
    for tick, reference in enumerate(references):
        commands.append(loop.step(reference, tick * PERIOD))
        if tick % 8 == 7:
            shown = model.predict(commands[-16 if tick > 16 else 0] + half * rng.uniform(-1, 1, 3))
            if shown is not None:
                loop.on_features(shown[0], (tick - min(tick, 15)) * PERIOD)
    return np.array(commands)


def operator(seed: int) -> Floats:
    motion = OperatorMotion(CONFIG.experiment, seed, duration=40.0)
    return np.array([motion(time) for time in np.arange(0, motion.duration, PERIOD)])


@SEEDS
def test_commands_are_bounded_per_axis_and_by_the_norm(seed: int) -> None:
    references = operator(seed)
    moved, travel = (np.diff(each, axis=0) / UNIT for each in (run(references, seed), references))
    gain = CONFIG.law.free_gain
    for group in GROUPS:
        most = gain * np.linalg.norm(travel[:, group], axis=1)
        assert np.all(np.linalg.norm(moved[:, group], axis=1) <= most * (1 + 1e-9) + 1e-12)
        assert np.all(np.abs(moved[:, group]) <= most[:, None] * (1 + 1e-9) + 1e-12)
        assert np.all((moved * travel)[:, group].sum(axis=1) >= -1e-12), "never against it"
    speed = np.abs(moved * UNIT).max(axis=0) / PERIOD
    assert np.all(speed <= np.array(CONFIG.safety.command_speed))


@SEEDS
def test_commands_rest_while_the_references_of_their_group_rest(seed: int) -> None:
    """To the bit; and insertion's command moves while rotation's reference does."""
    references = operator(seed)
    commands = run(references, seed)
    for group in GROUPS:
        rests = (np.diff(references[:, group], axis=0) == 0).all(axis=1)
        assert rests.any(), f"seed {seed}"
        assert np.all(np.diff(commands[:, group], axis=0)[rests] == 0)
    travel = np.diff(references, axis=0)
    alone = (travel[:, Dof.INSERTION] == 0) & (travel[:, Dof.ROTATION] != 0)
    assert np.any(np.diff(commands, axis=0)[alone, Dof.INSERTION] != 0)


@SEEDS
def test_one_dof_alone_has_the_limited_gain_of_the_article(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for dof in Dof:
        references = np.tile([CONFIG.experiment[each].centre for each in Dof], (2000, 1))
        steps = np.cumsum(rng.normal(0, 1e-3, 2000)) * UNIT[dof]
        references[:, dof] += steps - steps[0]
        moved, travel = (np.diff(each, axis=0) for each in (run(references, seed), references))
        if dof is Dof.BENDING:
            assert np.all(moved[:, :2] == 0)
        else:
            assert np.all(moved[:, Dof.BENDING] == 0)
        product = moved[:, dof] * travel[:, dof]
        most = CONFIG.law.free_gain * travel[:, dof] ** 2
        rounding = 1e-15 * np.abs(travel[:, dof])
        assert np.all((product >= -rounding) & (product <= most * (1 + 1e-9) + rounding)), dof
