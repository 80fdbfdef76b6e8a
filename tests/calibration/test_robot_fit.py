"""Calibration of any robot: known parameters are found, and what is not determined is refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from tautscope import Config, Points, Pose, Sample, Tip, axes
from tautscope.calibration.robot import MotionRecord, RobotFit, fit, move, sweep_motion
from tautscope.config import DofEntry, KinematicsConfig
from tautscope.errors import CalibrationError, ConfigError, FieldError
from tautscope.loop.measurement import Measurement

PERIOD = 0.01
SKEW, LENGTH, TIP = 0.06, 0.07, 0.018
BASE, TURN, SENSOR = [0.3, -0.1, 0.2], [0.4, -1.2, 0.7], [0.05, 0.02, -0.3]
CATHETER = Config(
    dof=tuple(
        DofEntry(name=name, width_limit=1.0, range=(-1.5, 1.5)) for name in ("bend_x", "bend_y")
    ),
    kinematics=KinematicsConfig(kind="two_planes"),
).replace(**{"control.period": PERIOD})


def catheter(q: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Pose of the tip by SciPy's rotations, integrated along the section."""
    bend = np.array([q[0] - q[1] * np.sin(SKEW), q[1] * np.cos(SKEW)])
    share = (np.arange(20) + 0.5) / 20
    about = np.array([-bend[1], bend[0], 0.0])
    along = Rotation.from_rotvec(share[:, None] * about).apply([0.0, 0.0, 1.0])
    end = Rotation.from_rotvec(about)
    base, sensor = Rotation.from_rotvec(TURN), Rotation.from_rotvec(SENSOR)
    place = LENGTH * along.mean(axis=0) + end.apply([0.0, 0.0, TIP])
    noise = Rotation.from_rotvec(rng.normal(0, 3e-3, 3))
    return BASE + base.apply(place) + rng.normal(0, 3e-4, 3), (
        base * end * sensor * noise
    ).as_matrix()


class Robot:
    """Plays with gains and zeros, and a sensor whose stamps are late."""

    control_period = PERIOD

    def __init__(
        self,
        measure: Callable[[np.ndarray, float], Measurement],
        gains: ArrayLike,
        zeros: ArrayLike,
        widths: ArrayLike,
        delay: float = 0.0,
    ) -> None:
        self.measure, self.delay = measure, delay
        self.gains, self.zeros, self.half = (np.array(each) for each in (gains, zeros, widths))
        self.half = self.half / 2

    def reset(self) -> Sample:
        self.ticks, self.played = 0, np.zeros(len(self.half))
        return self.step(np.zeros(len(self.half)))

    def step(self, command: ArrayLike) -> Sample:
        motors = np.asarray(command)
        now = self.ticks * PERIOD
        self.played = np.clip(self.played, motors - self.half, motors + self.half)
        found = () if self.ticks % 10 else (self.measure(self.tip(), now + self.delay),)
        self.ticks += 1
        return Sample(now, motors, measurement=found)

    def tip(self) -> np.ndarray:
        return self.zeros + self.gains * self.played

    def close(self) -> None:
        pass


def record(robot: Robot, config: Config, seconds: float = 30.0) -> MotionRecord:
    return move(robot, sweep_motion(config, seconds), config)


def check(found: RobotFit, true: dict[str, float]) -> None:
    for name, value in true.items():
        error = abs(found.values[name] - value)
        assert error < 3 * found.std[name], (name, found.values[name], value, found.std[name])


@pytest.mark.parametrize("seed", range(4))
def test_gains_signs_zeros_and_delay_of_a_measured_tip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    config = axes(2, width_limit=1.0).replace(**{"control.period": PERIOD})
    dofs = [{"name": f"axis_{k}", "width_limit": 1.0, "range": (-2.0, 2.0)} for k in range(2)]
    config = config.replace(dof=dofs)
    gains, zeros, widths = rng.uniform(0.7, 1.2, 2) * [1, -1], rng.normal(0, 0.2, 2), [0.3, 0.6]
    robot = Robot(lambda q, t: Tip(q + rng.normal(0, 0.01, 2), t), gains, zeros, widths, 0.08)
    found = fit(record(robot, config), config)
    assert not found.undetermined
    # The tip of a sample follows the command before it.
    true = {"measurement.delays[0]": 0.08 + PERIOD}
    for k in range(2):
        true |= {f"dof.axis_{k}.gain": gains[k], f"dof.axis_{k}.zero": zeros[k]}
        assert found.values[f"dof.axis_{k}.slack"] == pytest.approx(widths[k], abs=0.06)
        assert found.std[f"dof.axis_{k}.gain"] < 0.05
    check(found, true)


def test_the_delay_alone_of_a_robot_whose_tip_is_measured() -> None:
    """As `calibrate latency --rig` keeps the kinematics, of which this robot has none."""
    rng = np.random.default_rng(5)
    robot = Robot(lambda q, t: Tip(q + rng.normal(0, 0.01, 2), t), [1, 1], [0, 0], [0.3, 0.6], 0.08)
    config = CATHETER.replace(kinematics=KinematicsConfig())
    found = fit(record(robot, config, 15.0), config, keep=("kinematics",))
    check(found, {"measurement.delays[0]": 0.08 + PERIOD})
    with pytest.raises(FieldError, match=r"kinematics\.length"):
        fit(record(robot, config, 12.0), config, keep=("kinematics.length",))


