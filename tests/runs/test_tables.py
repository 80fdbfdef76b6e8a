"""Tables as laboratories write them: dialects, units, times, Parquet, standard input."""

import gzip
import io
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from tautscope.errors import FieldError, MissingExtraError, RecordError
from tautscope.replay import read_motors, read_record
from tautscope.runs.tables import open_table, read_table
from tautscope.runs.units import parse_units, split_unit

DIALECTS = {
    "comma": b"t,motor,tip\n0,1.5,2\n1,2.5,3\n",
    "byte order mark": b"\xef\xbb\xbft,motor,tip\n0,1.5,2\n1,2.5,3\n",
    "semicolon": b"t;motor;tip\n0;1.5;2\n1;2.5;3\n",
    "decimal comma": b"t;motor;tip\n0;1,5;2\n1;2,5;3\n",
    "tab, decimal comma": b"t\tmotor\ttip\n0\t1,5\t2,0\n1\t2,5\t3,0\n",
    "spaces": b"t   motor  tip\n 0   1.5  2\n 1   2.5  3\n",
    "bars": b"t|motor|tip\n0|1.5|2\n1|2.5|3\n",
    "carriage returns": b"t,motor,tip\r\n0,1.5,2\r\n1,2.5,3\r\n",
    "comments": b"# a rig\n% its PLC\nt,motor,tip\n0,1.5,2\n# pause\n\n1,2.5,3\n",
    "units below": b"t,motor,tip\n[s],[mm],[mm]\n0,1.5,2\n1,2.5,3\n",
    "units in titles": b"t [s],motor (mm),tip_mm\n0,1.5,2\n1,2.5,3\n",
    "latin-1": "t;motor;tip;Müller\n0;1,5;2;ä\n1;2,5;3;ö\n".encode("latin-1"),
    "utf-16": "t\tmotor\ttip\n0\t1.5\t2\n1\t2.5\t3\n".encode("utf-16"),
    "quotes": b'"t","motor","tip"\n"0","1.5","2"\n"1","2.5","3"\n',
    "milliseconds": b"t [ms],motor,tip\n0,1.5,2\n1000,2.5,3\n",
    "ISO 8601": b"t,motor,tip\n2026-11-22T23:59:59.5,1.5,2\n2026-11-23T00:00:00.5,2.5,3\n",
    "ISO 8601, zone": b"t;motor;tip\n2026-11-22 10:00:00Z;1,5;2\n2026-11-22 10:00:01Z;2,5;3\n",
    "summer time ends": b"t,motor,tip\n2026-10-25T02:59:59.5+02:00,1.5,2\n"
    b"2026-10-25T02:00:00.5+0100,2.5,3\n",
    "times of day, zones": b"t,motor,tip\n02:30:00+02:00,1.5,2\n00:00:01-0030,2.5,3\n",
    "time of day": b"t,motor,tip\n10:00:00.25,1.5,2\n10:00:01.25,2.5,3\n",
    "quoted decimal comma": b'"t","motor","tip"\n"0","1,5","2,0"\n"1","2,5","3,0"\n',
    "thousands and decimal comma": b"t;motor;tip\n0;1,5;2\n1;2,5;3\n",
    "a delimiter in a title": b'"t","x (a, b)","motor","tip"\n0,9,1.5,2\n1,9,2.5,3\n',
    "units after a comma": b'"t, s","motor, mm","tip, mm"\n0,1.5,2\n1,2.5,3\n',
    "unit words": b"t [seconds],motor [Millimeter],tip [mm]\n0,1.5,2\n1,2.5,3\n",
    "titles behind a mark": b"# t,motor,tip\n0,1.5,2\n1,2.5,3\n",
    "titles behind a mark, spaces": b"# t motor tip\n0 1.5 2\n1 2.5 3\n",
    "preamble": b"Rig;7\nOperator;A, B\n\nt;motor;tip\n0;1,5;2\n1;2,5;3\n2;;\n3;;\n",
    "LabVIEW": b"LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\n"
    b"***End_of_Header***\t\nChannels\t2\t\t\nSamples\t2\t2\t\nX0\t0.0\t0.0\t\nDelta_X\t1\t1\t\n"
    b"***End_of_Header***\t\t\t\nt\tmotor\ttip\tComment\n0\t1.5\t2\t\n1\t2.5\t3\t\n",
    "sep=": b"sep=;\nt;motor;tip\n0;1,5;2\n1;2,5;3\n",
    "gzip": gzip.compress(b"t,motor,tip\n0,1.5,2\n1,2.5,3\n"),
    "seconds since the start, in ns": b"t_ns,motor,tip\n5000000000000,1.5,2\n5001000000000,2.5,3\n",
    "seconds since the start, in us": b"t [us],motor,tip\n500000000000,1.5,2\n500001000000,2.5,3\n",
    "epoch in ns": b"t,motor,tip\n1763000000000000000,1.5,2\n1763000001000000000,2.5,3\n",
    "epoch in us": b"t,motor,tip\n1763000000000000,1.5,2\n1763000001000000,2.5,3\n",
    "epoch in ms": b"t,motor,tip\n1763000000000,1.5,2\n1763000001000,2.5,3\n",
    "epoch in s": b"t,motor,tip\n1763000000.5,1.5,2\n1763000001.5,2.5,3\n",
    "time of day with comma": b"t\tmotor\ttip\n10:00:00,250\t1.5\t2\n10:00:01,250\t2.5\t3\n",
    "European dates": b"t;motor;tip\n22.11.2026 23:59:59,5;1,5;2\n23.11.2026 00:00:00,5;2,5;3\n",
    "American dates": b"t,motor,tip\n11/22/2026 11:59:59 PM,1.5,2\n11/23/2026 12:00:00 AM,2.5,3\n",
    "command between its samples": b"t,motor,tip\n0,1.5,2\n0,1.5,\n1,,3\n2,3.5,\n",
    "more columns": b"x,t,y,motor,tip,z\na,0,,1.5,2,b\n,1,,2.5,3,\n",
    "short lines": b"t,motor,tip,note\n0,1.5,2\n1,2.5,3,end\n",
}


