"""Loops of 1 to 8 degrees of freedom with any sensor of the tip."""

import tomllib
from collections.abc import Callable
from copy import copy, deepcopy
from pickle import dumps
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from tautscope import Config, HysteresisReduction, Report, axes
from tautscope.config import DofEntry, KinematicsConfig, Sine, dump_config, from_document
from tautscope.errors import SignalError
from tautscope.loop.kinematics import TwoPlanes
from tautscope.loop.references import OperatorMotion

Floats = NDArray[np.float64]
PERIOD = 0.005
TWO = Config(
    dof=(DofEntry(name="bend_x", width_limit=1.0), DofEntry(name="bend_y", width_limit=1.0)),
    kinematics=KinematicsConfig(kind="two_planes", length=0.06, tip_length=0.01),
)


class Plays:
    """Tip of n motors: the mean of plays of some radii each."""

    def __init__(self, widths: ArrayLike, shares: ArrayLike = (1.0,)) -> None:
        self._half = np.outer(np.asarray(widths) / 2, shares)
        self._plays = np.zeros(self._half.shape)

    def __call__(self, command: Floats) -> Floats:
        motor = command[:, None]
        self._plays = np.clip(self._plays, motor - self._half, motor + self._half)
        tip: Floats = self._plays.mean(axis=1)
        return tip


Look = Callable[[HysteresisReduction, Floats, float], Report | None]


def operate(
    loop: HysteresisReduction,
    plant: Plays,
    look: Look,
    *,
    seconds: float = 50.0,
    delay: float = 0.04,
    amplitude: float = 1.0,
    spread: bool = False,
) -> Floats:
    """RMS (n,) of tip less reference, of the `spread` about its mean, with looks at 40 Hz.

    After 20 s of an operator's motion.
    """
    count = len(loop.delta_minus)
    motion = OperatorMotion([Sine(centre=0.0, amplitude=amplitude)] * count, 7, seconds)
    late: list[tuple[float, Floats]] = []
    errors = []
    for tick in range(round(seconds / PERIOD)):
        time = tick * PERIOD
        reference = motion(time)
        tip = plant(loop.step(reference, time))
        if tick % 5 == 0:
            late.append((time, tip))
        if late and late[0][0] <= time - delay:
            look(loop, late[0][1], late[0][0])
            late.pop(0)
        if time > 20:
            errors.append(tip - reference)
    rms: Floats = np.sqrt(np.mean(np.square(errors - spread * np.mean(errors, axis=0)), axis=0))
    return rms


def on_tip(std: float, seed: int = 0) -> Look:
    rng = np.random.default_rng(seed)
    return lambda loop, tip, at: loop.on_tip(
        tip + rng.normal(0, std, len(tip)), at, np.eye(len(tip)) * std**2
    )


@pytest.mark.parametrize(
    ("count", "shares"),
    [(1, (1.0,)), (2, (0.5, 0.75, 1.0, 1.25, 1.5)), (8, (1.0,))],
    ids=["1 ideal", "2 rounded", "8 ideal"],
)
def test_axes_measured_as_they_are_are_compensated(count: int, shares: tuple[float, ...]) -> None:
    widths = np.random.default_rng(count).uniform(0.45, 0.8, count)
    config = axes(count, width_limit=1.2)
    looks = on_tip(0.005)
    off = operate(HysteresisReduction(config, compensate=False), Plays(widths, shares), looks)
    loop = HysteresisReduction(config)
    left = operate(loop, Plays(widths, shares), looks)
    assert (1 - left / off).mean() > 0.82, 1 - left / off
    assert (1 - left / off).min() > 0.7, 1 - left / off
    assert loop.supervision.latched == ()
    # The rounded loop of these plays is as wide as their mean.
    found = loop.hysteresis
    assert found is not None
    np.testing.assert_allclose(2 * found.half_width, widths, rtol=0.25)


