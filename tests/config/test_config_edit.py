"""Changing values in a TOML file; tomllib is the oracle."""

import tomllib
from pathlib import Path

import pytest
from tautscope.config import load_config
from tautscope.config.edit import edited_text, write_values
from tautscope.config.load import config_file
from tautscope.config.placeholders import placeholders
from tautscope.errors import ConfigError, MissingPathError

ARTICLE = config_file("article_rig").read_text()
RECORD = {
    "date": "2026-11-22T12:00:00+00:00",
    "serial_numbers": {"camera": "A 1"},
    "std": {"camera.fx": 0.3, "camera.distortion[0]": 0.01},
}


def test_only_the_given_values_change(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(ARTICLE)
    values = {
        "camera.fx": 430.5,
        "camera.distortion": (0.1,) * 8,
        "camera.camera_from_guide.rotation": (0.1, 0.2, 0.3),
        "insertion.update_distance": 5e-4,
        "calibration.camera": RECORD,
        "vision.threshold": 4.0,
    }
    write_values(file, values)
    expected = load_config("article_rig").replace(**values)
    assert load_config(file) == expected
    assert expected.calibration.camera is not None
    old, new = ARTICLE.splitlines(), file.read_text().splitlines()
    changed = [line for line in old if line not in new]
    assert len(changed) == 4
    marked, left = set(placeholders("article_rig")), set(placeholders(file))
    assert marked - left == {"camera.fx", "camera.camera_from_guide.rotation", "vision.threshold"}
    write_values(file, {"calibration.camera": RECORD, "calibration.colour": RECORD})
    assert load_config(file).calibration.colour is not None
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def test_sections_are_added_to_an_empty_file() -> None:
    text = edited_text("", {"camera.source.delay": 0.1, "calibration.camera": RECORD})
    assert tomllib.loads(text) == {
        "camera": {"source": {"delay": 0.1}},
        "calibration": {"camera": RECORD},
    }
    assert "[camera]\n" not in text


def test_an_invalid_result_is_not_written(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(ARTICLE)
    with pytest.raises(ConfigError, match=r"camera\.fx"):
        write_values(file, {"camera.fx": -1.0})
    for date in ("yesterday", "2026-11-22T12:00:00"):
        with pytest.raises(ConfigError, match=r"calibration\.camera\.date"):
            write_values(file, {"calibration.camera": {"date": date}})
    assert file.read_text() == ARTICLE
    with pytest.raises(ConfigError, match="a file of your own"):
        write_values("bench", {"camera.fx": 1.0})
    with pytest.raises(MissingPathError):
        write_values(tmp_path / "none.toml", {"camera.fx": 1.0})
