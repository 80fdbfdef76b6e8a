"""Replay of runs with supervisor actions and with images processed in the background."""

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from time import sleep

import numpy as np
import pytest
from drawn import DrawnRig
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log.reader import Log, Request, read_log
from tautscope.log.replay import _send_request, estimate_from_log, replay_same
from tautscope.log.writer import LogWriter
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording, per_dof

SECONDS = 7.0
SILENT_FROM = 6.6
PAUSE = 0.2
"""Length of a stall [s], above `safety.stall`."""


class FaultyCameraRig(DrawnRig):
    """A rig with several faults of the camera, one after the other, then of the clock."""

    tick_time = 0.0
    """Least time that a tick takes on the clock of the computer [s]."""

    def step(self, command: ArrayLike) -> Sample:
        sleep(self.tick_time)
        sample = super().step(command)
        time, frame = sample.time, sample.frame
        if frame is not None:
            if 0.8 < time < 1.4:
                frame = None
            elif 2.0 < time < 2.4:
                frame = replace(frame, captured_at=time - 0.5)
            elif 2.8 < time < 3.0:
                frame = replace(frame, captured_at=time + 100.0)
            elif 3.4 < time < 3.8:
                frame = replace(frame, image=np.ascontiguousarray(frame.image[::-1]))
        late = PAUSE if time > 5.5 else 0.0
        if frame is not None:
            frame = replace(frame, captured_at=frame.captured_at + late)
        return replace(sample, time=time + late, frame=frame)


class JumpingReference(SineSequence):
    """A reference that jumps, and is not updated any more at the end."""

    made_at = 0.0

    def __call__(self, time: float) -> NDArray[np.float64]:
        self.made_at = time if time < SILENT_FROM else SILENT_FROM
        return super().__call__(time) + (0.01 if time > 4.5 else 0.0)


def flags(run: Recording) -> set[str]:
    """Names of the flags in the warnings."""
    return {line.partition(" ")[0] for line in run.warnings}


def assert_replays_identically(log: Log, run: Recording) -> None:
    found, again = replay_same(log)
    assert found.first_difference == found.ended == ""
    assert found.same_ticks == found.ticks == len(run.trace)
    assert found.same_updates == found.updates == len(run.frames)
    for name in run.trace.dtype.names or ():
        np.testing.assert_array_equal(again.trace[name], run.trace[name], err_msg=name)


REQUESTS = {
    0.5: ("before", "raise_flag following_error"),
    0.9: ("before", "engage"),
    1.2: ("step", "raise_flag start_check"),
    1.5: ("step", "raise_flag drive_fault"),
    1.6: ("step", "acknowledge"),
    1.7: ("after", "engage"),
    1.9: ("before", "raise_flag reference_jump"),
    2.1: ("after", "engage"),
    2.4: ("after", "raise_flag following_error"),
}
"""Time [s] -> when the request is made (before or after an image update, or in a step), request."""


