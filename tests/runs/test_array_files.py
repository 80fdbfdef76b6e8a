"""Arrays of NumPy and MATLAB, and columns with several numbers, as columns of a table."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat
from tautscope.errors import RecordError
from tautscope.runs.tables import open_table, read_table

COUNT = 50
TIME = np.linspace(0.0, 1.0, COUNT)
MOTORS = np.column_stack([np.sin(TIME), np.cos(TIME), TIME**2])


def npz(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "record.npz", **arrays)
    return folder / "record.npz"


def mat(folder: Path, **arrays: Any) -> Path:
    savemat(folder / "record.mat", arrays)
    return folder / "record.mat"


@pytest.mark.parametrize("write", [npz, mat])
@pytest.mark.parametrize("motors", [MOTORS, MOTORS.T], ids=["samples down", "samples across"])
def test_arrays_are_columns(write: Any, motors: np.ndarray, tmp_path: Path) -> None:
    file = write(tmp_path, t=TIME, motors=motors, tip=MOTORS[:, :1], rate=100.0)
    found = read_table(file, ["t", "motors.3", "tip"]).columns
    np.testing.assert_array_equal(found["t"], TIME)
    np.testing.assert_array_equal(found["motors.3"], MOTORS[:, 2])
    np.testing.assert_array_equal(found["tip"], MOTORS[:, 0])
    assert open_table(file).titles == ["t", "motors.1", "motors.2", "motors.3", "tip"]


def test_fields_of_a_matlab_struct_are_columns(tmp_path: Path) -> None:
    file = mat(tmp_path, log={"motor": TIME, "tip": MOTORS[:, 1], "name": "trial 3"})
    np.testing.assert_array_equal(read_table(file, ["log.tip"]).columns["log.tip"], MOTORS[:, 1])


def test_a_column_with_several_numbers_is_several_columns(tmp_path: Path) -> None:
    """As in an episode of LeRobot: `action` and `observation.state` have a list in each row."""
    lists = MOTORS.astype(np.float32).tolist()
    frame = pl.DataFrame({"action": lists, "observation.state": lists, "timestamp": TIME})
    frame.write_parquet(tmp_path / "episode.parquet")
    found = read_table(tmp_path / "episode.parquet", ["action.2", "timestamp"]).columns
    np.testing.assert_allclose(found["action.2"], MOTORS[:, 1], rtol=1e-6)
    np.testing.assert_array_equal(found["timestamp"], TIME)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(200), r"7\.3.*save\('-v7'"),
        (b"PK\x03\x04....[Content_Types].xml....", "a spreadsheet.*save the sheet as CSV"),
    ],
)
def test_other_files_are_refused_with_the_remedy(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "record").write_bytes(data)
    with pytest.raises(RecordError, match=message):
        open_table(tmp_path / "record")


def test_no_numbers_are_no_table(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no array of numbers"):
        open_table(npz(tmp_path, names=np.array(["a", "b"])))


@pytest.mark.parametrize(("write", "count"), [(npz, 200), (mat, 10)])
def test_damaged_files_are_errors_that_name_the_file(
    write: Any, count: int, tmp_path: Path
) -> None:
    whole = write(tmp_path, t=TIME, motors=MOTORS).read_bytes()
    rng, file, refused = np.random.default_rng(0), tmp_path / "damaged", 0
    for _ in range(count):
        data = bytearray(whole[: rng.integers(20, len(whole) + 1)])
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(256)
        file.write_bytes(data)
        try:
            open_table(file)
        except RecordError as error:
            refused += 1
            assert str(file) in str(error)
    assert refused > count / 2
