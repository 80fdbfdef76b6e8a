"""Replay of logs, and estimates with other configurations, videos and motor positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import BACKLASH
from recorded import record
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log.reader import Log, Tick, Update, read_log
from tautscope.log.replay import estimate_from_log, estimate_from_video, replay_same
from tautscope.log.writer import LogSummary
from tautscope.loop.rig import Frame
from tautscope.replay import read_motors
from tautscope.runs.recording import Recording, per_dof

Recorded = tuple[Path, Recording, LogSummary]


def test_a_replay_is_identical(recorded: Recorded) -> None:
    path, recording, _ = recorded
    found, again = replay_same(read_log(path))
    assert found.is_identical
    assert found.same_ticks == found.ticks == len(recording.trace)
    assert found.same_updates == found.updates == len(recording.frames)
    assert found.ended == ""
    for name in recording.trace.dtype.names or ():
        np.testing.assert_array_equal(again.trace[name], recording.trace[name], err_msg=name)


@pytest.mark.parametrize(
    ("profile", "shares"),
    [
        ("paper", (1e-9, 1e-9, 1e-9)),
        ("best", (0.02, 0.1, 0.02)),
    ],
)
def test_estimates_with_the_same_configuration_are_the_same(
    tmp_path: Path, config: Config, profile: str, shares: tuple[float, ...]
) -> None:
    """Profile best has the travel of its random walks and the tremor from the reference, which the
    estimation lacks. Nothing shows the width of rotation while insertion moves alone: it drifts by
    chance."""
    config = config.replace(profile=profile)
    recording, _ = record(tmp_path / "run.mcap", config, 6.0)
    replayed, _ = estimate_from_log(read_log(tmp_path / "run.mcap"), config)
    for group in ("estimate", "delta_minus", "delta_plus"):
        difference = per_dof(replayed.trace, group) - per_dof(recording.trace, group)
        largest = np.nanmax(np.abs(difference) / BACKLASH, axis=0)
        assert (largest < shares).all(), f"{group}: {largest}"
    np.testing.assert_array_equal(
        per_dof(replayed.trace, "command"), per_dof(recording.trace, "command")
    )


def test_another_configuration_estimates_something_else(recorded: Recorded) -> None:
    path, recording, _ = recorded
    log = read_log(path)
    slow = log.config.replace(**{"insertion.smoothing_factor": 0.001})
    replayed, _ = estimate_from_log(log, slow)
    wide = per_dof(recording.trace, "delta_plus")[-1] - per_dof(recording.trace, "delta_minus")[-1]
    less = per_dof(replayed.trace, "delta_plus")[-1] - per_dof(replayed.trace, "delta_minus")[-1]
    assert less[0] < 0.5 * wide[0]
    assert replayed.config == slow


def test_a_changed_input_is_found(recorded: Recorded) -> None:
    log = read_log(recorded[0])
    tick = log.events[3]
    log.events[3] = replace(tick, reference=np.nextafter(tick.reference, 1))
    found, _ = replay_same(log)
    assert not found.is_identical
    assert found.first_difference.startswith("tick at 0.0")
    assert "/instrument/servo_jp" in found.first_difference
    assert found.same_ticks < found.ticks


def test_the_order_of_ticks_and_images_matters_and_is_kept(recorded: Recorded) -> None:
    log = read_log(recorded[0])
    where = next(
        index for index, event in log.events.items() if isinstance(event, Update) and index > 20
    )
    later = log.events[where + 1]
    assert not isinstance(later, Update)
    kinds = [isinstance(event, Update) for event in log.events.values()]
    assert list(log.events) == list(range(1, len(kinds) + 1))
    assert kinds[:2] == [False, True]  # the first sample has a frame; its tick comes first


def test_a_gap_ends_the_comparison(recorded: Recorded) -> None:
    log = read_log(recorded[0])
    del log.events[100]
    found, _ = replay_same(log)
    assert found.is_identical
    assert found.ticks + found.updates == 99
    ticks = [log.events[index] for index in range(1, 100) if isinstance(log.events[index], Tick)]
    after = f"after the tick at {ticks[-1].sample.time:g} s"
    missing = f"a tick, update or request is not in the log (entry 100 of {max(log.events)})"
    assert found.ended == f"{after}, {missing}"
    del log.events[1]
    with pytest.raises(RecordError, match=r"log: got 'at the start, a tick, update or request is"):
        replay_same(log)


def test_jpeg_is_not_identical_but_close(tmp_path: Path, config: Config) -> None:
    lossy = config.replace(**{"recording.image_format": "jpeg"})
    recording, summary = record(tmp_path / "run.mcap", lossy, 4.0)
    assert summary.is_complete
    found, again = replay_same(read_log(tmp_path / "run.mcap"))
    assert not found.is_identical
    used = recording.frames["status"] == "ok"
    assert (again.frames["status"][used] == "ok").mean() > 0.9
    both = used & (again.frames["status"] == "ok")
    first, second = (per_dof(run.frames, "estimate")[both] for run in (recording, again))
    difference = second - first
    assert np.abs(difference).max(axis=0) == pytest.approx(0, abs=0.2)


def frames_of(log: Log) -> list[Frame]:
    return [
        Frame(log.image(index), float(event.row[0]), int(event.row[2]))
        for index, event in log.events.items()
        if isinstance(event, Update)
    ]


def test_estimates_from_video_and_motor_positions(recorded: Recorded, tmp_path: Path) -> None:
    """The frames of a run and its commands as a table give the estimates of the run."""
    path, recording, _ = recorded
    log = read_log(path)
    frames = frames_of(log)
    table = tmp_path / "motors.csv"
    lines = ["bending,time, insertion,rotation"]
    for time, (insertion, rotation, bending) in zip(
        recording.trace["time"], per_dof(recording.trace, "command"), strict=True
    ):
        lines.append(f"{bending!r},{time!r},{insertion!r},{rotation!r}".replace("np.float64", ""))
    table.write_text("\n".join(lines).replace("(", "").replace(")", "") + "\n")
    replayed = estimate_from_video(frames, *read_motors(table), log.config)
    kept = slice(0, len(replayed.frames))
    np.testing.assert_allclose(
        per_dof(replayed.frames, "estimate"), per_dof(recording.frames, "estimate")[kept], atol=1e-9
    )
    assert len(replayed.frames) >= len(frames) - 1
    assert len(replayed.trace) == len(recording.trace)


def test_sparse_motor_positions_are_not_taken_for_a_held_reference(
    recorded: Recorded, tmp_path: Path
) -> None:
    path, recording, _ = recorded
    log, commands = read_log(path), per_dof(recording.trace, "command")
    held = commands[np.arange(len(commands)) // 10 * 10]
    names = "time,insertion,rotation,bending"
    rows = np.column_stack([recording.trace["time"], held])
    table = tmp_path / "motors.csv"
    np.savetxt(table, rows, "%.17g", delimiter=",", header=names, comments="")
    replayed = estimate_from_video(frames_of(log), *read_motors(table), log.config)
    predicted = per_dof(replayed.frames, "predicted")
    error = np.abs(predicted - per_dof(recording.frames, "predicted")[: len(predicted)])
    assert (error.max(axis=0) <= 1.5 * np.abs(held - commands).max(axis=0) + 1e-9).all()
