"""The loop on a rig other than the twin: three plays and a drawn image."""

from concurrent.futures import Executor, Future
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from drawn import BACKLASH, BadFrameRig, DrawnRig, short_experiment
from numpy.typing import ArrayLike, NDArray
from tautscope.dof import Dof
from tautscope.errors import FrameError, SignalError
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Frame, Rig, Sample
from tautscope.report.results import evaluate
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording, per_dof, per_feature

CONFIG = short_experiment()
REFERENCE = SineSequence(CONFIG.experiment)


class Constant:
    """A constant reference; `value` may be invalid."""

    duration = 0.3
    segments = ()

    def __init__(self, value: ArrayLike) -> None:
        self.value = value

    def __call__(self, time: float) -> NDArray[np.float64]:
        return self.value  # type: ignore[return-value]


class BlindToTruth(DrawnRig):
    """A rig without a true state, like hardware."""

    def _sample(self, applied: NDArray[np.float64]) -> Sample:
        return replace(super()._sample(applied), true_state=None)


class SlowCamera(DrawnRig):
    """A rig with images 0.05 s old, the first captured before the start."""

    def _sample(self, applied: NDArray[np.float64]) -> Sample:
        sample = super()._sample(applied)
        if sample.frame is None:
            return sample
        return replace(sample, frame=replace(sample.frame, captured_at=sample.time - 0.05))


class StoppedClock(DrawnRig):
    def step(self, command: ArrayLike) -> Sample:
        return replace(super().step(command), time=0.0)


def run(rig: Rig, compensate: bool = True) -> Recording:
    return run_experiment(rig, REFERENCE, CONFIG, compensate)


def test_the_drawn_rig_has_the_rig_protocol() -> None:
    assert isinstance(DrawnRig(CONFIG), Rig)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_the_reduction_is_that_of_the_gain(
    uncompensated: Recording, compensated: Recording, dof: Dof
) -> None:
    result = evaluate(uncompensated, compensated)[dof]
    width = BACKLASH[dof]
    sine = CONFIG.experiment[dof]
    per_tick = 2 * np.pi * sine.amplitude / sine.period * DrawnRig.control_period
    # The tip follows the command of the previous tick.
    assert width < result.uncompensated < width + 2 * per_tick
    ideal = 1 - 1 / CONFIG[dof].free_gain
    assert 0.9 * ideal < result.reduction < 1.02 * ideal
    assert result.uncompensated_estimate == pytest.approx(width, rel=0.1)
    assert result.actuator_gain == pytest.approx(CONFIG[dof].free_gain, rel=1e-6)
    assert result.state_rms < 0.05 * width
    assert result.frames_used > 0.9


def test_your_own_detector_replaces_the_package_detector() -> None:
    """The same features give the same run; without features there is no compensation.

    Of profile ``paper``, which starts without slack and reads no covariance of the features.
    """
    config = CONFIG.replace(profile="paper")
    first = run_experiment(DrawnRig(config), REFERENCE, config)
    found = {
        row["captured_at"]: features
        for row, features in zip(first.frames, per_feature(first.frames, "features"), strict=True)
    }

    def fed(loop: HysteresisReduction, frame: Frame) -> Report:
        features = found[frame.captured_at]
        return loop.on_features(None if np.isnan(features).any() else features, frame.captured_at)

    def blind(loop: HysteresisReduction, frame: Frame) -> Report:
        return loop.on_features(None, frame.captured_at)

    again = run_experiment(DrawnRig(config), REFERENCE, config, look=fed)
    np.testing.assert_allclose(
        per_dof(again.trace, "command"), per_dof(first.trace, "command"), atol=1e-9
    )
    unseen = run_experiment(DrawnRig(config), REFERENCE, config, look=blind)
    np.testing.assert_array_equal(
        per_dof(unseen.trace, "command"), per_dof(unseen.trace, "reference")
    )
    assert set(unseen.frames["status"]) == {"no_markers"}


def test_without_compensation_the_command_is_the_reference(uncompensated: Recording) -> None:
    np.testing.assert_allclose(
        per_dof(uncompensated.trace, "command"), per_dof(uncompensated.trace, "reference")
    )
    assert not uncompensated.compensated


def test_the_loop_never_reads_the_truth(compensated: Recording) -> None:
    blind = run(BlindToTruth(CONFIG))
    np.testing.assert_array_equal(
        per_dof(blind.trace, "command"), per_dof(compensated.trace, "command")
    )
    assert np.isnan(per_dof(blind.trace, "true")).all()
    assert np.isnan(per_dof(blind.frames, "true")).all()
    result = evaluate(blind, blind)[Dof.INSERTION]
    assert np.isnan(result.uncompensated)
    assert np.isfinite(result.compensated_estimate)


def test_the_trace_has_every_tick(compensated: Recording) -> None:
    trace = compensated.trace
    np.testing.assert_allclose(np.diff(trace["time"]), DrawnRig.control_period)
    assert trace["time"][-1] < REFERENCE.duration <= trace["time"][-1] + DrawnRig.control_period
    expected = np.array([REFERENCE(time) for time in trace["time"]])
    np.testing.assert_array_equal(per_dof(trace, "reference"), expected)
    np.testing.assert_array_equal(per_dof(trace, "applied")[1:], per_dof(trace, "command")[:-1])
    assert np.all(per_dof(trace, "delta_minus") <= per_dof(trace, "delta_plus"))


