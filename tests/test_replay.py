"""The estimator on records: causal, better than no model, clear about bad files."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from play_model import play
from tautscope import replay
from tautscope._core import Estimator
from tautscope.errors import MissingPathError, RecordError, SignalError

WIDTH = 10.0


def estimator() -> Estimator:
    return Estimator(
        update_distance=0.3,
        contact_tolerance=0.4,
        smoothing_factor=0.25,
        delta_minus=0.0,
        delta_plus=0.0,
    )


def record(seed: int, noise: float = 0.05) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 60, 3000))  # uneven sampling
    command = 15 * np.sin(2 * np.pi * time / 10) + 4 * np.sin(2 * np.pi * time / 3.7)
    return command, play(command, -4.0, WIDTH - 4.0) + rng.normal(0, noise, len(time))


@pytest.mark.parametrize("seed", range(3))
def test_it_learns_a_play_and_beats_no_model(seed: int) -> None:
    command, measured = record(seed)
    predicted, delta_minus, delta_plus = replay.predict_tip(command, measured, estimator())
    assert delta_plus[-1] - delta_minus[-1] == pytest.approx(WIDTH, rel=0.05), f"seed {seed}"
    late = slice(len(command) // 2, None)
    error = np.sqrt(np.mean((predicted - measured)[late] ** 2))
    no_model = np.std((command - measured)[late])
    assert error < 0.1 * no_model, f"seed {seed}"


@pytest.mark.parametrize("at", [1, 700, 2999])
def test_a_prediction_knows_nothing_of_its_own_time_or_later(at: int) -> None:
    command, measured = record(0)
    predicted, minus, plus = replay.predict_tip(command, measured, estimator())
    other = measured.copy()
    other[at:] += 7.0
    again, other_minus, other_plus = replay.predict_tip(command, other, estimator())
    np.testing.assert_array_equal(again[: at + 1], predicted[: at + 1])
    np.testing.assert_array_equal(other_minus[:at], minus[:at])
    np.testing.assert_array_equal(other_plus[:at], plus[:at])
    shorter = replay.predict_tip(command[:at], measured[:at], estimator())[0]
    np.testing.assert_array_equal(shorter, predicted[:at])


def test_signals_are_checked() -> None:
    with pytest.raises(SignalError, match=r"measured\[1\]: got nan"):
        replay.predict_tip([0, 1], [0, np.nan], estimator())
    with pytest.raises(SignalError, match="measured: got '3 samples', expected as many"):
        replay.predict_tip([0, 1], [0, 1, 2], estimator())
    with pytest.raises(SignalError, match="command: got"):
        replay.predict_tip([[0, 1]], [0, 1], estimator())


def test_a_file_is_read_by_column_name(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("﻿t, motor ,tip\n0,1,2\n\n0.1,,3\n0.3,3,nan\n0.7,4,5\n", encoding="utf-8")
    found = replay.read_record(file, "motor", "tip", "t")
    np.testing.assert_array_equal(found.command, [1, 4])
    np.testing.assert_array_equal(found.measured, [2, 5])
    assert found.time is not None
    np.testing.assert_array_equal(found.time, [0, 0.7])
    np.testing.assert_array_equal(found.rows, [2, 6])
    assert found.dropped == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3,x\n", r"log\.csv, line 3, column b: got 'x', expected a finite number"),
        ("a,b\n1,2\n3,inf\n", r"line 3, column b: got 'inf'"),
        ("a,c\n1,2\n", r"log\.csv: b: got 'no such column', expected one of a, c"),
        ("a,b,b\n1,2,3\n", r"2 columns of this name"),
        ("", r"no header"),
        ("a,b\n1,2\n,3\n", r"got '1 samples', expected at least 2"),
    ],
    ids=["text", "infinite", "column", "twice", "empty", "short"],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text)
    with pytest.raises(RecordError, match=message):
        replay.read_record(file, "a", "b")


def test_a_missing_or_binary_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match="record: got"):
        replay.read_record(tmp_path / "no.csv", "a", "b")
    with pytest.raises(MissingPathError, match="record: got"):
        replay.read_record(tmp_path, "a", "b")
    (tmp_path / "picture.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(RecordError, match=r"picture\.csv"):
        replay.read_record(tmp_path / "picture.csv", "a", "b")
