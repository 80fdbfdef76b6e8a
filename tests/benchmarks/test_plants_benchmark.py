"""The instruments of the plants benchmark have the hystereses that its page states."""

import numpy as np
import pytest
from numpy.typing import NDArray
from plants.__main__ import ESTIMATE_GOAL, GOAL, WORST_GOAL, table, to_rows
from plants.simulated import GAIN, HALF, PlantRig
from plants.tracking import Outcome
from play_model import play
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.rig import Rig
from tautscope.report.metrics import loop_width

Floats = NDArray[np.float64]
CONFIG = load_config()
CENTRE = np.array([CONFIG.experiment[dof].centre for dof in Dof])
TIMES = np.arange(0, 40, CONFIG.control.period)
COMMANDS = np.sin(2 * np.pi * TIMES / 10)[:, None] * np.array([15e-3, 2.0, 1.1])


def tips(plant: str) -> Floats:
    rig = PlantRig(CONFIG, plant)
    assert isinstance(rig, Rig)
    states = [rig.step(command + CENTRE).true_state for command in COMMANDS]
    return np.array(states) - CENTRE


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_independent_and_asymmetric_plays_are_those_of_equation_1(dof: Dof) -> None:
    command, half = COMMANDS[:, dof], HALF[dof]
    for plant, minus, plus in (("independent plays", -1, 1), ("asymmetric loops", -0.6, 1.4)):
        expected = play(command, minus * half, plus * half, 0.0)
        np.testing.assert_allclose(tips(plant)[:, dof], expected, atol=1e-12)


def test_the_widths_of_the_other_instruments() -> None:
    last = slice(len(TIMES) // 2, None)

    def widths(plant: str) -> Floats:
        tip = tips(plant)
        return np.array([loop_width(COMMANDS[last, d], tip[last, d]).mean for d in Dof])

    np.testing.assert_allclose(widths("gain 0.8"), 2 * HALF, rtol=0.02)
    travel = np.ptp(COMMANDS[last], axis=0) - 2 * HALF
    np.testing.assert_allclose(np.ptp(tips("gain 0.8")[last], axis=0), GAIN * travel, rtol=1e-9)
    rounded = tips("rounded loops")
    for dof in Dof:
        halves = HALF[dof] * np.linspace(0.25, 1.5, 6)
        parallel = [play(COMMANDS[:, dof], -half, half, 0.0) for half in halves]
        np.testing.assert_allclose(rounded[:, dof], np.mean(parallel, axis=0), atol=1e-12)
    tip, half = tips("width +-50 % in 40 s"), HALF * 1.5
    lag = np.abs(COMMANDS - tip).max(axis=0)
    assert np.all(lag <= half * (1 + 1e-12)) and np.all(lag > 0.9 * half)


def test_a_table_shows_the_missed_goals() -> None:
    outcomes = {
        ("gain 0.8", 0): Outcome([0.9, 0.81, 0.79], [0.8, 0.95, 0.8], 0.3),
        ("gain 0.8", 1): Outcome([0.9, 0.6, 0.79], [0.85, 0.95, 0.8], 0.02),
    }
    rows = to_rows(outcomes)
    goals = [GOAL, WORST_GOAL, ESTIMATE_GOAL]
    assert [row["goal"] for row in rows] == goals * 3 + [ESTIMATE_GOAL]
    assert table(rows).splitlines()[-1] == (
        "| gain 0.8 | 90 (90) | 70 (60) | 79 (79) | 0.15 (0.15) | 0.16 (0.30) "
        "| rotation, rotation gain, bending, share |"
    )
