"""The simulated colonoscope tip: statics, hysteresis, EM tracker, reproducibility."""

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tautscope.twin.colonoscope
from numpy.typing import ArrayLike, NDArray
from tautscope import Rig, Sample
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.measurement import Pose
from tautscope.twin.colonoscope import ColonoscopeParameters, ColonoscopeTwin
from tautscope.twin.colonoscope.friction import DahlFriction
from tautscope.twin.colonoscope.tracker import (
    ORIENTATION_STD,
    POSITION_STD,
    RATE,
    without_roll,
)

Floats = NDArray[np.float64]
AMPLITUDES = (1.0, 1.0, 0.03)
_DEFAULT = ColonoscopeParameters()
IDEAL = replace(
    _DEFAULT,
    routing_twist=0.0,
    joint_friction=0.0,
    joint_load_friction=0.0,
    cable_stiffness=100 * _DEFAULT.cable_stiffness,
    cable_friction=(0.0, 0.0),
    cable_drag=0.0,
    dead_length=(0.0, 0.0),
    shaft_friction=0.0,
    gravity=0.0,
)
"""Without friction, dead length, gravity and twist, and with stiff cables."""


def truth(sample: Sample) -> Floats:
    """True state (3,) of a sample."""
    assert sample.true_state is not None
    return sample.true_state


def pose_of(sample: Sample) -> Pose | None:
    """What the tracker delivered with a sample."""
    assert len(sample.measurements) <= 1
    for one in sample.measurements:
        assert isinstance(one, Pose)
        return one
    return None


def rotation_of(pose: Pose) -> Floats:
    """Measured orientation (3, 3)."""
    return np.asarray(pose.orientation, dtype=float)


def moved(commands: Floats, **options: Any) -> tuple[Floats, ColonoscopeTwin]:
    """True states (n, 3) during commands (n, 3), and the rig."""
    rig = ColonoscopeTwin(start=commands[0], **options)
    rig.reset()
    states = [truth(rig.step(command)) for command in commands]
    return np.array(states), rig


def triangle(axis: int, period: float, periods: float = 1.25) -> Floats:
    """Commands from 0 along a triangle of one degree of freedom."""
    phase = np.arange(round(periods * period / 0.005)) * 0.005 / period
    commands = np.zeros((len(phase), 3))
    commands[:, axis] = AMPLITUDES[axis] * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * phase))
    return commands


def loop_width(axis: int, period: float, parameters: ColonoscopeParameters) -> float:
    """Difference of the commands that bring the tip to its middle position from both sides."""
    commands = triangle(axis, period)
    states, _ = moved(commands, parameters=parameters)
    last = round(period / 0.005)
    command, state = commands[-last:, axis], states[-last:, axis]
    # From the upper turning point down, and from the lower one up.
    half = last // 2
    level = (state.min() + state.max()) / 2
    down = np.interp(level, state[half - 1 :: -1], command[half - 1 :: -1])
    up = np.interp(level, state[half:], command[half:])
    return float(up - down)


def bent(bend_x: float, bend_y: float) -> Floats:
    """Rotation matrix by |b| about (-b_y, b_x, 0)/|b|, by the series of the exponential."""
    cross = np.array([[0, 0, bend_x], [0, 0, bend_y], [-bend_x, -bend_y, 0.0]])
    rotation, term = np.eye(3), np.eye(3)
    for order in range(1, 25):
        term = term @ cross / order
        rotation = rotation + term
    return rotation


def constant_curvature(state: Floats, length: float, tip: float) -> Floats:
    """Position of the tip: the direction is integrated along the section."""
    bend_x, bend_y, insertion = state
    middles = (np.arange(400) + 0.5) / 400
    section = np.mean([bent(bend_x * s, bend_y * s)[:, 2] for s in middles], axis=0) * length
    ahead: Floats = np.array([0, 0, insertion]) + section + bent(bend_x, bend_y)[:, 2] * tip
    return ahead


def ramp(target: ArrayLike, seconds: float = 2.0) -> Floats:
    """Commands from zero to a target, then at rest for half a second."""
    share = np.minimum(np.arange(round((seconds + 0.5) / 0.005)) * 0.005 / seconds, 1)
    return np.outer(share, np.asarray(target))


