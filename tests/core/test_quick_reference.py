"""An operator's flicks are followed at the speed limit and never stop motion."""

from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import TREMOR, TREMOR_FREQUENCY, OperatorMotion
from tautscope.loop.safety import Reaction

PERIOD = 0.005
SEEDS = range(5000, 5004)


def references(config: Config, seed: int) -> NDArray[np.float64]:
    motion = OperatorMotion(config.experiment, seed, is_disturbed=True)
    return np.array([motion(time) for time in np.arange(0, motion.duration, PERIOD)])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("profile", ["paper", "best"])
def test_an_operator_who_flicks_is_never_stopped(profile: str, seed: int) -> None:
    """Without images and with all of the gain: the fastest commands."""
    config = load_config(profile=profile).replace(**{"safety.off": ["dropped"]})
    loop = HysteresisReduction(config)
    raised, commands = set[str](), []
    for reference in references(config, seed):
        commands.append(loop.step(reference))
        raised.update(loop.supervision.flags)
        assert loop.supervision.reaction in {Reaction.NONE, Reaction.WARN}, f"seed {seed}: {raised}"
    assert "reference_fast" in raised
    speeds = np.abs(np.diff(commands, axis=0)).max(axis=0) / PERIOD
    assert np.all(speeds <= np.array(config.safety.command_speed) * (1 + 1e-9))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gated_reference_lags_within_the_limit_and_returns(seed: int) -> None:
    """Without compensation the command is the gated reference."""
    config = load_config()
    loop = HysteresisReduction(config, compensate=False)
    inputs = references(config, seed)
    gated = np.array([loop.step(reference) for reference in inputs])
    raw, passed = np.diff(inputs, axis=0), np.diff(gated, axis=0)
    assert np.all(passed[raw == 0] == 0)
    moves = raw != 0
    assert np.all(passed[moves] * raw[moves] >= 0)
    assert np.all(np.abs(passed) <= 2 * np.abs(raw) + 1e-15)
    limit = np.array(config.safety.reference_speed) * config.safety.reference_time
    decay, travel = np.exp(-PERIOD / config.safety.reference_time), np.zeros(3)
    for step in passed:
        travel = decay * travel + step
        assert np.all(np.abs(travel) <= limit * 1.1)
    lags = np.abs(inputs - gated)
    assert np.all(lags.max(axis=0) > 1e-4), "a flick exceeds the limit"
    assert np.all((lags == 0).mean(axis=0) > 0.8), "to the bit"


def test_no_flick_of_any_length_and_phase_is_a_jump() -> None:
    """From rest to 3 amplitudes per second in one tick, in the worst phase, with the tremor."""
    config = load_config()
    amplitudes = np.array([config.experiment[dof].amplitude for dof in Dof])
    allowed = np.array(config.safety.reference_speed) * PERIOD
    allowed += np.array(config.safety.reference_count)
    rate = 2 * np.pi * TREMOR_FREQUENCY
    tremor = np.array(TREMOR) * (rate * PERIOD) ** 2
    ticks = np.arange(-2, 40)
    for lasts in np.geomspace(0.1, 20, 100):  # in ticks
        length = 8 / 15 * 3 * lasts * PERIOD  # in amplitudes: the peak speed is 3
        for phase in np.linspace(0, 1, 50):
            x = np.clip((ticks + phase) / lasts, 0, 1)
            positions = length * x**3 * (10 - 15 * x + 6 * x**2)
            change = np.abs(np.diff(positions, n=2)).max()
            assert np.all(change * amplitudes + tremor < allowed), (lasts, phase)


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_best_follows_as_fast_as_slow_motors_and_paper_at_a_share_of_it(
    profile: Literal["best", "paper"],
) -> None:
    """The desktop rig's motors make 25 mm/s; a sine of 10 mm/s lags behind K_b = 5 only."""
    config = load_config("desktop", profile)
    loop, lag = HysteresisReduction(config), 0.0
    for tick in range(2000):
        time = tick * config.control.period
        reference = np.array([0.025 + 0.01 * np.sin(time), 0.0, 0.9])
        loop.step(reference, time)
        lag = max(lag, float(np.abs(loop.reference - reference).max()))
    is_fast = "reference_fast" in loop.supervision.latched
    assert (is_fast, lag > 1e-3) == ((profile == "paper"),) * 2
