"""Values of a calibration as they are written."""

from argparse import Namespace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from tautscope.calibration.result import CalibrationResult, rounded
from tautscope.commands.calibration_output import finish
from tautscope.config import load_config
from tautscope.errors import ConfigError


@pytest.mark.parametrize(
    ("value", "std", "written"),
    [
        (424.07634, 0.0834, 424.076),
        (424.07634, 12.3, 424.0),
        (-0.0123456, 0.00099, -0.01235),
        (1234.5, 150.0, 1230.0),
        (0.123456789, 0.0, 0.123457),
        (0.0, 0.0, 0.0),
        (0.123456789, float("inf"), 0.123457),
    ],
)
def test_values_have_two_digits_of_their_deviation(
    value: float, std: float, written: float
) -> None:
    assert rounded(value, std) == pytest.approx(written, rel=1e-12)


def test_a_result_is_printed_before_it_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("")
    options = Namespace(write=True, config=rig, out=tmp_path / "out", json=False)
    with pytest.raises(ConfigError, match=r"camera\.fx"):
        finish(options, CalibrationResult("camera", {"camera.fx": -1.0}, {}))
    assert "fx = -1.0" in capsys.readouterr().out
    assert rig.read_text() == ""


def test_changes_are_values_and_their_record() -> None:
    result = CalibrationResult(
        "camera",
        {"camera.fx": 400.123456, "camera.distortion": (0.123456,) * 8, "camera.width": 720},
        {"camera.fx": 0.01234, "camera.distortion[0]": 0.05},
        0.123456,
        {"camera": "A1"},
    )
    at = datetime(2026, 11, 22, 12, tzinfo=UTC)
    changes = result.changes(at)
    assert changes["camera.fx"] == 400.123
    assert changes["camera.distortion"][:2] == [0.123, 0.123456]
    assert changes["camera.width"] == 720
    config = load_config().replace(**changes)
    record = config.calibration.camera
    assert record is not None
    assert record.at == at
    assert record.serial_numbers == {"camera": "A1"}
    assert record.std == {"camera.fx": 0.012, "camera.distortion[0]": 0.05}
    assert record.residual == 0.12


def test_a_value_that_is_not_determined_is_recorded_without_a_deviation() -> None:
    stds = {"camera.fx": float("inf"), "camera.fy": 0.1}
    result = CalibrationResult("camera", {"camera.fx": 400.123456, "camera.fy": 400.0}, stds)
    config = load_config().replace(**result.changes())
    assert config.calibration.camera is not None
    assert config.calibration.camera.std == {"camera.fy": 0.1}
