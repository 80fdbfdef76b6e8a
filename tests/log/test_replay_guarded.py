"""A replay is identical also where the guards acted, and where images were looked at aside."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import DrawnRig
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log.reader import Log, Told, read_log
from tautscope.log.replay import _tell, listen_to_log, replay_same
from tautscope.log.writer import LogWriter
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording, per_dof

SECONDS = 7.0
SILENT_FROM = 6.6
PAUSE = 0.2
"""A stall [s], beyond `safety.stall`."""


class Troubled(DrawnRig):
    """One thing after the other is wrong with its camera, then its clock."""

    def step(self, command: ArrayLike) -> Sample:
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


class Jumping(SineSequence):
    """A hand that lets go, and takes hold elsewhere; in the end it is silent."""

    made_at = 0.0

    def __call__(self, time: float) -> NDArray[np.float64]:
        self.made_at = time if time < SILENT_FROM else SILENT_FROM
        return super().__call__(time) + (0.01 if time > 4.5 else 0.0)


def flags(run: Recording) -> set[str]:
    """The names at the beginning of what is told."""
    return {line.partition(" ")[0] for line in run.warnings}


TOLD = {
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
"""When [s] the loop is told what, by whom: before or after an image update, or by the rig."""


class Telling(DrawnRig):
    """Tells the loop while a command is under way."""

    loop: HysteresisReduction | None = None

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.waiting = dict(TOLD)

    def step(self, command: ArrayLike) -> Sample:
        sample = super().step(command)
        self.tell(sample.time, "step")
        return sample

    def look(self, loop: HysteresisReduction, frame: Frame) -> Report:
        self.loop = loop
        self.tell(frame.captured_at, "before")
        report = loop.on_frame(frame)
        self.tell(frame.captured_at, "after")
        return report

    def tell(self, now: float, place: str) -> None:
        due = [at for at, (where, _) in self.waiting.items() if where == place and at <= now]
        for at in due:
            request, _, name = self.waiting.pop(at)[1].partition(" ")
            assert self.loop is not None
            getattr(self.loop, request)(*name.split())


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_a_replay_is_told_what_the_loop_was_told(
    tmp_path: Path, config: Config, profile: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = config.replace(profile=profile)
    reference = SineSequence(config.experiment)
    reference.duration = 3.0
    path, rig = tmp_path / "run.mcap", Telling(config)
    with LogWriter(path, config, wait=True) as log:
        run = run_experiment(rig, reference, config, look=rig.look, log=log)
    assert not rig.waiting
    assert flags(run) >= {"following_error"}
    found, again = replay_same(written := read_log(path))
    assert found.first_difference == found.ended == ""
    assert found.same_ticks == found.ticks == len(run.trace)
    assert found.same_updates == found.updates == len(run.frames)
    for name in run.trace.dtype.names or ():
        np.testing.assert_array_equal(again.trace[name], run.trace[name], err_msg=name)
    told = [event.what for event in written.events.values() if isinstance(event, Told)]
    assert sorted(told) == sorted(what for _, what in TOLD.values())
    effects = [untold(written, skip, monkeypatch) for skip in range(len(told))]
    assert all(effects), list(zip(told, effects, strict=True))
    listened = listen_to_log(written, config)
    assert len(listened.recording.trace) == len(run.trace)


def untold(log: Log, skip: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """The first difference where the loop is not told one thing of all."""
    told: list[str] = []

    def tell(loop: HysteresisReduction, what: str) -> None:
        told.append(what)
        if len(told) - 1 != skip:
            _tell(loop, what)

    with monkeypatch.context() as patch:
        patch.setattr("tautscope.log.replay._tell", tell)
        return replay_same(log)[0].first_difference


def test_an_event_nobody_knows_is_refused(tmp_path: Path, config: Config) -> None:
    with LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, np.zeros(3)), np.zeros(3), np.zeros(3))
        log.event(0.0, "__init__")
    with pytest.raises(RecordError, match="__init__"):
        replay_same(read_log(tmp_path / "run.mcap"))


NOTICED = {"dropped", "late", "clock", "reference_jump", "late_tick", "reference_late"}


@pytest.mark.parametrize("profile", ["paper", "best"])
@pytest.mark.parametrize("is_aside", [False, True], ids=["ahead", "aside"])
def test_a_replay_is_identical_where_guards_acted(
    tmp_path: Path, config: Config, profile: str, *, is_aside: bool
) -> None:
    config = config.replace(profile=profile)
    reference = Jumping(config.experiment)
    reference.duration = SECONDS
    path = tmp_path / "run.mcap"
    with ThreadPoolExecutor(1) as eyes, LogWriter(path, config, wait=True) as log:
        aside = eyes if is_aside else None
        run = run_experiment(Troubled(config), reference, config, log=log, executor=aside)
    if not is_aside:  # which frames are seen aside is a matter of time
        assert flags(run) >= NOTICED
    assert flags(run) >= {"reference_jump", "reference_late"}
    silent = run.trace["time"] - PAUSE > SILENT_FROM + config.safety.reference_age
    assert np.ptp(per_dof(run.trace[silent], "command"), axis=0).max() == 0.0
    found, again = replay_same(read_log(path))
    assert found.first_difference == found.ended == ""
    assert found.same_ticks == found.ticks == len(run.trace)
    assert found.same_updates == found.updates == len(run.frames)
    for name in run.trace.dtype.names or ():
        np.testing.assert_array_equal(again.trace[name], run.trace[name], err_msg=name)