@pytest.mark.parametrize("text", DIALECTS.values(), ids=list(DIALECTS))
def test_a_dialect_is_recognised(tmp_path: Path, text: bytes) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text)
    found = read_record(file, "motor", "tip", "t")
    seen = np.isfinite(found.measured)
    np.testing.assert_array_equal(found.command[seen], [1.5, 2.5])
    np.testing.assert_array_equal(found.measured[seen], [2, 3])
    assert found.time is not None
    np.testing.assert_allclose(np.diff(found.time[seen]), [1])


def test_rows_are_lines_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("# one\nt,c,m\n[s],[mm],[mm]\n0,1,2\n\n# six\n1,2,3\n2,oops,3\n")
    with pytest.raises(RecordError, match=r"line 8, column c: got 'oops'"):
        read_record(file, "c", "m", "t")
    file.write_text(file.read_text().replace("oops", "4"))
    found = read_record(file, "c", "m", "t")
    np.testing.assert_array_equal(found.rows, [4, 7, 8])
    assert found.units == ("mm", "mm")


def test_parquet_and_standard_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = pl.DataFrame({"t": [0, 1], "motor [mm]": [1.5, None], "tip": [2.0, float("nan")]})
    frame = pl.concat([frame, frame.with_columns(pl.col("t") + 2)])
    data = io.BytesIO()
    frame.write_parquet(data)
    (tmp_path / "log.parquet").write_bytes(data.getvalue())
    found = read_record(tmp_path / "log.parquet", "motor", "tip", "t")
    np.testing.assert_array_equal(found.command, [1.5, 1.5])
    assert found.cleaning.blank == 2
    assert found.units == ("mm", "")
    text = SimpleNamespace(buffer=io.BytesIO(DIALECTS["decimal comma"]))
    monkeypatch.setattr("sys.stdin", text)
    np.testing.assert_array_equal(read_record("-", "motor", "tip").command, [1.5, 2.5])


