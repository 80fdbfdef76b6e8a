"""A replay is identical also where the guards acted, and where images were looked at aside."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import DrawnRig
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config
from tautscope.experiment import run_experiment
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.log.writer import LogWriter
from tautscope.recording import Recording, per_dof
from tautscope.references import SineSequence
from tautscope.rig import Sample

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
        run = run_experiment(Troubled(config), reference, config, log=log, aside=aside)
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
