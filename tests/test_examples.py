"""The examples run and say what their texts promise."""

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


def test_your_own_rig_loses_its_slack() -> None:
    reductions = numbers("own_rig.py")
    assert len(reductions) == 3
    assert all(70 <= reduction <= 82 for reduction in reductions)


def test_your_own_record_gives_its_offsets() -> None:
    minus, plus, without, with_model = numbers("own_record.py")
    assert minus == pytest.approx(-1, abs=0.15)
    assert plus == pytest.approx(2, abs=0.15)
    assert with_model < 0.2 * without
