"""Instruments that differ: transmission, section and friction follow the laws that are stated."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config, FrictionConfig, TransmissionConfig
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.report.metrics import loop_width
from tautscope.twin.friction import (
    CABLE_SPEED,
    JOINT_SPEED,
    SHAFT_SPEED,
    FrictionVariation,
)
from tautscope.twin.plant import Plant
from tautscope.twin.transmission import Transmission

Floats = NDArray[np.float64]
CONFIG = Config()
PERIOD = CONFIG.control.period
START = np.array([CONFIG.experiment[dof].centre for dof in Dof])
AMPLITUDE = np.array([CONFIG.experiment[dof].amplitude for dof in Dof])
WIDTH = np.array([10e-3, 1.8, 1.1])
"""Of the article's loops [m, rad, rad]."""
STRAIGHT = {"twin.bends": 0.0}
"""Insertion has a width of about 2 mm."""
EASY = {f"twin.cables.{name}": 0.0 for name in ("friction", "joint_friction", "slack")}


def plant(**changes: Any) -> Plant:
    # Without the torque that depends on the angle.
    return Plant(
        CONFIG.replace(**{"twin.shaft.set_torque": 0.0}, **changes), np.random.default_rng(0)
    )


def move(simulated: Plant, dof: Dof, positions: Floats) -> Floats:
    """Tip of one DOF while its command goes through positions, one per period."""
    tips = np.empty(len(positions))
    for k, position in enumerate(positions):
        command = START.copy()
        command[dof] = position
        simulated.step(command)
        tips[k] = simulated.true_state[dof]
    return tips


def ramp(dof: Dof, first: float, last: float, seconds: float) -> Floats:
    """Positions from centre + first amplitudes to centre + last amplitudes."""
    return START[dof] + AMPLITUDE[dof] * np.linspace(first, last, round(seconds / PERIOD))


def stroke(simulated: Plant, dof: Dof) -> float:
    """Travel of the tip over the end of a long stroke, after the slack is crossed."""
    move(simulated, dof, ramp(dof, 0, -1, 4))
    tips = move(simulated, dof, ramp(dof, -1, 2.5, 14))
    return float(tips[-1] - tips[round(2.5 / 3.5 * len(tips))])


def per_dof(dof: Dof, value: float, other: float) -> tuple[float, ...]:
    return tuple(value if each is dof else other for each in Dof)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