def test_it_is_a_rig() -> None:
    rig = ColonoscopeTwin(3)
    assert isinstance(rig, Rig)
    assert rig.control_period == 0.005
    with pytest.raises(SignalError):
        rig.step((0, 0, 0))
    sample = rig.reset()
    assert (sample.time, sample.frame) == (0.0, None)
    sample = rig.step((0.01, 0.0, 0.0))
    assert sample.time == 0.005
    np.testing.assert_allclose(sample.applied, [0.01, 0, 0])
    with pytest.raises(SignalError):
        rig.step((0, np.nan, 0))
    with pytest.raises(SignalError):
        rig.step((0, 0))
    rig.close()
    rig.close()
    assert "closed" in repr(rig)


@pytest.mark.parametrize("target", [(1.2, 0, 0), (0, -1.2, 0.02), (0.7, 0.7, -0.02), (-0.4, 1, 0)])
def test_an_ideal_transmission_follows_the_command(target: tuple[float, float, float]) -> None:
    states, _ = moved(ramp(target), parameters=IDEAL)
    np.testing.assert_allclose(states[-1, :2], target[:2], atol=0.03 * np.hypot(*target[:2]))
    np.testing.assert_allclose(states[-1, 2], target[2], atol=1e-4)
    assert loop_width(0, 4.0, IDEAL) < 0.02


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_widths_of_the_hysteresis(axis: int, seed: int) -> None:
    width = loop_width(axis, 4.0, ColonoscopeParameters.drawn(seed))
    least, most = (5e-3, 8.1e-3) if axis == 2 else (0.3, 0.6)
    assert least <= width <= most


@pytest.mark.parametrize("axis", [0, 2])
def test_loops_do_not_depend_on_the_speed(axis: int) -> None:
    fast, slow = triangle(axis, 4.0), triangle(axis, 8.0)
    parameters = ColonoscopeParameters.drawn(1)
    at_fast, at_slow = (moved(each, parameters=parameters)[0][:, axis] for each in (fast, slow))
    assert np.abs(at_fast - at_slow[::2]).max() < 0.03 * np.ptp(at_fast)


@pytest.mark.parametrize("cause", ["friction", "dead length"])
def test_friction_and_dead_length_each_widen_the_loop(cause: str) -> None:
    parameters = ColonoscopeParameters()
    without = {
        "friction": replace(
            parameters,
            joint_friction=0.0,
            joint_load_friction=0.0,
            cable_friction=(0.0, 0.0),
            cable_drag=0.0,
        ),
        "dead length": replace(parameters, dead_length=(0.0, 0.0)),
    }[cause]
    assert loop_width(0, 4.0, without) < loop_width(0, 4.0, parameters) - 0.1


def test_capstan_equation() -> None:
    """A cable that is pulled loses tension by the factor exp(-mu theta) along its sheath."""
    parameters = replace(
        ColonoscopeParameters(), cable_drag=0.0, cable_presliding=1e-5, sheath_angle=4.0
    )
    _, rig = moved(ramp((1.3, 0, 0), 4.0)[: round(4.0 / 0.005)], parameters=parameters)
    tension, section = rig.plant.tensions[0], rig.plant.true_state[0]
    angle = parameters.sheath_angle + section
    expected = np.exp(-parameters.cable_friction[0] * angle)
    assert tension[-1] > 5
    assert tension[-1] / tension[0] == pytest.approx(expected, rel=0.03)
    # The opposite cable is slack, but for what holds it in its sheath.
    assert rig.plant.tensions[2].max() < 0.02 * tension[-1]


def test_one_plane_moves_the_other_a_little() -> None:
    states, _ = moved(ramp((1.2, 0, 0)), seed=0)
    assert 0.005 < np.abs(states[-1, 1] - states[0, 1]) < 0.15


@pytest.mark.parametrize("start", [(0, 0, 0), (0.8, -0.6, 0.05)])
def test_at_rest_nothing_moves(start: tuple[float, float, float]) -> None:
    states, _ = moved(np.tile(np.array(start, dtype=float), (1000, 1)), seed=2)
    assert np.abs(states[-1] - states[0]).max() < 1e-3
    assert np.abs(states[-1] - states[-200]).max() < 1e-5