class RequestingRig(DrawnRig):
    """A rig that sends requests to the loop."""

    loop: HysteresisReduction | None = None

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.waiting = dict(REQUESTS)

    def step(self, command: ArrayLike) -> Sample:
        sample = super().step(command)
        self.send_due(sample.time, "step")
        return sample

    def process_frame(self, loop: HysteresisReduction, frame: Frame) -> Report:
        self.loop = loop
        self.send_due(frame.captured_at, "before")
        report = loop.on_frame(frame)
        self.send_due(frame.captured_at, "after")
        return report

    def send_due(self, now: float, place: str) -> None:
        due = [at for at, (where, _) in self.waiting.items() if where == place and at <= now]
        for at in due:
            request, _, name = self.waiting.pop(at)[1].partition(" ")
            assert self.loop is not None
            getattr(self.loop, request)(*name.split())


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_a_replay_repeats_the_requests_to_the_loop(
    tmp_path: Path, config: Config, profile: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = config.replace(profile=profile)
    reference = SineSequence(config.experiment)
    reference.duration = 3.0
    path, rig = tmp_path / "run.mcap", RequestingRig(config)
    with LogWriter(path, config, wait=True) as log:
        run = run_experiment(rig, reference, config, look=rig.process_frame, log=log)
    assert not rig.waiting
    assert flags(run) >= {"following_error"}
    written = read_log(path)
    assert_replays_identically(written, run)
    requests = [event.text for event in written.events.values() if isinstance(event, Request)]
    assert sorted(requests) == sorted(request for _, request in REQUESTS.values())
    effects = {
        (skip, request): first_difference_without(written, skip, monkeypatch)
        for skip, request in enumerate(requests)
    }
    # An acknowledgement changes the list of warnings alone.
    assert all(bool(found) == (what != "acknowledge") for (_, what), found in effects.items()), (
        effects
    )
    estimated, _ = estimate_from_log(written, config)
    assert len(estimated.trace) == len(run.trace)


def first_difference_without(log: Log, skip: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """The first difference of a replay without one of the requests."""
    requests: list[str] = []

    def send(loop: HysteresisReduction, request: str) -> None:
        requests.append(request)
        if len(requests) - 1 != skip:
            _send_request(loop, request)

    with monkeypatch.context() as patch:
        patch.setattr("tautscope.log.replay._send_request", send)
        return replay_same(log)[0].first_difference


def test_an_unknown_request_is_rejected(tmp_path: Path, config: Config) -> None:
    with LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, np.zeros(3)), np.zeros(3), np.zeros(3))
        log.event(0.0, "__init__")
    with pytest.raises(RecordError, match="__init__"):
        replay_same(read_log(tmp_path / "run.mcap"))


EXPECTED_FLAGS = {"dropped", "late", "clock", "reference_jump", "late_tick", "reference_late"}


@pytest.mark.parametrize("profile", ["paper", "best"])
@pytest.mark.parametrize("is_background", [False, True], ids=["ahead", "background"])
def test_a_replay_is_identical_where_the_supervisor_acted(
    tmp_path: Path, config: Config, profile: str, *, is_background: bool
) -> None:
    config = config.replace(profile=profile)
    reference = JumpingReference(config.experiment)
    reference.duration = SECONDS
    path = tmp_path / "run.mcap"
    rig = FaultyCameraRig(config)
    rig.tick_time = 0.004 if is_background else 0.0
    with ThreadPoolExecutor(1) as executor, LogWriter(path, config, wait=True) as log:
        aside = executor if is_background else None
        run = run_experiment(
            rig,
            reference,
            config,
            log=log,
            executor=aside,
            engage=lambda supervision: False,
        )
    if not is_background:  # which frames are processed in the background depends on timing
        assert flags(run) >= EXPECTED_FLAGS
    assert flags(run) >= {"reference_jump", "reference_late"}
    silent = run.trace["time"] - PAUSE > SILENT_FROM + config.safety.reference_age
    assert np.ptp(per_dof(run.trace[silent], "command"), axis=0).max() == 0.0
    assert_replays_identically(read_log(path), run)


class LateDetection(Future):
    """The result of a detection, at hand when it was asked for a number of times."""

    def __init__(self, detect: Callable[[], object], asked: int) -> None:
        super().__init__()
        self._left = asked
        self.set_result(detect())

    def done(self) -> bool:
        self._left -= 1
        return self._left < 0


class LateExecutor(Executor):
    """Detections that last longer and longer, as counted in control ticks."""

    def __init__(self, most: int) -> None:
        self._most, self._submitted = most, 0

    def submit(self, detect: Callable[[], object]) -> LateDetection:  # type: ignore[override]
        self._submitted += 1
        return LateDetection(detect, 60 * self._submitted % self._most)


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_a_replay_prepares_a_detection_when_the_run_did(
    tmp_path: Path, config: Config, profile: str
) -> None:
    config = config.replace(profile=profile)
    history = round(config.control.history / config.control.period)
    reference = SineSequence(config.experiment)
    reference.duration = SECONDS
    path = tmp_path / "run.mcap"
    with LogWriter(path, config, wait=True) as log:
        executor = LateExecutor(2 * history)
        run = run_experiment(DrawnRig(config), reference, config, log=log, executor=executor)
    assert len(run.frames) > 2
    assert_replays_identically(read_log(path), run)
