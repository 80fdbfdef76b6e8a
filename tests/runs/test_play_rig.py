"""The simulated robot of plays is any robot of a configuration."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest
from drawn import EXAMPLES
from play_model import play
from tautscope import PlayRig, Pose, Tip, axes, load_config, run_experiment
from tautscope.config import Config, Sine
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.actuators import with_actuators
from tautscope.loop.references import OperatorMotion
from tautscope.report.operator_motion import motion_of
from tautscope.runs.recording import Floats
from tautscope.runs.rigs import GROUP, rig_maker


def test_each_tip_is_a_play_with_gain_and_zero() -> None:
    rig = PlayRig(axes(2, width_limit=[1.0, 2.0]), gains=[0.8, -1.1], zeros=[0.1, -0.2])
    commands = np.random.default_rng(0).normal(0, 1, (200, 2)).cumsum(axis=0) / 5
    rig.reset()
    samples = [rig.step(command) for command in commands]
    tips = np.array([sample.true_state for sample in samples])
    for k, (half, gain, zero) in enumerate([(0.25, 0.8, 0.1), (0.5, -1.1, -0.2)]):
        expected = zero + gain * play(commands[:, k], -half, half, start=0.0)
        np.testing.assert_allclose(tips[:, k], expected, atol=1e-12)
    seen = [one for sample in samples for one in sample.measurements]
    errors = np.array([one.values - tips[round(one.captured_at / 0.005) - 2] for one in seen])
    assert len(seen) == 40
    assert (errors.std(axis=0) < [0.015, 0.03]).all()


def test_motors_pose_and_what_does_not_move_the_tip() -> None:
    config = load_config(EXAMPLES / "own_instrument.toml")
    rig = with_actuators(PlayRig(config, delay=0.05), config)
    rig.reset()
    samples = [rig.step([0.5, 0.0, 0.0, 0.0, 0.8]) for _ in range(30)]
    np.testing.assert_allclose(samples[-1].applied, [0.5, 0, 0, 0, 0.8], atol=1e-9)
    np.testing.assert_allclose(samples[-1].true_state, [0.25, 0, 0, 0, 0.65], atol=1e-9)
    first = next(sample for sample in samples if sample.measurements)
    pose, jaw = first.measurements
    assert isinstance(pose, Pose)
    assert isinstance(jaw, Tip)
    assert jaw.sensor == 1
    assert np.isnan(jaw.values[:4]).all()
    assert first.time - pose.captured_at == pytest.approx(0.05, abs=0.0051)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("slack", [0.5, 0.3, 0.2]),
        ("slack", [0.5, 0.3, 0.2, 0.1]),
        ("slack", [-0.5, 0.3]),
        ("slack", [np.nan, 0.3]),
        ("slack", np.zeros((2, 0))),
        ("slack", np.zeros((2, 1, 1))),
        ("slack", "wide"),
        ("gains", [1.0, 1.0, 1.0]),
        ("gains", [[1.0], [1.0]]),
        ("zeros", "a"),
        ("zeros", np.inf),
        ("delay", np.nan),
    ],
)
def test_a_wrong_argument_is_named(field: str, value: Any) -> None:
    with pytest.raises(SignalError) as error:
        PlayRig(axes(2, width_limit=1.0), **{field: value})
    assert error.value.field == field


@pytest.mark.parametrize("command", [[np.nan, 0.0], [0.0] * 3, None, 0.0, [[0.0, 0.0]]])
def test_a_wrong_command_is_named_and_moves_nothing(command: Any) -> None:
    rig, other = (PlayRig(axes(2, width_limit=1.0)) for _ in range(2))
    with pytest.raises(SignalError, match=r"rig: .* reset\(\)"):
        rig.step([0.0, 0.0])
    rig.reset()
    with pytest.raises(SignalError, match="command"):
        rig.step(command)
    other.reset()
    states = [each.step([0.4, 0.4]) for each in (rig, other)]
    assert states[0].time == states[1].time
    np.testing.assert_array_equal(states[0].true_state, states[1].true_state)


def test_motors_without_a_way_back_are_refused() -> None:
    actuators = {"map": "test_play_rig:doubled"}
    rig = PlayRig(axes(2, width_limit=1.0).replace(actuators=actuators))
    with pytest.raises(SignalError, match=r"actuators\.map: .* dofs\(motors\)"):
        rig.reset()


def doubled(dofs: Floats) -> Floats:
    return 2 * dofs


def test_one_slack_is_that_of_all() -> None:
    config = axes(2, width_limit=1.0)
    rigs = PlayRig(config, 0.6), PlayRig(config, [0.6, 0.6]), PlayRig(config, [[0.6], [0.6]])
    for rig in rigs:
        rig.reset()
        np.testing.assert_array_equal(rig.step([1.0, -1.0]).true_state, [0.7, -0.7])


class LateRig(PlayRig):
    """Measures the tip where it was 0.1 s ago, with the present time as the stamp."""

    def measure(self, tip: Floats, time: float) -> Iterator[Tip]:
        self.past = [*getattr(self, "past", []), tip.copy()]
        if self.ticks % 5 == 0 and len(self.past) > 20:
            yield Tip(self.past[-21], time)


def test_updates_are_recorded_at_the_time_of_their_measurement() -> None:
    config = axes(1, width_limit=0.2).replace(**{"measurement.delays": [0.1]})
    motion = OperatorMotion([Sine(centre=0.0, amplitude=0.5)], 3, 4.0)
    run = run_experiment(LateRig(config, 0.02), motion, config)
    frames = run.frames[10:]
    np.testing.assert_allclose(frames["arrived_at"] - frames["captured_at"], 0.1, atol=1e-9)
    moved = np.abs(frames["estimate_axis_1"] - frames["true_axis_1"])
    assert np.sqrt(np.mean(moved**2)) < 0.02 * np.ptp(frames["true_axis_1"])


def test_a_rig_of_another_period_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    class SlowRig(PlayRig):
        closed = 0

        def __init__(self, config: Config) -> None:
            super().__init__(config)
            self.control_period *= 2

        def close(self) -> None:
            SlowRig.closed += 1

    monkeypatch.setattr("tautscope.SlowRig", SlowRig, raising=False)
    with pytest.raises(ConfigError, match=r"control\.period.*that of the rig, 0\.01 s"):
        rig_maker("tautscope:SlowRig")(axes(1, width_limit=1.0))
    assert SlowRig.closed == 1


@pytest.mark.parametrize("value", ["tautscope.missing:Arm", "tautscope:Missing"])
def test_an_entry_point_that_cannot_be_loaded_is_named(
    monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    found = [EntryPoint("arm", value, GROUP)]
    monkeypatch.setattr("tautscope.runs.rigs.entry_points", lambda **_: found)
    with pytest.raises(ConfigError, match=r"^rig: got 'arm', expected .*[mM]issing"):
        rig_maker("arm")


def test_a_configuration_alone_is_a_rig() -> None:
    config = load_config("colonoscope")
    rig = rig_maker("tautscope:PlayRig")(config)
    motion = motion_of(config, 1, 20.0)
    runs = [run_experiment(rig, motion, config, on) for on in (False, True)]
    without, compensated = (run.tracking_rms(10.0) for run in runs)
    assert (compensated < 0.3 * without).all()
    assert np.isnan(runs[0].tracking_rms(30.0)).tolist() == [True] * len(without)
    with pytest.raises(ConfigError, match=r"dof: got 'none'"):
        PlayRig(Config())