def sine_errors(
    widths: Floats, tip: Floats, zero: float, seconds: float
) -> tuple[Floats, tuple[str, ...]]:
    """Tip less reference, and flags, of two axes by a sensor whose zero is elsewhere.

    They begin at `tip`; the second axis rests for the first 8 s.
    """
    config, errors = axes(2, width_limit=2.0, expected_width=0.5, speed=2.0), []
    loop = HysteresisReduction(config)
    for tick in range(round(seconds / PERIOD)):
        time = tick * PERIOD
        reference = 1.5 * np.sin(0.9 * np.maximum([time, time - 8.0], 0.0))
        command = loop.step(reference, time)
        tip = np.clip(tip, command - widths / 2, command + widths / 2)
        if tick % 5 == 0:
            loop.on_tip(tip + zero, time)
        errors.append(tip - reference)
    return np.array(errors), loop.supervision.latched


@pytest.mark.parametrize("zero", [0.0, 0.125])
@pytest.mark.parametrize("start", [0.25, -0.25], ids=["lag", "lead"])
def test_a_start_at_an_end_of_the_slack_costs_the_first_seconds(start: float, zero: float) -> None:
    """Also of an axis that begins later, and with a zero of the sensor a quarter of it off."""
    widths = np.full(2, 0.5)
    errors, flags = sine_errors(widths, np.full(2, start), zero, 28.0)
    assert flags == ()
    for axis, begins in enumerate((0.0, 8.0)):
        settled = errors[round((begins + 10.0) / PERIOD) : round((begins + 20.0) / PERIOD), axis]
        assert np.std(settled) < 0.12 * widths[axis] / 2


def test_a_long_first_stroke_does_not_keep_a_slack_that_is_not_there() -> None:
    """A sixth of the expected slack: nothing tells it before the first reversal."""
    loop, tip, errors = HysteresisReduction(axes(1, width_limit=0.9)), np.zeros(1), []
    for tick in range(20000):
        time = tick * PERIOD
        reference = [np.sin(0.04 * np.pi * time)]
        command = loop.step(reference, time)
        tip = np.clip(tip, command - 0.05, command + 0.05)
        if tick % 5 == 0:
            loop.on_tip(tip, time)
        errors.append((tip - reference)[0])
    # The first reversal is at 12.5 s.
    assert np.std(errors[4000:]) < 0.01


def test_a_loop_begins_with_what_was_estimated() -> None:
    """A slack of a sixth of the expected one, and one as wide as can be."""
    for width in (0.15, 0.88):
        loop = HysteresisReduction(axes(1, width_limit=0.9))
        operate(loop, Plays([width]), on_tip(0.002), seconds=30.0)
        config = tomllib.loads(dump_config(loop.estimated_config()))
        next_one = HysteresisReduction(from_document(config))
        found, begun = (each.delta_plus - each.delta_minus for each in (loop, next_one))
        np.testing.assert_allclose(found, width, rtol=0.1)
        assert abs(begun - found) < 0.3 * abs(found - 0.6)  # 0.6 are expected


@pytest.mark.parametrize("copied", [copy, deepcopy, dumps])
def test_a_loop_has_no_copy(copied: Callable[[object], object]) -> None:
    with pytest.raises(TypeError, match="estimated_config"):
        copied(HysteresisReduction(axes(1, width_limit=0.9)))


def test_motion_beyond_the_range_is_discarded_which_the_followed_reference_shows() -> None:
    loop, plant = HysteresisReduction(axes(1, width_limit=0.9, range=(-1, 1))), Plays([0.6])
    assert np.isnan(loop.reference).all()
    for tick in range(8000):
        time = tick * PERIOD
        reference = np.sin(0.2 * np.pi * np.minimum([time], 5.0)) + 0.4 * np.sin(0.6 * time)
        tip = plant(loop.step(reference, time))
        if tick % 5 == 0:
            loop.on_tip(tip, time)
    assert reference[0] - loop.reference[0] > 0.1
    assert abs(tip[0] - loop.reference[0]) < 0.05


