"""The plant: friction causes the hysteresis, and no model of the loop is used."""

import ast
import re
import tomllib
from functools import cache

import numpy as np
import pytest
from common.paths import ROOT
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.report.metrics import loop_width
from tautscope.twin.plant import Plant

CONFIG = Config()


def plant_for(seed=0, **changes):
    return Plant(load_config().replace(**changes), np.random.default_rng(seed))


def posture():
    return np.array([CONFIG.experiment[dof].centre for dof in Dof])


def sweep(plant, dof, *, periods=1.25, slow=0.6, with_insertion=0.0):
    """Command one DOF through sines; the last period's command and true tip.

    After a quarter of a period the loop is closed.
    """
    config = Config()
    sine = config.experiment[dof]
    ticks = round(sine.period * slow / config.control.period)
    count = round(periods * ticks)
    commands, tips = np.empty(count), np.empty(count)
    for k in range(count):
        command = posture()
        command[dof] += sine.amplitude * np.sin(2 * np.pi * (k + 1) / ticks)
        if dof is not Dof.INSERTION:
            command[Dof.INSERTION] += with_insertion * (k + 1) * config.control.period
        plant.step(command)
        commands[k], tips[k] = command[dof], plant.true_state[dof]
    return commands[-ticks:], tips[-ticks:]


def width(plant, dof, **kw):
    return loop_width(*sweep(plant, dof, **kw)).mean


@cache
def default_width(dof, seed=0):
    return width(plant_for(seed), dof, slow=1.0 if seed == 0 else 0.6)


ARTICLE = {Dof.INSERTION: 10e-3, Dof.ROTATION: 1.8, Dof.BENDING: 1.1}


@pytest.mark.parametrize("dof", Dof)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_default_widths_are_the_articles_within_a_tenth(dof, seed):
    assert default_width(dof, seed) == pytest.approx(ARTICLE[dof], rel=0.1), f"seed {seed}"


def test_insertion_hysteresis_grows_with_bends_from_2_mm():
    plants = [plant_for(**{"twin.bends": bends}) for bends in (0, 2, 4)]
    widths = [width(plant, Dof.INSERTION, slow=1.0) for plant in plants]
    assert widths[0] == pytest.approx(2e-3, rel=0.15)
    assert widths[0] < widths[1] < widths[2]


def test_bends_may_change_during_a_run():
    plant = plant_for()
    wide = width(plant, Dof.INSERTION)
    plant.bends = 0.0
    assert width(plant, Dof.INSERTION) < 0.3 * wide


def test_hysteresis_does_not_depend_on_speed():
    """The loops come from friction, not from damping or inertia: another speed, the same width."""
    for dof in Dof:
        other = width(plant_for(), dof)
        assert other == pytest.approx(default_width(dof), rel=0.05), dof.label


def test_no_friction_no_hysteresis():
    free = {
        "safety.unusual": ["twin.shaft.straight_load"],
        "twin.shaft.straight_load": 1e-6,
        "twin.shaft.load_per_bend": 0.0,
    }
    assert width(plant_for(**free), Dof.INSERTION, slow=1.2) < 0.1 * ARTICLE[Dof.INSERTION]
    loose = {f"twin.cables.{name}": 0.0 for name in ("friction", "joint_friction", "slack")}
    assert width(plant_for(**loose), Dof.BENDING, slow=1.2) < 0.1 * ARTICLE[Dof.BENDING]


def test_sliding_one_way_lowers_friction_the_other_way():
    """Elliptic friction cones: a shaft that is being inserted rotates more easily."""
    alone = default_width(Dof.ROTATION)
    sliding = width(plant_for(), Dof.ROTATION, with_insertion=2e-3)
    assert sliding < 0.8 * alone


def test_true_state_is_the_geometry_of_the_centreline():
    """Insertion, rotation and bending are read from the centreline, not from the joints."""
    plant = plant_for()
    sweep(plant, Dof.ROTATION, periods=0.3)
    plant.step(posture() + np.array([0.004, 1.5, 0.5]))
    points, directions = plant.centreline()
    insertion, rotation, bending = plant.true_state
    assert points[1] == pytest.approx([0, 0, insertion], abs=1e-9), "the guide holds the shaft"
    assert np.arccos(directions[0] @ directions[-1]) == pytest.approx(bending, abs=1e-9)
    assert np.arctan2(directions[-1][1], directions[-1][0]) == pytest.approx(rotation, abs=1e-6)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    instrument = Config().instrument
    assert lengths[-1] == pytest.approx(instrument.tip_length)
    assert lengths[1:-1].sum() == pytest.approx(instrument.bending_length)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1)


def test_curvature_is_not_constant():
    plant = plant_for()
    sweep(plant, Dof.BENDING, periods=0.3)
    _, directions = plant.centreline()
    turns = np.arccos(np.clip(np.sum(directions[2:-2] * directions[3:-1], axis=1), -1, 1))
    assert turns.std() > 0.02 * turns.mean()


def test_drives_obey_their_speed_limit_and_report_whole_counts():
    plant = plant_for(**{"twin.drives.speed_limit": (0.01, 1.0, 1.0)})
    before = plant.applied
    for _ in range(100):
        plant.step(posture() + np.array([1.0, 10.0, 10.0]))
    # The servo may overshoot its ramp slightly.
    travel = plant.applied - before
    assert np.all(travel <= 0.5 * np.array([0.01, 1.0, 1.0]) * 1.05)
    assert np.all(travel >= 0.5 * np.array([0.01, 1.0, 1.0]) * 0.9)
    counts = plant.applied / np.array(Config().twin.drives.encoder_step)
    assert np.allclose(counts, np.round(counts), atol=1e-6)


def test_drives_reach_the_command():
    plant = plant_for()
    for _ in range(400):
        plant.step(posture() + np.array([0.01, 0.5, 0.3]))
    assert np.allclose(plant.applied, posture() + np.array([0.01, 0.5, 0.3]), rtol=0.01)


def test_another_control_period_is_the_same_instrument():
    coarse = plant_for(**{"control.period": 0.01})
    config = Config()
    commands, tips = [], []
    for k in range(2000):
        command = posture()
        command[0] += config.experiment.insertion.amplitude * np.sin(2 * np.pi * (k + 1) / 1000)
        coarse.step(command)
        commands.append(command[0])
        tips.append(coarse.true_state[0])
    fine = default_width(Dof.INSERTION)
    assert loop_width(np.array(commands[-1000:]), np.array(tips[-1000:])).mean == pytest.approx(
        fine, rel=0.03
    )


def test_same_seed_same_motion_other_seed_other_instrument():
    runs = [sweep(plant_for(seed), Dof.INSERTION, periods=0.3)[1] for seed in (5, 5, 6)]
    assert runs[0].tobytes() == runs[1].tobytes()
    assert not np.allclose(runs[0], runs[2], atol=1e-6)


def test_twin_shares_nothing_with_what_it_tests():
    """The twin imports none of the loop's blocks, and the renderer none of our other crates."""
    forbidden = re.compile(
        r"blocks|reduction|vision|replay|experiment|\b(Play|Compensator|Estimator|Instrument|Camera)\b"
    )
    for file in (ROOT / "python/tautscope/twin").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = [node.module or "", *(alias.name for alias in node.names)]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            assert not [n for n in names if forbidden.search(n)], f"{file.name}: {names}"
    manifest = tomllib.loads((ROOT / "crates/render/Cargo.toml").read_text(encoding="utf-8"))
    assert not [name for name in manifest.get("dependencies", {}) if name.startswith("tautscope")]
