"""The examples run, and their results are as described."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from drawn import EXAMPLES


def of_your_own_rig(reductions: list[float]) -> None:
    assert len(reductions) == 3
    # 4 % more than all is what images leave uncertain of the width.
    assert all(90 <= reduction <= 104 for reduction in reductions)


def of_a_robot(errors: list[float]) -> None:
    half = len(errors) // 2
    for before, after in zip(errors[:half], errors[half:], strict=True):
        assert after < 0.25 * before


def of_a_record(found: list[float]) -> None:
    minus, plus, without, with_model = found
    assert minus == pytest.approx(-1, abs=0.15)
    assert plus == pytest.approx(2, abs=0.15)
    assert with_model < 0.2 * without


RESULTS: dict[str, Callable[[list[float]], None]] = {
    "own_rig": of_your_own_rig,
    "own_detector": of_your_own_rig,
    "own_catheter": of_a_robot,
    "own_instrument": of_a_robot,
    "own_mujoco": of_a_robot,
    "own_record": of_a_record,
}


@pytest.mark.parametrize("example", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_runs(example: Path) -> None:
    found = subprocess.run(
        [sys.executable, "-W", "error", example], capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.strip()
    if example.stem in RESULTS:
        numbers = re.findall(r"-?\d+(?:\.\d+)?", found.stdout)
        RESULTS[example.stem]([float(number) for number in numbers])
