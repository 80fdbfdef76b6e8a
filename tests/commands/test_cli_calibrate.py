"""The command `tautscope calibrate`."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import failed
from tautscope.cli import main
from tautscope.config import from_document

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """An image with a green band, and its mask; seed 0."""
    rng = np.random.default_rng(0)
    frame = rng.normal((60, 70, 150), 8, (40, 40, 3))
    mask = np.zeros((40, 40), np.uint8)
    mask[10:20, 10:30], frame[10:20, 10:30] = 255, rng.normal((70, 160, 60), 8, (10, 20, 3))
    paths = [str(tmp_path / name) for name in ("frame.png", "mask.png")]
    for path, image in zip(paths, (frame.astype(np.uint8), mask), strict=True):
        cv2.imwrite(path, image)
    return paths


def test_a_colour_is_fitted_to_a_frame_and_its_mask(capsys: Capture, files: list[str]) -> None:
    assert main(["calibrate", "colour", *files]) == 0
    vision = from_document(tomllib.loads(capsys.readouterr().out)).vision
    _, green, red = vision.weights
    assert green > 0 > red
    assert main(["calibrate", "colour", *files, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["values"]["vision.weights"] == pytest.approx(vision.weights, abs=1e-3)
    assert found["bands_classified_as_marker"] > 0.99
    assert found["background_classified_as_marker"] < 0.01


def test_bad_files_are_named(capsys: Capture, files: list[str], tmp_path: Path) -> None:
    frame, mask = files
    assert "pairs of an image" in failed(capsys, "calibrate", "colour", frame, mask, frame)
    assert "--motors" in failed(capsys, "calibrate", "colour", frame)
    missing = str(tmp_path / "none.png")
    assert f"File not found: {missing}" in failed(capsys, "calibrate", "colour", frame, missing)
    text = tmp_path / "text.png"
    text.write_text("no image")
    assert "that OpenCV reads" in failed(capsys, "calibrate", "colour", str(text), mask)
    small = str(tmp_path / "small.png")
    cv2.imwrite(small, np.zeros((3, 4), np.uint8))
    assert "40 x 40 and 4 x 3" in failed(capsys, "calibrate", "colour", frame, small)
    cv2.imwrite(small, np.zeros((40, 40), np.uint8))
    assert "No pixel of the bands" in failed(capsys, "calibrate", "colour", frame, small)