@pytest.mark.parametrize("compensate", [True, False])
def test_motors_need_not_be_faster_than_they_are(compensate: bool) -> None:
    """Two and a half times as fast as the reference, without a flag."""
    config = axes(1, width_limit=0.9, command_speed=1.5)
    loop, plant, errors = HysteresisReduction(config, compensate), Plays([0.6]), []
    for tick in range(8000):
        time = tick * PERIOD
        reference = np.array([np.sin(0.6 * time)])
        tip = plant(loop.step(reference, time))
        if tick % 5 == 0:
            loop.on_tip(tip, time)
        errors.append((tip - reference)[0])
    assert loop.supervision.latched == ()
    assert np.std(errors[4000:]) < (0.03 if compensate else 0.3)


def test_twice_the_expected_slack_is_learned() -> None:
    """After a minute no more is left than of the expected slack."""
    errors, _ = sine_errors(np.full(2, 1.0), np.zeros(2), 0.0, 90.0)
    assert np.std(errors[round(60 / PERIOD) :], axis=0).max() < 0.06 * 0.5


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_a_wrong_sign_of_one_sensor_ends_compensation(profile: Literal["best", "paper"]) -> None:
    """The tip then follows as without it; with `paper` at a constant difference."""
    config, look = axes(2, width_limit=1.2).replace(profile=profile), on_tip(0.005)

    def reversed_look(loop: HysteresisReduction, tip: Floats, at: float) -> Report:
        return loop.on_tip(tip * [1, -1], at, np.eye(2) * 0.005**2)

    free = HysteresisReduction(config, compensate=False)
    off = operate(free, Plays([0.6] * 2), look, amplitude=1.8)
    loop = HysteresisReduction(config)
    left = operate(loop, Plays([0.6] * 2), reversed_look, amplitude=1.8)
    assert loop.supervision.reaction == "pass_through"
    assert "start_check" in loop.supervision.flags
    if profile == "best":
        np.testing.assert_allclose(left, off, rtol=0.05)
    loop.engage()
    assert "start_check" not in loop.supervision.flags


def test_a_sensor_that_gives_what_a_tracker_gives_without_a_tool_is_still_checked() -> None:
    loop = HysteresisReduction(axes(2, width_limit=1.2))

    def look(loop: HysteresisReduction, tip: Floats, at: float) -> Report:
        second = -9999.0 if 0.05 < at < 0.1 else -tip[1]
        return loop.on_tip([tip[0], second], at, np.eye(2) * 0.005**2)

    operate(loop, Plays([0.6] * 2), look, amplitude=1.8, seconds=30.0)
    assert "start_check" in loop.supervision.flags


def test_axes_that_share_a_friction_release_each_other() -> None:
    """A shaft that slides and turns in a channel: Coulomb friction on a friction ellipse."""
    unit, half = np.array([12e-3, 2.6]), np.array([3.5e-3, 0.7])

    class Shaft:
        def __init__(self) -> None:
            self.tip = np.zeros(2)

        def __call__(self, command: Floats) -> Floats:
            deflection = (command - self.tip) / half
            size = float(np.hypot(*deflection))
            if size > 1:
                self.tip = command - half * deflection / size
            return self.tip.copy()

    keys: dict[str, Any] = {"width_limit": unit, "unit": ["m", "rad"]}
    alone = axes(2, **keys)
    shared = axes(2, **keys, friction="shaft", lever=[1.0, half[0] / half[1]])
    sines = [Sine(centre=0.0, amplitude=12e-3), Sine(centre=0.0, amplitude=2.0)]
    left = []
    for config in (alone, shared):
        loop, shaft, motion = HysteresisReduction(config), Shaft(), OperatorMotion(sines, 5, 60.0)
        errors = []
        for tick in range(12_000):
            time = tick * PERIOD
            tip = shaft(loop.step(motion(time), time))
            if tick % 8 == 0:
                loop.on_tip(tip, time)
            if time > 25:
                errors.append((tip - motion(time)) / half)
        left.append(np.sqrt(np.mean(np.square(errors))))
    assert left[1] < 0.8 * left[0], left