@pytest.mark.parametrize("gain", [0.6, 1.2])
def test_the_tip_travels_gain_times_the_motor(dof: Dof, gain: float) -> None:
    changed = stroke(plant(**{"twin.transmission.gain": per_dof(dof, gain, 1.0)}), dof)
    assert changed / stroke(plant(), dof) == pytest.approx(gain, rel=0.04)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_slack_in_mid_stroke_shortens_a_stroke_through_the_middle_only(dof: Dof) -> None:
    slack = float(0.2 * AMPLITUDE[dof])
    changes = {"twin.transmission.slack": per_dof(dof, slack, 0.0)}
    loose, tight = (move(each, dof, ramp(dof, 0, 2, 12)) for each in (plant(**changes), plant()))
    assert tight[-1] - loose[-1] == pytest.approx(slack / 2, rel=0.05)
    late = round(1.5 / 2 * len(tight))
    travel = tight[-1] - tight[late]
    assert loose[-1] - loose[late] == pytest.approx(travel, rel=0.05)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_an_offset_moves_the_centre_of_the_loop(dof: Dof) -> None:
    offset = float(0.15 * AMPLITUDE[dof])
    cycles = START[dof] + AMPLITUDE[dof] * np.sin(np.arange(0, 4 * np.pi, 2 * np.pi * PERIOD / 8))
    centres = []
    for value in (0.0, offset):
        simulated = plant(**{"twin.transmission.offset": per_dof(dof, value, 0.0)})
        tips = move(simulated, dof, cycles)[len(cycles) // 2 :]
        centres.append((tips.max() + tips.min()) / 2)
    assert centres[1] - centres[0] == pytest.approx(offset, rel=0.1)


def test_a_step_is_followed_with_the_time_constant() -> None:
    lags = (0.03, 0.1, 0.0)
    path = Transmission(TransmissionConfig(lag=lags), START)
    motor = START + 1.0
    for k in range(1, 41):
        position, _ = path.step(motor, motor - START, PERIOD)
        expected = [1 - np.exp(-k * PERIOD / lag) if lag else 1.0 for lag in lags]
        np.testing.assert_allclose(position - START, expected, rtol=1e-12)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_on_a_ramp_the_tip_lags_by_speed_times_time_constant(dof: Dof) -> None:
    positions = ramp(dof, 0, 2, 8)
    slow = plant(**{"twin.transmission.lag": per_dof(dof, 0.1, 0.0)})
    lag = move(plant(), dof, positions)[-1] - move(slow, dof, positions)[-1]
    assert lag == pytest.approx(0.1 * 2 * AMPLITUDE[dof] / 8, rel=0.05)


def test_encoders_show_the_motor_and_not_the_transmission() -> None:
    changes = {
        "twin.transmission.gain": (0.6, 0.6, 0.6),
        "twin.transmission.slack": tuple((0.1 * AMPLITUDE).tolist()),
        "twin.transmission.lag": (0.1, 0.1, 0.1),
    }
    simulated = plant(**changes)
    for _ in range(400):
        simulated.step(START + 0.5 * AMPLITUDE)
    np.testing.assert_allclose(simulated.applied, START + 0.5 * AMPLITUDE, rtol=0.01)


@pytest.mark.parametrize("curvature", [(0.6, 0.0), (0.0, -0.6), (0.8, 0.8)])
def test_curvature_varies_as_stated_and_bends_as_far(curvature: tuple[float, float]) -> None:
    even, uneven = plant(**EASY), plant(**EASY, **{"twin.cables.curvature": curvature})
    totals = [move(each, Dof.BENDING, ramp(Dof.BENDING, 0, 0.5, 3))[-1] for each in (even, uneven)]
    _, tangents = uneven.centreline()
    at_joints = tangents[2:-2]
    turns = np.arccos(np.sum(at_joints[1:] * at_joints[:-1], axis=1))
    x = np.linspace(-1, 1, CONFIG.twin.cables.joints)
    shape = np.maximum(1 + curvature[0] * x + curvature[1] * (3 * x**2 - 1) / 2, 0.1)
    expected = (shape[1:] + shape[:-1]) / 2  # a tangent at a joint is that between two links
    np.testing.assert_allclose(turns / turns.mean(), expected / expected.mean(), rtol=0.03)
    assert totals[1] == pytest.approx(totals[0], rel=0.01)


def test_the_plane_of_bending_is_turned() -> None:
    simulated = plant(**{"twin.cables.plane": 0.09})
    _, tangents = simulated.centreline()
    turned = np.arctan2(tangents[-1][1], tangents[-1][0])
    _, tangents = plant().centreline()
    assert turned - np.arctan2(tangents[-1][1], tangents[-1][0]) == pytest.approx(0.09, abs=1e-3)
    assert simulated.true_state[Dof.ROTATION] == pytest.approx(turned, abs=1e-6)


def test_tension_shortens_the_section() -> None:
    """Without friction one cable balances the joints' springs: tension = stiffness turn / arm."""
    compliance, cables = 1e-3, CONFIG.twin.cables
    simulated = plant(**EASY, **{"twin.cables.compliance": compliance})
    move(simulated, Dof.BENDING, ramp(Dof.BENDING, 0, 1, 4))
    points, _ = simulated.centreline()
    length = np.linalg.norm(np.diff(points[1:-1], axis=0), axis=1).sum()
    turn = simulated.true_state[Dof.BENDING] / cables.joints
    tension = cables.joint_stiffness * turn / cables.arm
    shortened = CONFIG.instrument.bending_length - length
    assert shortened == pytest.approx(compliance * tension, rel=0.05)
    assert shortened > 0.2e-3


def test_friction_is_solved_beside_the_heavy_parts_of_a_compliant_section() -> None:
    """The oracle is the same simulation, solved until it no longer improves."""
    states = []
    for tolerance in (None, 0.0):
        simulated = plant(**{"twin.cables.compliance": 2e-5, "twin.friction.stick": (0.1, 0.1)})
        if tolerance is not None:
            simulated._model.opt.tolerance, simulated._model.opt.iterations = tolerance, 300
        phases = 2 * np.pi * PERIOD * np.arange(round(12 / PERIOD))[:, None] / [7.0, 5.0, 3.0]
        states.append(np.empty((len(phases), 3)))
        for k, command in enumerate(START + AMPLITUDE * np.sin(phases)):
            simulated.step(command)
            states[-1][k] = simulated.true_state
    assert np.max(np.abs(states[0] - states[1]) / WIDTH) < 2e-3


def test_hardly_any_compliance_is_like_little() -> None:
    positions = np.concatenate([ramp(Dof.BENDING, 0, 1, 3), ramp(Dof.BENDING, 1, -1, 5)])
    ends = [
        move(plant(**{"twin.cables.compliance": compliance}), Dof.BENDING, positions)[-1]
        for compliance in (0.0, 5e-7, 8e-6)
    ]
    assert ends == pytest.approx([ends[0]] * 3, abs=0.06)


def test_an_unstable_simulation_is_an_error() -> None:
    simulated = plant()
    simulated._data.qvel[0] = 1e12
    with pytest.raises(ConfigError, match="unstable in the simulation"):
        simulated.step(START)


def width(simulated: Plant, dof: Dof, centre: float, amplitude: float, seconds: float) -> float:
    """Width of the last of two loops about centre + `centre` amplitudes."""
    phase = np.linspace(0, 4 * np.pi, round(2 * seconds / PERIOD))
    commands = START[dof] + AMPLITUDE[dof] * (centre + amplitude * np.sin(phase))
    tips = move(simulated, dof, commands)
    half = len(tips) // 2
    return loop_width(commands[half:], tips[half:]).mean


def test_friction_over_position_changes_the_width() -> None:
    changes = STRAIGHT | {"twin.friction.over_position": (0.3, 0.3)}
    wide, narrow = (
        width(plant(**changes), Dof.INSERTION, centre, 0.25, 8) for centre in (0.5, -0.5)
    )
    # The sine is 0.97 on average over the middle of these loops.
    assert wide / narrow == pytest.approx(1.29 / 0.71, rel=0.08)
    loops = {
        strength: [
            width(
                plant(**EASY | {"twin.cables.joint_friction": 3e-4}
                | {"twin.friction.over_position": (0.0, strength)}),
                Dof.BENDING, centre, 0.25, 8,
            )
            for centre in (0.5, -0.5)
        ]
        for strength in (0.0, 0.3)
    }  # fmt: skip
    even, uneven = (wide / narrow for wide, narrow in loops.values())
    assert uneven / even == pytest.approx(1.29 / 0.71, rel=0.12)


def test_friction_over_time_changes_the_width() -> None:
    changes = {"twin.friction.over_time": (0.3, 0.0), "twin.friction.time_period": 80.0}
    simulated = plant(**STRAIGHT | changes)
    rest = np.full(round(12 / PERIOD), START[0])
    move(simulated, Dof.INSERTION, rest)
    wide = width(simulated, Dof.INSERTION, 0.0, 0.4, 6)  # the last loop at 18 to 24 s
    move(simulated, Dof.INSERTION, np.full(round(28 / PERIOD), START[0]))
    narrow = width(simulated, Dof.INSERTION, 0.0, 0.4, 6)
    assert wide / narrow == pytest.approx(1.3 / 0.7, rel=0.08)


def test_friction_at_rest_falls_to_1_over_e_at_the_stated_speeds() -> None:
    variation = FrictionVariation(FrictionConfig(stick=(0.4, 0.2)), CONFIG.experiment)
    speeds = tuple(np.array([0.0, -v, 20 * v]) for v in (SHAFT_SPEED, JOINT_SPEED, CABLE_SPEED))
    found = variation.factors(*START[[0, 2]], 0.0, speeds)
    for factors, stick in zip(found, (0.4, 0.2, 0.2), strict=True):
        np.testing.assert_allclose(factors, [1 + stick, 1 + stick / np.e, 1.0], atol=1e-6)


@pytest.mark.parametrize("dof", [Dof.INSERTION, Dof.BENDING], ids=lambda dof: dof.label)
def test_friction_that_falls_with_speed_makes_the_tip_jump(dof: Dof) -> None:
    fastest = []
    for stick in (0.0, 0.5):
        simulated = plant(**{"twin.friction.stick": (stick, stick)})
        move(simulated, dof, ramp(dof, 0, 1.2, 6))
        tips = move(simulated, dof, ramp(dof, 1.2, 1.5, 30))[1000:]
        mean = 0.3 * AMPLITUDE[dof] / 30
        fastest.append(np.percentile(np.abs(np.diff(tips)) / PERIOD, 99.5) / mean)
    assert fastest[0] < 10, "it slides"
    assert fastest[1] > 5 * fastest[0], "it rests and jumps"