@pytest.mark.parametrize(
    "kind", ["dates", "dates in zones", "times of day", "dates and numbers", "durations"]
)
def test_a_tip_of_another_file_keeps_its_time(kind: str, tmp_path: Path) -> None:
    """The tip's file begins 3 s later."""
    zone = timezone(timedelta(hours=5, minutes=30)) if kind == "dates and numbers" else UTC
    start = datetime(2026, 11, 22, 10, 0, 0, 250_000, zone)
    stamps = [start + timedelta(seconds=k) for k in range(9)]
    motors: list[object] = [stamp.isoformat() for stamp in stamps]
    if kind == "times of day":
        motors = [f"{stamp:%H:%M:%S.%f}" for stamp in stamps]
    elif kind == "durations":
        motors = [stamp - datetime(2026, 1, 1, tzinfo=UTC) for stamp in stamps]
    numbers = [stamp.timestamp() for stamp in stamps]
    tips = numbers if kind == "dates and numbers" else motors
    if kind == "dates in zones":
        zone = timezone(timedelta(hours=-8))
        tips = [stamp.astimezone(zone).isoformat() for stamp in stamps]
    values = [float(k * k) for k in range(9)]
    motor, tip = tmp_path / "motor.parquet", tmp_path / "tip.parquet"
    pl.DataFrame({"time": motors, "motor": values}).write_parquet(motor)
    pl.DataFrame({"time": tips[3:8], "tip": values[3:8]}).write_parquet(tip)
    found = read_record(motor, "motor", "tip", "time", tip_path=tip)
    seen = np.isfinite(found.measured)
    np.testing.assert_array_equal(found.measured[seen], values[3:8])
    np.testing.assert_allclose(found.command[seen], found.measured[seen], atol=1e-5)


@pytest.mark.parametrize("title", ["time [ms]", "timestamp_ns"])
def test_dates_count_in_seconds_whatever_their_title_says(title: str, tmp_path: Path) -> None:
    stamps = [datetime(2026, 11, 22, 0, 0, k) for k in range(3)]
    file = tmp_path / "log.parquet"
    positions = {"insertion": [0.01] * 3, "rotation": [0.0] * 3, "bending": [0.0] * 3}
    pl.DataFrame({title: stamps, "motor": [1.0, 2.0, 4.0], "tip": [1.0, 2.0, 4.0]}).write_parquet(
        file
    )
    found = read_record(file, "motor", "tip", title)
    assert found.time is not None
    np.testing.assert_array_equal(found.time, [0, 1, 2])
    pl.DataFrame({"time_ms": stamps} | positions).write_parquet(file)
    np.testing.assert_array_equal(read_motors(file)[0], [0, 1, 2])


def test_tips_that_are_too_few_or_at_other_times_are_named_by_their_file(tmp_path: Path) -> None:
    motor, tip = tmp_path / "motor.csv", tmp_path / "tip.csv"
    motor.write_text("time,motor\n" + "".join(f"{k},{k}\n" for k in range(9)))
    tip.write_text("time,tip\n1,1\n2,\n")
    with pytest.raises(RecordError, match=r"tip\.csv, column tip: got '1 samples'"):
        read_record(motor, "motor", "tip", "time", tip_path=tip)
    tip.write_text("time,tip\n" + "".join(f"{100 + k},{k}\n" for k in range(9)))
    with pytest.raises(RecordError, match=r"tip\.csv, column tip: got '0 samples'.*one clock"):
        read_record(motor, "motor", "tip", "time", tip_path=tip)


def test_a_column_without_a_time_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("time,motor,tip\n,1,2\n,2,3\n")
    with pytest.raises(RecordError, match=r"log.csv, column time: got 'no time'"):
        read_record(file, "motor", "tip", "time")


def test_motors_have_units(tmp_path: Path) -> None:
    file = tmp_path / "motors.csv"
    rows = "0,10,90,45\n1000,20,180,-45\n"
    expected = [[10e-3, np.pi / 2, np.pi / 4], [20e-3, np.pi, -np.pi / 4]]
    for header, units in (
        ("time_ms,insertion_mm,rotation_deg,bending_deg\n", ""),
        ("time [ms],insertion [mm],rotation [°],bending (deg)\n", ""),
        ("time,insertion,rotation,bending\nms,mm,deg,deg\n", ""),
        (
            "time,insertion,rotation,bending\n",
            "time=ms, insertion=mm, rotation=deg, bending=deg",
        ),
    ):
        file.write_text(header + rows, encoding="utf-8")
        times, positions = read_motors(file, parse_units(units), largest=np.array([1.0, 7.0, 7.0]))
        np.testing.assert_allclose(times, [0, 1])
        np.testing.assert_allclose(positions, expected)


@pytest.mark.parametrize(
    ("title", "per_second", "start"),
    [
        ("time [ns]", 1e9, 5e12),  # since the computer started
        ("time [ns]", 1e9, 1.7e18),
        ("time [us]", 1e6, 2e11),
        ("time", 1e3, 1.7e12),  # since 1970, by its size
        ("time", 1.0, 1.7e9),
    ],
)
def test_a_time_has_the_unit_of_its_title(
    title: str, per_second: float, start: float, tmp_path: Path
) -> None:
    file = tmp_path / "record.csv"
    rows = [f"{start + per_second * k / 50:.3f},{k % 7},{k % 5}" for k in range(50)]
    file.write_text("\n".join([f"{title},motor,tip", *rows]))
    found = read_record(file, "motor", "tip", "time")
    np.testing.assert_allclose(np.diff(found.time), 0.02, atol=1e-3)


