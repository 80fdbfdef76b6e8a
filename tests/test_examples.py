"""The examples run, and their results are as described."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import EXAMPLES
from tautscope.config import from_document


@pytest.mark.parametrize("example", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_runs(example: Path) -> None:
    found = subprocess.run(
        [sys.executable, "-W", "error", example], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.strip()


def numbers(example: str) -> list[float]:
    found = subprocess.run(
        [sys.executable, EXAMPLES / example], capture_output=True, text=True, check=True
    )
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", found.stdout)]


@pytest.mark.parametrize("example", ["own_rig.py", "own_detector.py"])
def test_hysteresis_of_your_own_rig_is_reduced(example: str) -> None:
    reductions = numbers(example)
    assert len(reductions) == 3
    assert all(90 <= reduction <= 100 for reduction in reductions)


def test_offsets_of_your_own_record_are_estimated() -> None:
    minus, plus, without, with_model = numbers("own_record.py")
    assert minus == pytest.approx(-1, abs=0.15)
    assert plus == pytest.approx(2, abs=0.15)
    assert with_model < 0.2 * without


def test_a_jog_goes_as_far_as_told_and_comes_back() -> None:
    went, end = numbers("jog.py")
    assert went == pytest.approx(1.0, abs=0.01)  # mm
    assert end == pytest.approx(0.0, abs=0.01)


def test_a_colour_is_fitted_to_a_frame_and_its_mask(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    frame = rng.normal((60, 70, 150), 8, (40, 40, 3))
    mask = np.zeros((40, 40), np.uint8)
    mask[10:20, 10:30], frame[10:20, 10:30] = 255, rng.normal((70, 160, 60), 8, (10, 20, 3))
    files = [str(tmp_path / name) for name in ("frame.png", "mask.png")]
    for file, picture in zip(files, (frame.astype(np.uint8), mask), strict=True):
        cv2.imwrite(file, picture)
    found = subprocess.run(
        [sys.executable, EXAMPLES / "fit_colour.py", *files],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    vision = from_document(tomllib.loads(found)).vision
    _, green, red = vision.weights
    assert green > 0 > red
    hit, wrong = re.findall(r"[\d.]+(?= %)", found)
    assert float(hit) > 99
    assert float(wrong) < 1
