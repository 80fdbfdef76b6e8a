"""Records: causal prediction, cleaning, and errors of invalid files."""

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
def test_the_width_of_a_play_is_estimated_and_the_error_reduced(seed: int) -> None:
    command, measured = record(seed)
    predicted, delta_minus, delta_plus = replay.predict_tip(command, measured, estimator())
    assert delta_plus[-1] - delta_minus[-1] == pytest.approx(WIDTH, rel=0.05), f"seed {seed}"
    late = slice(len(command) // 2, None)
    error = np.sqrt(np.mean((predicted - measured)[late] ** 2))
    without_model = np.std((command - measured)[late])
    assert error < 0.1 * without_model, f"seed {seed}"


@pytest.mark.parametrize("at", [1, 700, 2999])
def test_a_prediction_is_causal(at: int) -> None:
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
    np.testing.assert_allclose(found.command, [1, 5 / 3, 3, 4])
    np.testing.assert_array_equal(found.measured, [2, 3, np.nan, 5])
    assert found.time is not None
    np.testing.assert_array_equal(found.time, [0, 0.1, 0.3, 0.7])
    np.testing.assert_array_equal(found.rows, [2, 4, 5, 6])
    assert found.cleaning == replay.Cleaning(interpolated=1, unseen=1)
    untimed = replay.read_record(file, "motor", "tip")
    np.testing.assert_array_equal(untimed.command, [1, 3, 4])
    assert untimed.cleaning == replay.Cleaning(blank=1, unseen=1)


Line = tuple[float, float, float]


def clean_lines(seed: int) -> list[Line]:
    command, measured = record(seed)
    time = np.cumsum(np.random.default_rng(seed).uniform(0.01, 0.03, len(command)))
    return list(zip(time.tolist(), command.tolist(), measured.tolist(), strict=True))


def read_lines(folder: Path, lines: list[Line]) -> replay.Record:
    file = folder / "log.csv"
    file.write_text("t,c,m\n" + "".join(f"{t!r},{c!r},{m!r}\n" for t, c, m in lines))
    return replay.read_record(file, "c", "m", "t")


def assert_same_signals(found: replay.Record, lines: list[Line]) -> None:
    _, command, measured = np.array(lines).T
    np.testing.assert_array_equal(found.command, command)
    np.testing.assert_array_equal(found.measured, measured)
    assert found.time is not None
    assert np.all(np.diff(found.time) >= 0)


@pytest.mark.parametrize("seed", range(3))
def test_late_lines_are_sorted_and_duplicates_removed(tmp_path: Path, seed: int) -> None:
    lines = clean_lines(seed)
    messy = lines.copy()
    for at in (200, 900, 2500):
        messy.insert(at + 4, messy.pop(at))  # a line written four lines late
    messy[1500:1500] = messy[1480:1500]  # a block written twice
    messy.insert(40, messy[39])
    found = read_lines(tmp_path, messy)
    assert_same_signals(found, lines)
    assert found.cleaning == replay.Cleaning(reordered=3, duplicates=21), f"seed {seed}"
    np.testing.assert_array_equal(np.array(messy)[found.rows - 2], lines)


def test_duplicate_lines_without_a_tip_are_removed(tmp_path: Path) -> None:
    nan = float("nan")
    found = read_lines(tmp_path, [(0, 1, 2), (1, 2, nan), (1, 2, nan), (2, 3, 4)])
    assert found.cleaning == replay.Cleaning(duplicates=1, unseen=1)


@pytest.mark.parametrize("back", [0.5, 20.0, 1e6])
def test_a_clock_set_back_keeps_the_order(tmp_path: Path, back: float) -> None:
    lines = clean_lines(0)
    messy = [(t - back if at >= 1700 else t, c, m) for at, (t, c, m) in enumerate(lines)]
    messy.insert(2404, messy.pop(2400))
    found = read_lines(tmp_path, messy)
    assert_same_signals(found, lines)
    assert found.cleaning == replay.Cleaning(reordered=1, clock_steps=1)


def test_a_coarse_clock_makes_no_gaps(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    lines = [f"{tick // 4},{'' if tick % 4 == 3 else tick},{0.5 * tick}" for tick in range(80)]
    file.write_text("\n".join(["time,motor,tip", *lines]))
    found = replay.read_record(file, "motor", "tip", "time")
    assert found.cleaning == replay.Cleaning(interpolated=20)


def test_gaps_are_counted(tmp_path: Path) -> None:
    lines = clean_lines(0)
    del lines[500:600], lines[1000:1200]
    found = read_lines(tmp_path, lines)
    assert_same_signals(found, lines)
    assert found.cleaning.gaps == 2
    assert found.cleaning.longest_gap == pytest.approx(200 * 0.02, rel=0.1)


def test_without_time_the_order_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("t,c,m\n1,1,1\n1,1,1\n0,2,2\n")
    found = replay.read_record(file, "c", "m")
    np.testing.assert_array_equal(found.command, [1, 1, 2])
    assert found.time is None
    assert found.cleaning == replay.Cleaning()
    file.write_text("t,c,m\n1,1,1\n1,1,2\n1,2,2\n")
    found = replay.read_record(file, "c", "m", "t")
    assert found.time is None
    assert found.cleaning == replay.Cleaning(equal_times=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3,x\n", r"log\.csv, line 3, column b: got 'x', expected a number up to"),
        ("a,b\n1,2\n3,inf\n", r"line 3, column b: got 'inf'"),
        ("a,c\n1,2\n", r"log\.csv: got 'b', expected one of its columns: a, c"),
        ("a,b,b\n1,2,3\n", r"2 columns of this name"),
        ("", r"no header"),
        ("a,b\n1,2\n,3\n4,\n", r"got '1 samples', expected at least 2"),
    ],
    ids=["text", "infinite", "column", "twice", "empty", "short"],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text)
    with pytest.raises(RecordError, match=message):
        replay.read_record(file, "a", "b")


def test_a_missing_or_binary_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match=r"record: got|File not found"):
        replay.read_record(tmp_path / "no.csv", "a", "b")
    with pytest.raises(RecordError, match=r"metadata\.yaml: got 'no such file', expected a ROS 2"):
        replay.read_record(tmp_path, "a", "b")
    (tmp_path / "picture.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(RecordError, match=r"picture\.csv"):
        replay.read_record(tmp_path / "picture.csv", "a", "b")