def test_implausible_and_unknown_units_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "motors.csv"
    largest = np.array([0.12, 6.0, 6.0])
    file.write_text("time,insertion,rotation,bending\n0,10,0,0\n1,20,1,1\n")
    with pytest.raises(RecordError, match=r"got '20 m'.*type --units insertion=mm"):
        read_motors(file, largest=largest)
    file.write_text("time,insertion,rotation,bending\n0,0.01,0,0\n1,0.02,-90,1\n")
    with pytest.raises(RecordError, match=r"got '90 rad'.*type --units rotation=deg"):
        read_motors(file, largest=largest)
    file.write_text("time,insertion [deg],rotation,bending\n0,1,0,0\n")
    with pytest.raises(RecordError, match="column insertion: got 'unit deg', expected one of m,"):
        read_motors(file)
    with pytest.raises(FieldError, match="expected for rotation one of rad"):
        parse_units("rotation=mm")
    with pytest.raises(FieldError, match="the column one of insertion"):
        parse_units("tip=mm")


@pytest.mark.parametrize("word", ["Degree", "degrees", "DEG", "°", "furlong", "gon", "Degreee"])
def test_the_unit_of_a_motor_is_known_or_refused(tmp_path: Path, word: str) -> None:
    file = tmp_path / "motors.csv"
    text = f"time [s],insertion [mm],rotation [{word}],bending [rad]\n0,1,90,0\n1,1,180,0\n"
    file.write_text(text, encoding="utf-8")
    if word in ("furlong", "gon", "Degreee"):
        with pytest.raises(RecordError, match=rf"rotation \[{word}\]: got 'unit {word}'"):
            read_motors(file)
    else:
        np.testing.assert_allclose(read_motors(file)[1][:, 1], [np.pi / 2, np.pi])


def test_titles_with_units() -> None:
    assert split_unit("tip [mm]") == ("tip", "mm")
    assert split_unit(" tip_deg ") == ("tip", "deg")
    assert split_unit("tip_left") == ("tip_left", "")
    assert split_unit("tip (left)") == ("tip", "")


def test_a_missing_polars_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tautscope.extras.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'polars; type: .*"tautscope\[analysis\]"'):
        read_record(tmp_path / "log.csv", "a", "b")


def test_columns_are_found_by_number_and_group(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(",Port A,,Port B,\nFrame,State,Tx,State,Tx\n0,OK,1,OK,2\n1,OK,3,OK,4\n")
    for command, measured in (("3", "5"), ("Port A/Tx", "Port B/Tx")):
        found = read_record(file, command, measured, "Frame")
        np.testing.assert_array_equal(found.command, [1, 3])
        np.testing.assert_array_equal(found.measured, [2, 4])
    with pytest.raises(RecordError, match="type the number of the column, 3 and 5"):
        read_record(file, "Tx", "Tx")
    file.write_text("0,1.5,2\n1,2.5,3\n")
    found = read_record(file, "2", "3", "1")
    np.testing.assert_array_equal(found.command, [1.5, 2.5])
    np.testing.assert_array_equal(found.rows, [1, 2])


def test_an_unknown_unit_in_brackets_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("t,motor [furlong],tip[0]\n0,1,2\n1,2,3\n")
    with pytest.raises(
        RecordError, match=r"column motor \[furlong\]: got 'unit furlong', exp.* mm"
    ):
        read_record(file, "motor", "tip")
    file.write_text("t [mm],motor,tip\n0,1,2\n1,2,3\n")
    with pytest.raises(RecordError, match=r"column t: got 'unit mm', expected one of s,"):
        read_record(file, "motor", "tip", "t")


def test_numbers_that_could_mean_two_things_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text('a,b\n"1,234",1\n"2.5",2\n')
    with pytest.raises(RecordError, match=r"line 2, column a: got '1,234'"):
        read_record(file, "a", "b")


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("time,motor,tip\n0,02,1,50,-2,25\n0,04,1,60,-2,35\n")
    with pytest.raises(RecordError, match="6 whole numbers in a line below 3 titles"):
        read_record(file, "motor", "tip")
    file.write_text("time,motor,tip,a,b,c\n0,02,1,50,-2,25\n0,04,1,60,-2,35\n")
    assert read_record(file, "motor", "tip").command.tolist() == [2, 4]


@pytest.mark.parametrize(
    "text",
    ["time,motor,tip\n", f"time,motor,tip\n0,1,{200_000 * '3'}\n1,2,3\n", 200_000 * "x"],
    ids=["titles alone", "a long number", "a long word"],
)
def test_a_table_without_numbers_to_use_is_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text)
    for time in (None, "time"):
        with pytest.raises(RecordError):
            read_record(file, "motor", "tip", time)


