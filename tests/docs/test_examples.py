"""The examples run, and their results are as described."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from drawn import EXAMPLES


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
    # 1 % more than all is what images leave uncertain of the width.
    assert all(90 <= reduction <= 101 for reduction in reductions)


def test_a_catheter_of_your_own_is_compensated() -> None:
    for before, after in zip(*[iter(numbers("own_catheter.py"))] * 2, strict=True):
        assert after < 0.25 * before


def test_offsets_of_your_own_record_are_estimated() -> None:
    minus, plus, without, with_model = numbers("own_record.py")
    assert minus == pytest.approx(-1, abs=0.15)
    assert plus == pytest.approx(2, abs=0.15)
    assert with_model < 0.2 * without