def test_frames_have_the_true_state_at_their_capture_time(compensated: Recording) -> None:
    frames = compensated.frames
    assert np.all(np.diff(frames["sequence"]) == 8)
    rows = np.searchsorted(compensated.trace["time"], frames["captured_at"][:-1] - 1e-9)
    np.testing.assert_allclose(
        per_dof(frames, "true")[:-1], per_dof(compensated.trace, "true")[rows]
    )
    used = frames[frames["status"] == "ok"]
    np.testing.assert_allclose(
        per_feature(used, "features") - per_feature(used, "predicted_features"),
        per_feature(used, "innovation"),
        atol=1e-9,
    )


def test_a_frame_from_before_the_start_is_not_used() -> None:
    frames = run_experiment(SlowCamera(CONFIG), Constant([25e-3, 0, 1.2]), CONFIG).frames
    assert frames["status"].tolist() == ["stale", "ok", "ok", "ok"]
    assert np.isnan(per_dof(frames, "true")[0]).all()
    assert np.isfinite(per_dof(frames, "true")[1:]).all()
    np.testing.assert_allclose(frames["arrived_at"] - frames["captured_at"], 0.05)


@pytest.mark.parametrize(
    "value",
    [[np.nan, 0, 0], [0, np.inf, 0], [0, 0], [[0, 0, 0]], ["a", 0, 0], None],
    ids=str,
)
def test_a_bad_reference_is_named(value: ArrayLike) -> None:
    with pytest.raises(SignalError, match=r"reference: got .*, expected 3 finite numbers") as error:
        run_experiment(DrawnRig(CONFIG), Constant(value), CONFIG)
    assert error.value.field == "reference"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("duration", None),
        ("duration", np.nan),
        ("duration", 0.0),
        ("duration", "3"),
        ("segments", None),
        ("segments", 3),
        ("segments", [(0.0, 1.0)]),
    ],
)
def test_a_reference_without_an_end_moves_no_motor(
    monkeypatch: pytest.MonkeyPatch, name: str, value: object
) -> None:
    rig = DrawnRig(CONFIG)
    monkeypatch.setattr(rig, "reset", lambda: pytest.fail("the motors move"))
    if value is None:
        monkeypatch.delattr(Constant, name)
    else:
        monkeypatch.setattr(Constant, name, value)
    with pytest.raises(SignalError) as error:
        run_experiment(rig, Constant([25e-3, 0, 1.2]), CONFIG)
    assert error.value.field == f"reference.{name}"


def test_a_late_reference_rests_also_where_only_its_call_says_when_it_was_made() -> None:
    """Against a reference that has the attribute from the start."""

    class Late:
        duration, segments = 0.5, ()

        def __call__(self, time: float) -> NDArray[np.float64]:
            self.made_at = time if time < 0.2 else 0.2
            return np.array([25e-3 + 1e-3 * time, 0.0, 1.2])

    class Known(Late):
        made_at = 0.0

    late, known = (run_experiment(DrawnRig(CONFIG), each, CONFIG) for each in (Late(), Known()))
    np.testing.assert_array_equal(per_dof(late.trace, "command"), per_dof(known.trace, "command"))
    assert any(line.startswith("reference_late (") for line in late.warnings)
    after = late.trace["time"] > late.trace["time"][0] + 0.2 + CONFIG.safety.reference_age
    assert np.ptp(late.trace["command_insertion"][after][1:]) == 0.0


@pytest.mark.parametrize("value", ["soon", np.nan, [0.0]])
def test_a_bad_time_of_a_reference_is_named(value: object) -> None:
    reference = Constant([25e-3, 0, 1.2])
    reference.made_at = value  # type: ignore[attr-defined]
    with pytest.raises(SignalError, match=r"reference\.made_at: got .* number of seconds"):
        run_experiment(DrawnRig(CONFIG), reference, CONFIG)


def test_a_camera_of_another_size_is_named() -> None:
    with pytest.raises(FrameError, match=r"720"):
        run(BadFrameRig(CONFIG))


def test_a_stopped_clock_is_named() -> None:
    with pytest.raises(SignalError, match=r"sample\.time: got 0\.0, expected later"):
        run(StoppedClock(CONFIG))


def test_progress_reaches_the_end() -> None:
    reported: list[tuple[float, float]] = []

    class TwoSeconds(Constant):
        duration = 2.0

    run_experiment(
        DrawnRig(CONFIG),
        TwoSeconds([25e-3, 0, 1.2]),
        CONFIG,
        progress=lambda elapsed, duration: reported.append((elapsed, duration)),
    )
    np.testing.assert_allclose(reported, [(1.0, 2.0), (2.0, 2.0)])


class DelayedExecutor(Executor):
    """Runs each task at once; its future is done after `late` calls of `done`."""

    def __init__(self, late: int) -> None:
        self.late = late
        self.tasks = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        self.tasks += 1
        result, left = fn(), self.late

        class DelayedFuture(Future[Any]):
            def done(self) -> bool:
                nonlocal left
                left -= 1
                return left < 0

        future = DelayedFuture()
        future.set_result(result)
        return future


@pytest.mark.parametrize("late", [0, 3, 9])
def test_detection_in_the_background_delays_no_tick(late: int, compensated: Recording) -> None:
    """The run has every tick; a slow detector uses fewer frames, and each later."""
    executor = DelayedExecutor(late)
    found = run_experiment(DrawnRig(CONFIG), REFERENCE, CONFIG, executor=executor)
    np.testing.assert_array_equal(found.trace["time"], compensated.trace["time"])
    assert executor.tasks >= len(found.frames) > 0
    assert (np.diff(found.frames["captured_at"]) > 0).all()
    assert set(found.frames["captured_at"]) <= set(compensated.frames["captured_at"])
    waited = found.frames["arrived_at"] - found.frames["captured_at"]
    assert waited.min() >= (late + 1) * DrawnRig.control_period - 1e-9
    assert evaluate(found, found)[Dof.INSERTION].frames_used > 0.9
