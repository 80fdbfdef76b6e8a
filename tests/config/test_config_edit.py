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


STYLES = {
    "dotted": "camera.fx = 424.0\ncamera.fy = 454.0\n[experiment]\nperiods = 3\n",
    "dotted in a table": '[camera]\nsource.url = "x"\nfy = 454.0\n[experiment]\nperiods = 3\n',
    "inline": "camera = { fx = 424.0, fy = 454.0 }\n[experiment]\nperiods = 3\n",
    "inline in inline": "camera = { fy = 454.0, source = { deinterlace = true } }\n",
    "inline in a table": '[camera]\nfy = 454.0\nsource = { url = "x" }\n',
    "calibrated, dotted": "camera.fy = 454.0\ncalibration.camera = { residual = 0.1 }\n",
    "out of order": "[camera]\nfy = 4.0\n[experiment]\nperiods = 3\n[camera.source]\nurl = 'x'\n",
}


@pytest.mark.parametrize("text", STYLES.values(), ids=list(STYLES))
def test_values_are_written_in_every_style(text: str) -> None:
    values = {
        "camera.source.delay": 0.1,
        "camera.fx": 425.0,
        "camera.camera_from_guide.translation": (0.1, 0.0, 0.2),
        "calibration.geometry": RECORD,
    }
    expected = tomllib.loads(text)
    expected["camera"]["fx"] = 425.0
    expected["camera"].setdefault("source", {})["delay"] = 0.1
    expected["camera"]["camera_from_guide"] = {"translation": [0.1, 0.0, 0.2]}
    expected.setdefault("calibration", {})["geometry"] = RECORD
    assert tomllib.loads(edited_text(text, values)) == expected


def test_a_link_to_a_configuration_stays_one(tmp_path: Path) -> None:
    file, link = tmp_path / "shared.toml", tmp_path / "rig.toml"
    file.write_text(ARTICLE)
    link.symlink_to("shared.toml")
    write_values(link, {"camera.fx": 430.5})
    assert link.is_symlink()
    assert load_config(file).camera.fx == 430.5


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
