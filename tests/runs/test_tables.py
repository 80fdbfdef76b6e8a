"""Tables as laboratories write them: dialects, units, times, Parquet, standard input."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from tautscope.errors import FieldError, MissingExtraError, RecordError
from tautscope.replay import read_motors, read_record
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
    "time of day": b"t,motor,tip\n10:00:00.25,1.5,2\n10:00:01.25,2.5,3\n",
    "more columns": b"x,t,y,motor,tip,z\na,0,,1.5,2,b\n,1,,2.5,3,\n",
    "short lines": b"t,motor,tip,note\n0,1.5,2\n1,2.5,3,end\n",
}


@pytest.mark.parametrize("text", DIALECTS.values(), ids=list(DIALECTS))
def test_a_dialect_is_recognised(tmp_path: Path, text: bytes) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(text)
    found = read_record(file, "motor", "tip", "t")
    np.testing.assert_array_equal(found.command, [1.5, 2.5])
    np.testing.assert_array_equal(found.measured, [2, 3])
    assert found.time is not None
    np.testing.assert_array_equal(np.diff(found.time), [1])


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


def test_titles_with_units() -> None:
    assert split_unit("tip [mm]") == ("tip", "mm")
    assert split_unit(" tip_deg ") == ("tip", "deg")
    assert split_unit("tip_left") == ("tip_left", "")
    assert split_unit("tip (left)") == ("tip", "")


def test_a_missing_polars_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tautscope.runs.tables.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r'polars; type: .*"tautscope\[analysis\]"'):
        read_record(tmp_path / "log.csv", "a", "b")