def test_a_pose_determines_both_planes() -> None:
    kinematics = TwoPlanes(TWO)
    rng = np.random.default_rng(3)

    def look(loop: HysteresisReduction, tip: Floats, at: float) -> Report:
        position, rotation = kinematics.tip(tip)
        return loop.on_pose(position + rng.normal(0, 0.3e-3, 3), at, rotation)

    left = operate(HysteresisReduction(TWO), Plays([0.6, 0.5]), look)
    # Without compensation the tip is off by nearly half of the slack.
    assert (left < 0.2 * 0.45 * np.array([0.6, 0.5])).all(), left


def test_a_position_alone_is_enough_where_it_determines_the_state() -> None:
    kinematics = TwoPlanes(TWO)

    def look(loop: HysteresisReduction, tip: Floats, at: float) -> Report:
        return loop.on_pose(kinematics.tip(tip)[0], at)

    left = operate(HysteresisReduction(TWO), Plays([0.6, 0.5]), look)
    assert left.max() < 0.08


class Camera:
    """Two points of a tip that bends in one plane, as a pinhole sees them from aside."""

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        raise AssertionError("points need no tip")

    def points(self, q: Floats) -> Floats:
        angle, insertion = q
        ends = np.array([[0.3, 0.01], [0.6, 0.02]]) * np.array([angle, 1.0])
        return 400 * np.stack([insertion + ends[:, 1] * np.cos(ends[:, 0]), ends[:, 0]], axis=1)


POINTS = from_document(
    {
        "dof": [
            {"name": "bend", "width_limit": 1.2},
            {"name": "insertion", "unit": "m", "width_limit": 12e-3},
        ],
        "kinematics": {"kind": "test_axes:Camera"},
    }
)


def test_points_of_your_own_kinematics() -> None:
    camera, loop = Camera(), HysteresisReduction(POINTS)
    plant = Plays([0.6, 6e-3])
    for tick in range(6000):
        time = tick * PERIOD
        tip = plant(loop.step([0.8 * np.sin(time), 0.012 * np.sin(0.7 * time)], time))
        if tick % 8 == 0:
            seen, at_once = camera.points(tip), tip
            if tick % 3 == 0:
                seen[1] = np.nan  # not found
            if tick % 5 == 0:
                seen[0] += [40.0, 30.0]  # something else
            report = loop.on_points(seen, time)
    scale = np.array([1.2, 12e-3])
    np.testing.assert_allclose(report.state_estimate / scale, at_once / scale, atol=0.02)
    np.testing.assert_allclose(loop.predicted_state / scale, tip / scale, atol=0.05)


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_a_point_that_is_wrong_for_good_is_reported(profile: Literal["best", "paper"]) -> None:
    camera, loop = Camera(), HysteresisReduction(POINTS.replace(profile=profile))
    plant = Plays([0.6, 6e-3])
    for tick in range(6000):
        time = tick * PERIOD
        tip = plant(loop.step([0.8 * np.sin(time), 0.012 * np.sin(0.7 * time)], time))
        if tick % 8 == 0:
            seen = camera.points(tip)
            if tick > 2000:
                seen[0] += [40.0, 30.0]
            loop.on_points(seen, time)
        assert tick > 2000 or not loop.supervision.latched
    assert {"merged", "innovation"} & set(loop.supervision.latched)


@pytest.mark.parametrize("with_orientation", [True, False])
@pytest.mark.parametrize(
    ("length", "zero", "tilt"),
    [(0.06, 0.0, 0.0), (0.06, 5e-3, 0.0), (0.05, 0.0, 0.0), (0.06, 0.0, 0.26)],
    ids=["right", "zero off by 5 mm", "section shorter", "tilted by 15 degrees"],
)
def test_kinematics_and_trackers_may_be_off(
    length: float, zero: float, tilt: float, with_orientation: bool
) -> None:
    """At most a third of the spread is left, and the kinematics are said to be off."""
    robot = TwoPlanes(TWO.replace(**{"kinematics.length": length}))
    turn = Rotation.from_rotvec([0.0, tilt, 0.0]).as_matrix()
    rng = np.random.default_rng(1)

    def look(loop: HysteresisReduction, tip: Floats, at: float) -> None:
        position, rotation = robot.tip(tip)
        seen = turn @ position + [zero, 0.0, 0.0] + rng.normal(0, 3e-4, 3)
        loop.on_pose(seen, at, turn @ rotation if with_orientation else None)

    left = {}
    for compensate in (False, True):
        loop = HysteresisReduction(TWO, compensate)
        left[compensate] = operate(loop, Plays([0.6, 0.6]), look, spread=True)
    is_right = (length, zero, tilt) == (0.06, 0.0, 0.0)
    assert np.all(left[True] < (0.1 if is_right else 1 / 3) * left[False]), left
    assert ("geometry_off" in loop.supervision.latched) == (not is_right)