def test_it_comes_to_rest_after_a_sudden_command() -> None:
    commands = np.tile([1.5, -1.5, 0.1], (800, 1))
    commands[0] = 0
    states, _ = moved(commands, seed=1)
    assert np.isfinite(states).all()
    assert np.abs(states[-1] - states[-200]).max() < 2e-4


def test_the_motors_have_a_largest_speed() -> None:
    rig = ColonoscopeTwin(0)
    rig.reset()
    applied = rig.step((9, -9, 9)).applied
    limit = np.array(rig.parameters.speed_limit)
    np.testing.assert_allclose(applied, limit * [1, -1, 1] * rig.control_period)


def test_the_same_seed_gives_the_same_values() -> None:
    def run(seed: int) -> bytes:
        rig = ColonoscopeTwin(seed)
        rig.reset()
        values: list[Floats] = []
        for k in range(60):
            sample = rig.step((0.02 * k, -0.01 * k, 1e-4 * k))
            values.append(truth(sample))
            pose = pose_of(sample)
            if pose is not None:
                values += [np.asarray(pose.position), rotation_of(pose).ravel()]
        return np.concatenate(values).tobytes()

    assert run(4) == run(4)
    assert run(4) != run(5)
    rig = ColonoscopeTwin(4)
    first = truth(rig.reset())
    rig.step((0.5, 0, 0))
    np.testing.assert_array_equal(truth(rig.reset()), first)


def test_seeds_draw_within_a_quarter() -> None:
    default = ColonoscopeParameters()
    drawn = [ColonoscopeParameters.drawn(seed) for seed in range(60)]
    assert drawn[7] == ColonoscopeParameters.drawn(7)
    for name in ("stiffness", "joint_friction", "cable_stiffness", "sheath_angle"):
        ratio = np.array([getattr(one, name) / getattr(default, name) for one in drawn])
        assert 0.75 <= ratio.min() < 0.8, name
        assert 1.2 < ratio.max() <= 1.25, name
    for one in drawn:
        assert np.mean(one.stiffness_shape) == pytest.approx(1)


def measured(seconds: float, **options: Any) -> list[tuple[float, Pose]]:
    """Poses and the times of their arrival while the tip is at rest."""
    rig = ColonoscopeTwin(1, start=(0.5, 0.3, 0.02), **options)
    rig.reset()
    poses = []
    for _ in range(round(seconds / rig.control_period)):
        sample = rig.step((0.5, 0.3, 0.02))
        pose = pose_of(sample)
        if pose is not None:
            poses.append((sample.time, pose))
    return poses


def test_tracker_rate_and_noise() -> None:
    poses = measured(10)
    stamps = np.array([pose.captured_at for _, pose in poses])
    np.testing.assert_allclose(np.diff(stamps), 1 / RATE, atol=1e-9)
    positions = np.array([pose.position for _, pose in poses])
    np.testing.assert_allclose(positions.std(axis=0), POSITION_STD, rtol=0.15)
    rotations = np.array([rotation_of(pose) for _, pose in poses])
    np.testing.assert_allclose(
        rotations @ rotations.swapaxes(1, 2), [np.eye(3)] * len(poses), atol=1e-12
    )
    mean = bent(*moved(np.tile([0.5, 0.3, 0.02], (1, 1)), seed=1)[0][-1, :2])
    errors = mean.T @ rotations
    about = np.stack([errors[:, 2, 1], errors[:, 0, 2], errors[:, 1, 0]])
    np.testing.assert_allclose(about.std(axis=1), ORIENTATION_STD, rtol=0.15)
    assert np.abs(about.mean(axis=1)).max() < 4 * ORIENTATION_STD / np.sqrt(len(poses))
    # Noise is the smaller part of what the loop must expect: its kinematics err by more.
    assert poses[0][1].covariance is None


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.083])
def test_measurements_arrive_after_the_delay(delay: float) -> None:
    poses = measured(0.5, delay=delay)
    late = np.array([time - pose.captured_at for time, pose in poses])
    assert (late >= delay - 1e-6).all()
    assert (late < delay + 0.005 + 1e-6).all()


def test_an_untold_delay_is_in_the_time_stamp() -> None:
    told, wrong = measured(0.5, delay=0.08), measured(0.5, delay=0.08, told_delay=0.05)
    assert len(told) == len(wrong)
    for (time, right), (same_time, shifted) in zip(told, wrong, strict=True):
        assert time == same_time
        assert shifted.captured_at - right.captured_at == pytest.approx(0.03)
        np.testing.assert_array_equal(np.asarray(right.position), np.asarray(shifted.position))