def test_poses_of_several_groups_may_have_the_same_titles(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    rows = "".join(f"{k},{k % 5},1,2,{k % 7},1,2\n" for k in range(9))
    titles = "t,tip_x,tip_y,tip_z,tip_x,tip_y,tip_z\n"
    file.write_text(",Tracker,,,Camera,,\n" + titles + rows)
    expected = [k % 7 for k in range(9)]
    np.testing.assert_array_equal(
        read_table(file, ["Camera/tip_x"]).columns["Camera/tip_x"], expected
    )


def test_a_damaged_gzip_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "log.csv.gz"
    file.write_bytes(gzip.compress(b"a,b\n1,2\n" * 99)[:-12])
    with pytest.raises(RecordError, match="expected a complete gzip file"):
        read_record(file, "a", "b")


def test_the_command_is_not_interpolated_across_a_gap_or_outside(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    motor = [f"{t},{t},\n" for t in [*range(10), *range(100, 110)]]
    tip = [f"{t},,{t}\n" for t in (-1, 4.5, 50, 103.5, 200)]
    file.write_text("t,motor,tip\n" + "".join(motor + tip))
    found = read_record(file, "motor", "tip", "t")
    seen = np.isfinite(found.measured)
    np.testing.assert_array_equal(found.command[seen], [4.5, 103.5])
    assert (found.cleaning.interpolated, found.cleaning.blank) == (2, 3)


def test_implausible_times_of_motors_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "motors.csv"
    rows = "".join(f"{20 * k},0.01,0,0\n" for k in range(9))
    file.write_text("Time,Insertion,Rotation,Bending\n" + rows)
    with pytest.raises(RecordError, match=r"a position every 20 s.*--units time=ms"):
        read_motors(file)
    file.write_text("time,insertion,rotation,bending\n0,0,0,0\n0,0,0,0\n1,0,0,0\n")
    with pytest.raises(RecordError, match="0 again, as in 2 lines of 3"):
        read_motors(file)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_numbers_whose_squares_overflow_are_refused(ending: str, tmp_path: Path) -> None:
    """And are left out of the columns of the pose that they are in."""
    file = tmp_path / f"log.{ending}"
    columns = {"motor": [1.0, 2.0, 3.0], "tip_x": [0.5, 1e308, 3.0]}
    frame = pl.DataFrame(columns | {"tip_y": [0.0] * 3, "tip_z": [1.0, None, 2.0]})
    getattr(frame, f"write_{ending}")(file)
    assert "tip_travel" not in open_table(file).titles
    with pytest.raises(RecordError, match=r"[23], column tip_x: got .*1e\+?308.*up to 1e\+100"):
        read_table(file, ["tip_x"])
    assert np.isnan(read_table(file, ["tip_z"]).columns["tip_z"]).tolist() == [False, True, False]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_numbers_too_small_to_divide_by_are_zero(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"log.{ending}"
    frame = pl.DataFrame({"time": [1e-308, 2e-308], "motor": [1e-90, -2.0]})
    getattr(frame, f"write_{ending}")(file)
    sheet = open_table(file)
    np.testing.assert_array_equal(sheet.values(0, "time")[0], [0.0, 0.0])
    np.testing.assert_array_equal(sheet.values(1, "motor")[0], [1e-90, -2.0])


def test_a_panic_of_the_parquet_reader_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some damaged files make Polars panic, which is no `Exception`."""

    def panic(*_: object) -> None:
        raise pl.exceptions.PanicException("range.end as u64 <= self.size")

    file = tmp_path / "log.parquet"
    pl.DataFrame({"a": [1.0, 2.0]}).write_parquet(file)
    monkeypatch.setattr(pl, "read_parquet", panic)
    with pytest.raises(RecordError, match=r"log\.parquet: got 'range.end.*a Parquet file"):
        open_table(file)