def test_a_model_that_sees_nothing_is_reported() -> None:
    loop = HysteresisReduction(axes(1, width_limit=1.0))
    for tick in range(2000):
        time = tick * PERIOD
        loop.step([1.5 * np.sin(0.5 * time)], time)
        if tick % 8 == 0:
            values = [0.1 + 1e-6 * tick]
            report = loop.on_measurement(
                values, time, [[1e-4]], lambda q: np.nan * q, jacobian=lambda q: np.eye(1)
            )
    assert report.status == "held"
    assert loop.supervision.flags == ("unobservable",)


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_bands_where_the_model_sees_none_are_lost(profile: Literal["best", "paper"]) -> None:
    loop = HysteresisReduction(Config(profile=profile))
    for tick in range(200):
        loop.step([-0.030, 0.0, 0.9], tick * PERIOD)
    assert loop.predicted_features(tick * PERIOD) is None
    report = loop.on_features([350.0, 260.0, 345.0, 190.0], tick * PERIOD)
    assert report.status == "held"
    assert report.warnings == ("lost",)


def test_a_measurement_of_your_own_needs_no_jacobian() -> None:
    """Two sums of three DOFs and one value twice, against the same with exact derivatives."""
    rows = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]])
    config = axes(3, width_limit=1.0)
    loops = [HysteresisReduction(config) for _ in range(2)]
    plants = [Plays([0.5, 0.4, 0.6]) for _ in range(2)]
    for tick in range(3000):
        time = tick * PERIOD
        reference = np.sin(time * np.array([1.0, 0.7, 1.3]))
        for index, (loop, plant) in enumerate(zip(loops, plants, strict=True)):
            tip = plant(loop.step(reference, time))
            if tick % 8 == 0:
                z = rows @ tip**3
                derive = None if index == 0 else lambda q: rows * (3 * q**2)
                loop.on_measurement(
                    z, time, np.eye(3) * 1e-4, lambda q: rows @ q**3, jacobian=derive
                )
    np.testing.assert_allclose(loops[0].delta_plus, loops[1].delta_plus, rtol=1e-3)


def test_two_equal_values_say_as_much_as_one_of_half_the_variance() -> None:
    config = axes(2, width_limit=1.0)
    once, twice = HysteresisReduction(config), HysteresisReduction(config)
    plant = Plays([0.5, 0.4])
    stack = np.vstack([np.eye(2), np.eye(2)])
    for tick in range(2000):
        time = tick * PERIOD
        reference = np.sin(time * np.array([1.0, 0.7]))
        tip = plant(once.step(reference, time))
        twice.step(reference, time)
        if tick % 8 == 0:
            first = once.on_tip(tip, time, np.eye(2) * 1e-4)
            second = twice.on_measurement(
                stack @ tip, time, np.eye(4) * 2e-4, lambda q: stack @ q, jacobian=lambda _: stack
            )
            np.testing.assert_allclose(first.state_estimate, second.state_estimate, atol=1e-4)
    # The tip is that of the one loop's commands, from which the other one's differ a little.
    np.testing.assert_allclose(once.delta_plus, twice.delta_plus, rtol=2e-3)


