"""A recorded motion of an operator as reference: the approach, the record, its errors."""

from pathlib import Path

import numpy as np
import pytest
from common.paths import ROOT
from numpy.typing import ArrayLike
from refused import failed
from scipy.interpolate import interp1d
from tautscope.config import Config, axes, load_config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.references import RecordedReference

CONFIG = Config()
SEED = 3
RNG = np.random.default_rng(SEED)
TIME = 100 + np.cumsum(RNG.uniform(0.005, 0.05, 400))
POSITION = np.column_stack([
    20e-3 + 5e-3 * np.sin(TIME), np.cos(0.7 * TIME), 0.5 + 0.4 * np.sin(0.9 * TIME)
])  # fmt: skip
REFERENCE = RecordedReference(TIME, POSITION, CONFIG)


def test_after_the_approach_it_is_linear_between_the_rows() -> None:
    shift = REFERENCE.approach - TIME[0]
    assert REFERENCE.duration == pytest.approx(TIME[-1] + shift)
    assert len(REFERENCE.segments) == 0
    times = RNG.uniform(TIME[0], TIME[-1], 500)
    found = [REFERENCE(time + shift) for time in times]
    np.testing.assert_allclose(found, interp1d(TIME, POSITION, axis=0)(times), atol=1e-9)


@pytest.mark.parametrize(
    ("time", "position", "field"),
    [
        (TIME[::-1], POSITION, "time[1]"),
        (np.where(TIME[7] == TIME, np.nan, TIME), POSITION, "time[7]"),
        (np.where(TIME[0] == TIME, -np.inf, TIME), POSITION, "time[0]"),
        (np.where(TIME[-1] == TIME, np.inf, TIME), POSITION, f"time[{len(TIME) - 1}]"),
        ([0.0, 1.0, 1.0], POSITION[:3], "time[2]"),
        (TIME[:1], POSITION[:1], "time"),
        (5.0, POSITION, "time"),
        ("a", POSITION, "time"),
        (TIME, POSITION[1:], "position"),
        (TIME, POSITION[:, :2], "position"),
        (TIME, POSITION.T, "position"),
        (TIME, None, "position"),
        (TIME, np.where(POSITION[5, 1] == POSITION, np.nan, POSITION), "position[5]"),
    ],
)
def test_a_wrong_record_is_named(time: ArrayLike, position: ArrayLike, field: str) -> None:
    with pytest.raises(SignalError) as error:
        RecordedReference(time, position, CONFIG)
    assert error.value.field == field
    assert len(str(error.value)) < 200 or time is TIME


def test_a_record_is_of_three_degrees_of_freedom() -> None:
    with pytest.raises(SignalError, match=r"axis_1, axis_2.*insertion, rotation, bending"):
        RecordedReference(TIME, POSITION[:, :2], axes(2, width_limit=1.0))


def test_the_approach_is_slow_and_meets_the_record() -> None:
    times = np.linspace(0, REFERENCE.approach, 2001)
    path = np.array([REFERENCE(time) for time in times])
    np.testing.assert_array_equal(path[0], [CONFIG.experiment[dof].centre for dof in Dof])
    np.testing.assert_allclose(path[-1], POSITION[0], atol=1e-12)
    speed = np.abs(np.diff(path, axis=0)).max(axis=0) / times[1]
    assert (speed <= 0.5 * np.array(CONFIG.safety.reference_speed) * (1 + 1e-3)).all()
    assert REFERENCE.approach >= 1.0


def rig(folder: Path) -> Path:
    """A rig's configuration without a rig."""
    file = folder / "rig.toml"
    bench = ROOT / "configs" / "bench.toml"
    text = bench.read_text(encoding="utf-8")
    file.write_text(text.replace("/tmp/tautscope-bench", f"{folder}/bench"), encoding="utf-8")
    return file


def record(folder: Path, insertion: str = "insertion_mm", scale: float = 1e3) -> Path:
    file = folder / "hand.csv"
    rows = [f"{t:.3f},{scale * i},{r},{b}" for t, (i, r, b) in zip(TIME, POSITION, strict=True)]
    file.write_text("\n".join([f"time,{insertion},rotation,bending", *rows]), encoding="utf-8")
    return file


def test_bad_records_move_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config, out = rig(tmp_path), tmp_path / "run"
    words = ("run", "--config", str(config), "--out", str(out))
    file = str(record(tmp_path))
    assert "--periods: got 3" in failed(capsys, *words, "--reference", file, "--periods", "3")
    assert "--units: got 'time=ms'" in failed(capsys, *words, "--units", "time=ms")
    file = str(record(tmp_path, "insertion"))
    assert "type --units insertion=mm" in failed(capsys, *words, "--reference", file)
    assert "nope.csv" in failed(capsys, *words, "--reference", "nope.csv")
    assert not out.exists()


def test_a_record_stays_within_the_travel_of_the_drives(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    config = rig(tmp_path)
    drives = load_config(config).drives
    assert drives is not None
    lower, upper = drives.insertion.travel
    file = str(record(tmp_path, scale=1e3 * (upper + 1e-3) / POSITION[:, 0].max()))
    err = failed(capsys, "run", "--config", str(config), "--reference", file)
    assert f"column insertion: got {upper + 1e-3:.4g}" in err
    assert f"{lower:g} to {upper:g}, drives.insertion.travel" in err
