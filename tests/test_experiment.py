"""The loop on a rig that is not the twin: three plays and a drawn picture."""

from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn import SLACK, BadFrameRig, DrawnRig, short_experiment
from numpy.typing import ArrayLike, NDArray
from tautscope.dof import Dof
from tautscope.errors import (
    FrameError,
    MissingPathError,
    OutputError,
    RecordError,
    SignalError,
)
from tautscope.experiment import run_experiment
from tautscope.recording import Recording, Table, per_dof, per_feature
from tautscope.reduction import HysteresisReduction, Report
from tautscope.references import SineSequence
from tautscope.results import DofResult, combine, evaluate
from tautscope.rig import Frame, Rig, Sample
from tautscope.trials import Trial, run_trials

CONFIG = short_experiment()
REFERENCE = SineSequence(CONFIG.experiment)


class Constant:
    """Holds still for a moment; `value` may be anything."""

    duration = 0.3
    segments = ()

    def __init__(self, value: ArrayLike) -> None:
        self.value = value

    def __call__(self, time: float) -> NDArray[np.float64]:
        return self.value  # type: ignore[return-value]


class BlindToTruth(DrawnRig):
    """As hardware: nobody knows where the tip is."""

    def _sample(self, applied: NDArray[np.float64]) -> Sample:
        return replace(super()._sample(applied), true_state=None)


class SlowCamera(DrawnRig):
    """Its images are 0.05 s old, the first from before the start."""

    def _sample(self, applied: NDArray[np.float64]) -> Sample:
        sample = super()._sample(applied)
        if sample.frame is None:
            return sample
        return replace(sample, frame=replace(sample.frame, captured_at=sample.time - 0.05))


class StandingClock(DrawnRig):
    def step(self, command: ArrayLike) -> Sample:
        return replace(super().step(command), time=0.0)


def assert_same(table: Table, other: Table) -> None:
    assert table.dtype == other.dtype
    for name in table.dtype.names or ():
        np.testing.assert_array_equal(table[name], other[name], err_msg=name)


def run(rig: Rig, compensate: bool = True) -> Recording:
    return run_experiment(rig, REFERENCE, CONFIG, compensate)


@pytest.fixture(scope="module")
def compensated() -> Recording:
    return run(DrawnRig(CONFIG))


@pytest.fixture(scope="module")
def uncompensated() -> Recording:
    return run(DrawnRig(CONFIG), compensate=False)


def test_a_rig_of_forty_lines_is_a_rig() -> None:
    assert isinstance(DrawnRig(CONFIG), Rig)


@pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)
def test_the_slack_goes_down_to_what_the_gain_leaves(
    uncompensated: Recording, compensated: Recording, dof: Dof
) -> None:
    result = evaluate(uncompensated, compensated)[dof]
    slack = SLACK[dof]
    sine = CONFIG.experiment[dof]
    per_tick = 2 * np.pi * sine.amplitude / sine.period * DrawnRig.control_period
    # The rig's tip is where the command of the tick before has put it.
    assert slack < result.uncompensated < slack + 2 * per_tick
    ideal = 1 - 1 / CONFIG[dof].free_gain
    assert 0.9 * ideal < result.reduction < 1.02 * ideal
    assert result.uncompensated_estimate == pytest.approx(slack, rel=0.1)
    assert result.actuator_gain == pytest.approx(CONFIG[dof].free_gain, rel=1e-6)
    assert result.state_rms < 0.05 * slack
    assert result.frames_used > 0.9


def test_a_detector_of_ones_own_takes_the_place_of_ours(compensated: Recording) -> None:
    """The features that ours found, fed in from outside, give the same run; none give another."""
    found = {
        row["captured_at"]: features
        for row, features in zip(
            compensated.frames, per_feature(compensated.frames, "features"), strict=True
        )
    }

    def fed(loop: HysteresisReduction, frame: Frame) -> Report:
        features = found[frame.captured_at]
        return loop.on_features(None if np.isnan(features).any() else features, frame.captured_at)

    def blind(loop: HysteresisReduction, frame: Frame) -> Report:
        return loop.on_features(None, frame.captured_at)

    again = run_experiment(DrawnRig(CONFIG), REFERENCE, CONFIG, look=fed)
    np.testing.assert_allclose(
        per_dof(again.trace, "command"), per_dof(compensated.trace, "command"), atol=1e-9
    )
    unseen = run_experiment(DrawnRig(CONFIG), REFERENCE, CONFIG, look=blind)
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


def test_frames_carry_the_truth_at_their_capture_time(compensated: Recording) -> None:
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


def test_the_snapshot_is_from_the_middle(compensated: Recording) -> None:
    snapshot = compensated.snapshot
    assert snapshot is not None
    assert REFERENCE.duration / 2 - 1 < snapshot.captured_at < REFERENCE.duration / 2 + 2
    assert snapshot.image.shape == (CONFIG.camera.height, CONFIG.camera.width, 3)
    assert np.isfinite(snapshot.features).all()