def test_what_was_not_measured_is_held() -> None:
    loop = HysteresisReduction(axes(2, width_limit=1.0))
    for tick in range(400):
        loop.step([0.001 * tick, 0.001 * tick], tick * PERIOD)
    report = loop.on_tip([0.2, np.nan], 399 * PERIOD)
    assert report.status == "partial"
    np.testing.assert_array_equal(report.observable, [True, False])
    assert np.isnan(report.innovation).tolist() == [False, True]


def test_repeated_late_and_future_measurements() -> None:
    loop = HysteresisReduction(axes(1, width_limit=1.0))
    for tick in range(400):
        loop.step([0.001 * tick], tick * PERIOD)
    now = 399 * PERIOD
    assert loop.on_tip([0.3], now - 0.1).status == "ok"
    assert loop.on_tip([0.31], now - 0.1).status == "duplicate"
    assert loop.on_tip([0.29], now - 0.15).status == "duplicate"
    assert loop.on_tip([0.29], now - 0.15, sensor=1).status == "ok"
    assert loop.on_tip([0.3], now - 0.5, sensor=2).status == "refused"
    assert loop.on_tip([0.3], now + 1.0).status == "stale"
    # Others measured the same just now.
    assert loop.supervision.latched == ("duplicate", "dropped", "frame_rate")


def test_a_late_sensor_counts_at_the_time_of_its_measurement() -> None:
    """A fast encoder of the first DOF, and a slow tracker of both, 200 ms late."""
    loop, plant = HysteresisReduction(axes(2, width_limit=1.0)), Plays([0.5, 0.5])
    tips: list[Floats] = []
    errors = []
    for tick in range(8000):
        time = tick * PERIOD
        tips.append(plant(loop.step(np.sin(time * np.array([1.0, 0.8])), time)))
        loop.on_tip([tips[-1][0], np.nan], time, np.eye(2) * 1e-6)
        if tick % 8 == 0 and tick >= 40:
            report = loop.on_tip(tips[-41], time - 40 * PERIOD, np.eye(2) * 1e-6, sensor=1)
            errors.append(report.state_estimate - tips[-41])
            assert report.status in ("ok", "refused"), report
    assert np.abs(errors[-200:]).max() < 0.02
    assert loop.supervision.lead == 1.0
    reference = np.sin(time * np.array([1.0, 0.8]))
    assert np.abs(tips[-1] - reference).max() < 0.12


def test_sensors_may_share_the_dofs() -> None:
    """One sensor each; a DOF that none measures any more is said."""
    loop, plant = HysteresisReduction(axes(2, width_limit=1.0)), Plays([0.5, 0.5])
    errors = []
    for tick in range(7000):
        time, reference = tick * PERIOD, np.sin(tick * PERIOD * np.array([1.0, 0.8]))
        tip = plant(loop.step(reference, time))
        errors.append(tip - reference)
        if tick % 8 == 0:
            loop.on_tip([tip[0], np.nan], time)
        if tick % 8 == 4:
            second = [np.nan, tip[1]] if tick < 6000 else [tip[0] + 1e-6 * tick, np.nan]
            report = loop.on_tip(second, time, sensor=1)
            assert report.status in ("partial", "refused"), report
        if tick == 5999:
            assert loop.supervision.latched == ()
    np.testing.assert_array_less(np.sqrt(np.mean(np.square(errors[3000:6000]), axis=0)), 0.05)
    assert loop.supervision.latched == ("unobservable",)


def test_a_degree_of_freedom_that_is_never_measured_leaves_the_others_compensated() -> None:
    def look(loop: HysteresisReduction, tip: Floats, captured_at: float) -> Report:
        return loop.on_tip([tip[0], np.nan], captured_at)

    loop = HysteresisReduction(axes(2, width_limit=1.0))
    assert operate(loop, Plays([0.6, 0.6]), look)[0] < 0.03
    assert loop.supervision.latched == ("unobservable",)
    assert loop.supervision.reaction == "warn"


