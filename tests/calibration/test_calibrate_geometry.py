"""The command `tautscope calibrate geometry`: what it prints and writes, and when nothing."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import failed
from simulated_motion import actual, simulate, told
from tautscope.calibration import geometry
from tautscope.calibration.geometry import Patch, Recording, fit
from tautscope.cli import main
from tautscope.config import from_document, load_config
from tautscope.log.writer import LogWriter
from tautscope.loop.references import OperatorMotion
from tautscope.report.geometry_figures import residual_figure, write_overlay
from tautscope.runs.experiment import run_experiment
from tautscope.twin import Twin

Capture = pytest.CaptureFixture[str]
CONFIG = """\
# Our rig.
[camera]
fx = 424.0  # REPLACE: calibration [px]
[camera.camera_from_guide]
translation = [13.5e-3, 14e-3, 15e-3]  # REPLACE: channel opening in the camera frame [m]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


def use(monkeypatch: pytest.MonkeyPatch, recording: Recording) -> None:
    """Let the sweep of the twin return a record."""
    monkeypatch.setattr(geometry, "sweep", lambda *_, **__: recording)


def test_the_values_are_written_into_the_file_and_the_comments_stay(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture, file: Path, tmp_path: Path
) -> None:
    use(monkeypatch, simulate()[0])
    folder = tmp_path / "out"
    arguments = ["calibrate", "geometry", "--twin", "--config", str(file), "--out", str(folder)]
    assert main([*arguments, "--write"]) == 0
    printed = capsys.readouterr().out
    assert from_document(tomllib.loads(printed)).camera.fx != 424.0
    assert "instrument.bending_length" in printed
    text, config = file.read_text(encoding="utf-8"), load_config(file)
    assert "# Our rig." in text and "channel opening" in text and "REPLACE" not in text
    assert config.camera.fx == pytest.approx(actual().camera.fx, rel=0.03)
    assert config.camera.source.delay > 0.05
    record = config.calibration.geometry
    assert record is not None and record.std["camera.fx"] > 0
    assert {each.name for each in folder.iterdir()} == {"values.toml", "geometry.png"}


def test_json_has_values_and_standard_deviations(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    use(monkeypatch, simulate()[0])
    assert main(["calibrate", "geometry", "--twin", "--band-distance", "11.1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    values = found["values"]
    distance = values["instrument.marker_b"] - values["instrument.marker_a"]
    assert distance == pytest.approx(11.1e-3, abs=0.1e-3)
    assert set(found["parameters"]["camera.focal"]) == {"before", "after", "std"}


def test_nothing_is_written_if_the_model_does_not_explain_the_record(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture, file: Path, tmp_path: Path
) -> None:
    recording, _ = simulate(duration=30.0)
    use(monkeypatch, replace(recording, features=recording.features[:, [2, 3, 0, 1]]))
    folder = tmp_path / "out"
    arguments = ["calibrate", "geometry", "--twin", "--config", str(file), "--out", str(folder)]
    assert main([*arguments, "--write", "--json"]) == 1
    printed = capsys.readouterr()
    assert "Nothing was written" in printed.err
    assert not json.loads(printed.out)["is_plausible"]
    assert file.read_text(encoding="utf-8") == CONFIG
    assert not folder.exists()


def test_a_log_without_enough_motion_is_refused(
    capsys: Capture, file: Path, tmp_path: Path
) -> None:
    config = told()
    rig, path = Twin(config), tmp_path / "run.mcap"

    with LogWriter(path, config, wait=True) as log:
        run_experiment(rig, OperatorMotion(config.experiment, 0, duration=2.0), config, log=log)
    rig.close()
    message = failed(capsys, "calibrate", "geometry", str(path), "--config", str(file), "--write")
    assert "both bands in" in message
    assert file.read_text(encoding="utf-8") == CONFIG


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["clip.avi"], "--motors"),
        (["clip.avi", "--motors", "missing.csv"], "File not found: missing.csv"),
        (["missing.mcap"], "File not found: missing.mcap"),
        ([], "--config"),
        (["--motors", "motors.csv"], "a video together with --motors"),
        (["run.mcap", "--twin"], "--twin: got True, expected no files"),
    ],
)
def test_bad_sources_are_named(capsys: Capture, arguments: list[str], message: str) -> None:
    assert message in failed(capsys, "calibrate", "geometry", *arguments)


def test_a_distance_in_metres_is_refused_before_anything_moves(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setattr(geometry, "sweep", lambda *_, **__: pytest.fail("it moved"))
    found = failed(capsys, "calibrate", "geometry", "--twin", "--band-distance", "0.005")
    assert "--band-distance: got 0.005, expected a distance in mm, above" in found


@pytest.mark.parametrize("kind", ["geometry", "colour"])
def test_motors_of_a_video_have_units(capsys: Capture, tmp_path: Path, kind: str) -> None:
    motors, video = tmp_path / "motors.csv", tmp_path / "none.avi"
    lines = [f"{k},{100 + k},0,0\n" for k in range(3)]
    motors.write_text("".join(["time,insertion,rotation,bending\n", *lines]), encoding="utf-8")
    options = ["calibrate", kind, str(video), "--motors", str(motors)]
    assert "type --units insertion=mm" in failed(capsys, *options)
    assert "none.avi" in failed(capsys, *options, "--units", "insertion=mm")


def test_figure_and_overlay_show_the_bands(tmp_path: Path) -> None:
    recording, _ = simulate()
    found = fit(recording, told())
    assert len(residual_figure(found).axes) == 5
    blank = Patch(0, 0, np.zeros((576, 720, 3), np.uint8))
    first = np.flatnonzero(recording.found)[:3]
    few = replace(
        recording,
        captured_at=recording.captured_at[first],
        features=recording.features[first],
        patches=(blank,) * 3,
    )
    video = tmp_path / "overlay.avi"
    write_overlay(replace(found, recording=few, states=found.states[first]), told(), video)
    capture = cv2.VideoCapture(str(video))
    images = [image for ok, image in (capture.read() for _ in range(4)) if ok]
    assert len(images) == 3
    # An outline passes within a band's size of each centroid.
    for image, features in zip(images, recording.features[first], strict=True):
        rows, columns = np.nonzero(image.max(axis=2) > 60)
        for u, v in features.reshape(2, 2):
            assert np.hypot(columns - u, rows - v).min() < 25