def test_a_pose_is_of_the_time_of_its_stamp() -> None:
    commands = ramp((1.2, 0, 0), 1.0)
    rig = ColonoscopeTwin(1, delay=0.06)
    rig.reset()
    states = {}
    for command in commands:
        sample = rig.step(command)
        states[round(sample.time / 0.005)] = truth(sample)
        pose = pose_of(sample)
        if pose is None or pose.captured_at < 0.005:
            continue
        bend_x, bend_y, _ = states[round(pose.captured_at / 0.005)]
        angle = np.trace(rotation_of(pose).T @ bent(bend_x, bend_y))
        assert np.arccos(np.clip((angle - 1) / 2, -1, 1)) < 6 * ORIENTATION_STD


def test_drift_is_bounded_and_slow() -> None:
    still, drifting = measured(15), measured(15, drift=0.3e-3)
    offset = np.array(
        [
            np.subtract(b.position, a.position)
            for (_, a), (_, b) in zip(still, drifting, strict=True)
        ]
    )
    assert np.ptp(offset, axis=0).max() > 0.02e-3
    assert np.linalg.norm(offset, axis=1).max() <= 0.3e-3
    assert np.abs(np.diff(offset, axis=0)).max() < 2e-6


def test_the_orientation_is_that_of_the_state_and_the_position_nearly() -> None:
    parameters = ColonoscopeParameters.drawn(0)
    ways: list[tuple[float, float, float]] = [(1.2, 0, 0), (0.9, 0.9, 0.02), (-0.3, 1.0, 0.05)]
    errors = []
    for target in ways:
        states, rig = moved(ramp(target), parameters=parameters)
        position, rotation = rig.plant.tip()
        bend = states[-1, :2]
        np.testing.assert_allclose(without_roll(rotation[:, 2]), bent(*bend), atol=1e-9)
        roll = bent(*bend).T @ rotation
        assert abs(roll[1, 0]) < 0.05  # the section's own, which the tracker does not measure
        ideal = constant_curvature(states[-1], parameters.length, parameters.tip_length)
        errors.append(np.linalg.norm(position - ideal))
    assert max(errors) < 6e-3
    assert max(errors) > 0.2e-3  # the curvature is not constant


def test_the_state_is_smooth_where_the_section_is_straight() -> None:
    states, _ = moved(ramp((-0.6, 0, 0))[::-1].copy(), parameters=IDEAL)
    assert np.abs(np.diff(states[:, :2], axis=0)).max() < 0.01


def test_an_impossible_instrument_is_an_error() -> None:
    with pytest.raises(ConfigError):
        ColonoscopeTwin(parameters=replace(ColonoscopeParameters(), stiffness_shape=(1.0,))).reset()


def test_friction_opposes_motion_up_to_its_limit() -> None:
    friction = DahlFriction(np.array([1e-3, 0.01, 0.01]), scalars=1)
    coulomb = np.array([2.0, 3.0, 3.0])
    for _ in range(100):
        force = friction.step(np.array([1e-4, 3e-3, 4e-3]), coulomb)
    np.testing.assert_allclose(force, [2.0, 1.8, 2.4], rtol=1e-3)
    held = friction.step(np.zeros(3), coulomb).copy()
    np.testing.assert_array_equal(held, friction.force)
    # Presliding: the stiffness at rest is C/z.
    fresh = DahlFriction(np.array([1e-3]), scalars=1)
    assert fresh.step(np.array([1e-6]), np.array([2.0]))[0] == pytest.approx(2e-3, rel=1e-3)


def test_it_shares_nothing_with_the_loop_but_the_interface() -> None:
    allowed = {"tautscope.errors", "tautscope.loop.rig", "tautscope.loop.measurement"}
    package = "tautscope.twin.colonoscope"
    for file in Path(tautscope.twin.colonoscope.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            for name in names:
                if name.startswith("tautscope") and not name.startswith(package):
                    assert name in allowed, f"{file.name}: {name}"
                if name.startswith("tautscope.loop"):
                    assert isinstance(node, ast.ImportFrom)
                    assert {alias.name for alias in node.names} <= {"Sample", "Pose"}, file.name