def test_a_recording_reads_back_equal(compensated: Recording, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    compensated.save(folder)
    names = {path.name for path in folder.iterdir()}
    assert names == {"trace.csv", "frames.csv", "recording.toml", "config.toml"}
    again = Recording.load(folder)
    assert_same(again.trace, compensated.trace)
    assert_same(again.frames, compensated.frames)
    assert again.config == compensated.config
    assert again.segments == compensated.segments
    assert again.compensated


def test_a_folder_in_use_is_left_alone(compensated: Recording, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"out: got '.*', expected a folder that is empty"):
        compensated.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_failed_save_leaves_nothing(
    compensated: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> str:
        raise OSError("disk full")

    monkeypatch.setattr("tautscope.recording.dump_config", full)
    with pytest.raises(OSError, match="disk full"):
        compensated.save(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_recording_is_named(compensated: Recording, tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match=r"recording\.toml"):
        Recording.load(tmp_path)
    folder = tmp_path / "run"
    compensated.save(folder)
    trace = folder / "trace.csv"
    whole = trace.read_text()
    trace.write_text(whole.replace("reference_insertion", "u", 1))
    with pytest.raises(RecordError, match=r"trace\.csv.*expected the columns time"):
        Recording.load(folder)
    trace.write_text(whole[: len(whole) // 2].rsplit(",", 3)[0])
    with pytest.raises(RecordError, match=r"trace\.csv"):
        Recording.load(folder)


@pytest.mark.parametrize(
    "value",
    [[np.nan, 0, 0], [0, np.inf, 0], [0, 0], [[0, 0, 0]], ["a", 0, 0], None],
    ids=str,
)
def test_a_bad_reference_is_named(value: ArrayLike) -> None:
    with pytest.raises(SignalError, match=r"reference: got .*, expected 3 finite numbers") as error:
        run_experiment(DrawnRig(CONFIG), Constant(value), CONFIG)
    assert error.value.field == "reference"


def test_a_camera_of_another_size_is_named() -> None:
    with pytest.raises(FrameError, match=r"720"):
        run(BadFrameRig(CONFIG))


def test_a_clock_that_stands_still_is_named() -> None:
    with pytest.raises(SignalError, match=r"sample\.time: got 0\.0, expected later"):
        run(StandingClock(CONFIG))


def test_progress_reaches_the_end() -> None:
    told: list[tuple[float, float]] = []

    class TwoSeconds(Constant):
        duration = 2.0

    run_experiment(
        DrawnRig(CONFIG),
        TwoSeconds([25e-3, 0, 1.2]),
        CONFIG,
        progress=lambda elapsed, duration: told.append((elapsed, duration)),
    )
    np.testing.assert_allclose(told, [(1.0, 2.0), (2.0, 2.0)])


def test_runs_in_processes_are_the_same_runs(
    uncompensated: Recording, compensated: Recording
) -> None:
    shares: list[float] = []
    trials = [Trial(CONFIG, False), Trial(CONFIG, True)]
    first, second = run_trials(trials, shares.append, DrawnRig, workers=2)
    assert_same(first.trace, uncompensated.trace)
    assert_same(second.trace, compensated.trace)
    assert shares == sorted(shares)


def test_an_error_in_a_process_arrives_with_its_facts() -> None:
    with pytest.raises(FrameError) as error:
        run_trials([Trial(CONFIG, True)] * 2, lambda share: None, BadFrameRig, workers=2)
    assert error.value.allowed


def test_medians_and_worst_leave_out_what_is_not_known() -> None:
    def result(value: float) -> dict[Dof, DofResult]:
        return {Dof.BENDING: DofResult(*[value] * len(DofResult.__dataclass_fields__))}

    results = [result(1.0), result(np.nan), result(5.0), result(2.0)]
    assert combine(results, "median")[Dof.BENDING].reduction == 2.0
    ends = dict.fromkeys(DofResult.__dataclass_fields__, "max") | {"reduction": "min"}
    assert combine(results, ends)[Dof.BENDING].reduction == 1.0
    assert combine(results, ends)[Dof.BENDING].state_rms == 5.0
    assert np.isnan(combine([result(np.nan)], "median")[Dof.BENDING].state_rms)


class Answering(Executor):
    """Runs what it is asked at once, or `late` calls of `done` later."""

    def __init__(self, late: int) -> None:
        self.late = late
        self.asked = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        self.asked += 1
        answer, left = fn(), self.late

        class Later(Future[Any]):
            def done(self) -> bool:
                nonlocal left
                left -= 1
                return left < 0

        later = Later()
        later.set_result(answer)
        return later


@pytest.mark.parametrize("late", [0, 3, 9])
def test_images_looked_at_aside_hold_up_no_tick(late: int, compensated: Recording) -> None:
    """Every tick is made; with slow eyes fewer frames are seen, each later and as it would be."""
    eyes = Answering(late)
    aside = run_experiment(DrawnRig(CONFIG), REFERENCE, CONFIG, aside=eyes)
    np.testing.assert_array_equal(aside.trace["time"], compensated.trace["time"])
    assert eyes.asked >= len(aside.frames) > 0
    assert (np.diff(aside.frames["captured_at"]) > 0).all()
    assert set(aside.frames["captured_at"]) <= set(compensated.frames["captured_at"])
    waited = aside.frames["arrived_at"] - aside.frames["captured_at"]
    assert waited.min() >= (late + 1) * DrawnRig.control_period - 1e-9
    assert evaluate(aside, aside)[Dof.INSERTION].frames_used > 0.9