def test_motion_within_the_slack_does_not_move_a_tip_that_is_measured_without_noise() -> None:
    """Forth and back, farther in sum than any slack is wide."""
    loop, plant = HysteresisReduction(axes(1, width_limit=1.0), compensate=False), Plays([0.6])
    for tick in range(12000):
        time = tick * PERIOD
        loop.on_tip(plant(loop.step([0.25 * np.sin(3 * time)], time)), time)
    assert loop.supervision.latched == ()


def test_one_value_that_is_stuck_is_left_out() -> None:
    """An encoder of two is unplugged: its degree of freedom is not worse off."""

    def look(loop: HysteresisReduction, tip: Floats, at: float) -> None:
        first, second = tip + 0.002 * np.sin([500 * at, 700 * at])
        loop.on_tip([0.123 if at > 10 else first, second], at)

    errors = []
    for compensate in (False, True):
        loop = HysteresisReduction(axes(2, width_limit=0.9), compensate)
        errors.append(operate(loop, Plays([0.6, 0.6]), look, seconds=100.0, amplitude=1.5))
        assert "unobservable" in loop.supervision.latched
    without, with_it = errors
    assert with_it[0] < 0.4 * without[0]
    assert with_it[1] < 0.1 * without[1]


@pytest.mark.parametrize("rate", [1, 8])
@pytest.mark.parametrize("fault", ["frozen", "innovation"])
def test_a_fast_sensor_does_not_excuse_a_slow_one_of_another_dof(fault: str, rate: int) -> None:
    """Sensor 0 fails after 20 s: the reaction is the same however often sensor 1 measures well."""
    loop, plant, reactions = HysteresisReduction(axes(2, width_limit=1.0)), Plays([0.6, 0.6]), []
    noise = np.random.default_rng(0)
    for tick in range(9000):
        time = tick * PERIOD
        tip = plant(loop.step(0.8 * np.sin([0.8 * time, 0.63 * time]), time))
        tip = tip + 0.003 * noise.standard_normal(2)
        if tick % (16 // rate) == 1:
            loop.on_tip([np.nan, tip[1]], time, sensor=1)
        if tick % 16 == 7:
            is_off = time > 20
            value = tip[0] + 3.0 * is_off if fault == "innovation" else (tip[0], 0.123)[is_off]
            loop.on_tip([value, np.nan], time)
            reactions.append(loop.supervision.reaction)
            if reactions[-1] == "fade":
                break
    assert fault in loop.supervision.flags
    assert reactions[-1] == "fade"
    # From the first hold on, compensation is not in full use between two bad measurements.
    held = reactions[reactions.index("hold_estimate") :]
    assert set(held[:-1]) == {"hold_estimate"}


def test_without_the_check_of_frozen_sensors_measurements_count_as_they_are() -> None:
    loops = [
        HysteresisReduction(axes(2, width_limit=0.9).replace(**{"safety.off": off}))
        for off in ((), ("frozen",))
    ]
    left = [operate(loop, Plays([0.6, 0.5]), on_tip(0.002)) for loop in loops]
    np.testing.assert_array_equal(left[0], left[1])


def test_a_tracker_that_repeats_its_value_is_frozen() -> None:
    loop, plant = HysteresisReduction(axes(1, width_limit=1.0)), Plays([0.5])
    for tick in range(6000):
        time = tick * PERIOD
        tip = plant(loop.step([2.0 * np.sin(time)], time))
        loop.on_tip(tip if tick < 3000 else [0.123], time)
    assert "frozen" in loop.supervision.latched


@pytest.mark.parametrize("call", ["on_tip", "on_pose", "on_points"])
def test_the_articles_instrument_says_what_it_needs(call: str) -> None:
    with pytest.raises(SignalError, match="dof"):
        getattr(HysteresisReduction(Config()), call)([0.0, 0.0, 0.0], 0.0)


def test_an_error_of_your_model_is_raised_and_the_loop_goes_on() -> None:
    loop = HysteresisReduction(axes(1, width_limit=1.0))
    loop.step([0.0], 0.0)

    def fail(_: Floats) -> Floats:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        loop.on_measurement([0.0], 0.0, [[1.0]], fail)
    assert np.isfinite(loop.step([0.01], PERIOD)).all()