def test_the_kinematics_of_a_catheter_in_the_frame_of_a_tracker() -> None:
    rng = np.random.default_rng(0)

    def measure(q: np.ndarray, time: float) -> Pose:
        position, rotation = catheter(q, rng)
        return Pose(position, time, rotation)

    robot = Robot(measure, [0.9, 1.1], [0.1, -0.05], [0.3, 0.4])
    found = fit(record(robot, CATHETER, 13.0), CATHETER)
    assert not found.undetermined
    true = {"kinematics.length": LENGTH, "kinematics.tip_length": TIP, "kinematics.skew": SKEW}
    check(found, true)
    base, sensor = (
        [found.values[f"kinematics.{of}_rotation[{k}]"] for k in range(3)]
        for of in ("base", "sensor")
    )
    turned = Rotation.from_rotvec(base) * Rotation.from_rotvec(TURN).inv()
    assert turned.magnitude() < 0.03
    turned = Rotation.from_rotvec(sensor) * Rotation.from_rotvec(SENSOR).inv()
    assert turned.magnitude() < 0.03
    assert found.deviations["measurement.position_deviation"] == pytest.approx(3e-4, rel=0.25)


def test_what_a_sweep_does_not_determine_is_named() -> None:
    rng = np.random.default_rng(1)

    def measure(q: np.ndarray, time: float) -> Pose:
        return Pose(catheter(q, rng)[0], time)

    class Still(Robot):
        def tip(self) -> np.ndarray:
            return super().tip() * [1.0, 0.0]

    robot = Still(measure, [1.0, 1.0], [0.0, 0.0], [0.3, 0.3])
    run = record(robot, CATHETER, 14.0)
    found = fit(run, CATHETER)
    assert "dof.bend_y.gain" in found.undetermined
    with pytest.raises(FieldError, match=r"--keep: got 'kinematics.rotation'"):
        fit(run, CATHETER, ["kinematics.rotation"])
    for count in (0, 50):
        with pytest.raises(CalibrationError, match=r"\d measurements in the motion. Check the sen"):
            fit(MotionRecord(run.times, run.commands, run.measurements[:count]), CATHETER)
    with pytest.raises(ConfigError, match=r"dof\[0\].range"):
        sweep_motion(axes(1, width_limit=1.0))


def test_points_of_a_users_kinematics_have_zeros_and_gains_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    config = axes(1, width_limit=1.0).replace(
        **{"control.period": PERIOD, "kinematics.kind": f"{__name__}:Line"},
        dof=[{"name": "axis", "width_limit": 1.0, "range": (-2.0, 2.0)}],
    )
    rng = np.random.default_rng(0)

    def measure(q: np.ndarray, time: float) -> Points:
        return Points(Line().points(q) + rng.normal(0, 0.5, (1, 2)), time)

    found = fit(record(Robot(measure, [0.8], [0.3], [0.4]), config), config)
    assert set(found.std) == {"dof.axis.zero", "dof.axis.gain", "measurement.delays[0]"}
    check(found, {"dof.axis.zero": 0.3, "dof.axis.gain": 0.8})


class Line:
    """A point that moves across the image."""

    def tip(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([q[0], 0.0, 0.0]), np.eye(3)

    def points(self, q: np.ndarray) -> np.ndarray:
        return np.array([[100.0 * q[0] + 300.0, 200.0]])


class Blind(Line):
    """A point whose place is not known where it is calibrated."""

    def points(self, q: np.ndarray) -> np.ndarray:
        return np.full((1, 2), np.nan)


def test_kinematics_that_predict_no_number_are_named() -> None:
    config = axes(1, width_limit=1.0).replace(
        **{"control.period": PERIOD, "kinematics.kind": f"{__name__}:Line"},
        dof=[{"name": "axis", "width_limit": 1.0, "range": (-2.0, 2.0)}],
    )

    def measure(q: np.ndarray, time: float) -> Points:
        return Points(Line().points(q), time)

    run = record(Robot(measure, [1.0], [0.0], [0.4]), config)
    with pytest.raises(CalibrationError, match="no finite tip"):
        fit(run, config.replace(**{"kinematics.kind": f"{__name__}:Blind"}))


def test_two_sensors_whose_measurements_alternate_are_both_used() -> None:
    rng = np.random.default_rng(0)

    class WithTwo(Robot):
        def step(self, command: ArrayLike) -> Sample:
            sample = super().step(command)
            if not sample.measurements:
                return sample
            second = Tip(self.tip() + rng.normal(0, 0.01, 1), sample.time + 0.15, sensor=1)
            return replace(sample, measurement=(*sample.measurements, second))

    config = axes(1, width_limit=1.0).replace(**{"control.period": PERIOD})
    config = config.replace(dof=[{"name": "a", "width_limit": 1.0, "range": (-2.0, 2.0)}])
    robot = WithTwo(lambda q, t: Tip(q + rng.normal(0, 0.01, 1), t), [0.9], [0.1], [0.3], 0.08)
    found = fit(record(robot, config, 22.0), config)
    assert not found.undetermined
    check(found, {f"measurement.delays[{k}]": (0.08, 0.15)[k] + PERIOD for k in range(2)})


@pytest.mark.parametrize("period", [5.0, 9.0, 20.0, 100.0])
def test_the_sweep_starts_at_rest_and_stays_within_half_of_the_speed(period: float) -> None:
    """By limits that would make a sine of amplitude 1.6 so long; shorter ones are made longer."""
    speed = 2 * 1.6 * 2 * np.pi / period
    dof = {"name": "a", "width_limit": 1.0, "range": (-2.0, 2.0), "speed": speed}
    motion = sweep_motion(axes(1, width_limit=1.0).replace(dof=[dof]))
    times = np.arange(0.0, 60.0, 1e-3)
    speeds = np.abs(np.diff([motion(time)[0] for time in times])) / 1e-3
    assert speeds[0] < 1e-3 * speed
    assert speeds.max() <= speed / 2 * (1 + 1e-9)
    assert speeds.max() > 0.49 * min(speed, 2 * 1.6 * 2 * np.pi / 9.0)
