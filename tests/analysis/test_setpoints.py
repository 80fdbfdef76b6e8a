"""The motion behind commands that are logged in steps."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from play_model import play
from tautscope.analysis.compensator import speed_of
from tautscope.analysis.models.task import Floats
from tautscope.analysis.setpoints import held_for, ramped
from tautscope.analysis.verdict import judge
from tautscope.runs.records import Cleaning, Record
from test_findings import judged

TIME = np.arange(0, 60, 0.01)


def motion(time: Floats) -> Floats:
    return np.asarray(6 * np.sin(0.691 * time) + 4 * np.sin(1.087 * time + 1))


FASTEST = np.abs(np.gradient(motion(TIME), 0.01)).max()
FINE = np.arange(0, 40, 0.001)
COUNT = 360 / 4096
LOGS = {
    "smooth": (TIME, motion(TIME)),
    "setpoints": (TIME, motion(np.floor(2 * TIME) / 2)),
    "counts": (FINE, COUNT * np.round(motion(FINE) / COUNT)),
    "jitter": (np.sort(TIME + np.random.default_rng(1).normal(0, 4e-3, 6000)), motion(TIME)),
    "bursts": (0.05 * (np.arange(6000) // 5) + 2e-4 * (np.arange(6000) % 5), motion(TIME)),
}


def record_of(time: Floats, command: Floats, measured: Floats | None = None) -> Record:
    tip = command if measured is None else measured
    return Record(command, tip, time, np.arange(len(time)), Cleaning())


@pytest.mark.parametrize("kind", LOGS)
def test_the_speed_is_that_of_the_motion_and_not_of_its_steps(kind: str) -> None:
    time, command = LOGS[kind]
    found = replace(judged("play", 3).found, stroke=3.5)
    speed = speed_of(record_of(time, command), found)
    assert speed == pytest.approx(FASTEST, rel=0.1)


def test_setpoints_are_told_from_counts_and_smooth_motion() -> None:
    held = {kind: held_for(record_of(*log)) for kind, log in LOGS.items()}
    assert held.pop("setpoints") == pytest.approx(0.5)
    assert set(held.values()) == {0.0}


def test_a_ramp_between_setpoints_rests_where_the_command_rests() -> None:
    command = motion(np.floor(2 * np.minimum(TIME, 30)) / 2)
    command[-1] = command[-2] + 1
    smooth = ramped(record_of(TIME, command))
    moving = TIME < 29.5
    assert np.abs(smooth - motion(TIME))[moving].max() < 0.3
    assert np.ptp(smooth[(TIME > 31) & (TIME < 59)]) == 0


def test_a_loop_is_not_blamed_for_held_setpoints(caplog: pytest.LogCaptureFixture) -> None:
    """The motor follows each setpoint within 50 ms."""
    time, command = LOGS["setpoints"]
    motor = np.empty_like(command)
    position = command[0]
    for k, setpoint in enumerate(command.tolist()):
        position += 0.18 * (setpoint - position)
        motor[k] = position
    tip = 0.8 * play(motor, -1.5, 1.5) + np.random.default_rng(4).normal(0, 0.05, len(time))
    with caplog.at_level(logging.WARNING):
        verdict = judge(record_of(time, command, tip))
    assert not caplog.records
    assert verdict.helps
    assert "command: it is setpoints, each held for 0.5 s" in verdict.text
    held = replace(verdict, compensation=replace(verdict.compensation, held="after 1 s: why"))
    assert not held.helps
    assert "is not known: simulated with this record's motion it stopped after 1 s" in held.text
