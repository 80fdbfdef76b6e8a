"""The configurations of docs/hardware.md: short, and a first motion on simulated motors."""

import json
import math
import re
import tomllib
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.paths import ROOT
from servo_settings import TIMES
from tautscope.bench.any_motors import make_motors
from tautscope.cli import main
from tautscope.config import dump_config, from_document
from tautscope.dof import Dof
from tautscope.hardware import jog
from tautscope.hardware.motor_rig import require_drives
from tautscope.hardware.plausibility import check_experiment
from tautscope.hardware.scale import Scale

PAGE = (ROOT / "docs" / "hardware.md").read_text(encoding="utf-8")
BLOCKS = {
    tomllib.loads(block)["drives"].get("protocol", "canopen"): block
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
}


def document(protocol: str) -> dict[str, Any]:
    return tomllib.loads(BLOCKS[protocol])


def test_each_kind_of_motor_has_a_short_configuration() -> None:
    assert sorted(BLOCKS) == ["canopen", "dynamixel", "feetech", "serial"]
    for block in BLOCKS.values():
        assert len(block.splitlines()) <= 15
        config = from_document(tomllib.loads(block))
        assert config.drives is not None
        check_experiment(config)  # the first compensated motion fits into travel and speed


@pytest.mark.parametrize("protocol", ["dynamixel", "feetech"])
def test_a_servos_start_is_within_its_first_turn(protocol: str) -> None:
    drives = require_drives(from_document(document(protocol)))
    for dof in Dof:
        assert 0 <= Scale(drives[dof], dof).to_counts(0.0) < 4096


def test_counts_of_a_gear() -> None:
    drives = require_drives(from_document(document("canopen")))
    # 4096 counts per turn, gear ratio 20:1, divided by 2 pi.
    assert drives.rotation.counts_per_unit == pytest.approx(4096 * 20 / (2 * math.pi), rel=1e-5)


@pytest.mark.parametrize("protocol", BLOCKS)
def test_a_first_motion(
    protocol: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jog, "DURATION", 1.0)
    slow = document(protocol)  # for a busy computer
    slow["control"]["period"] = TIMES["cycle"]
    slow["drives"] |= TIMES | {"channel": str(tmp_path / "motors")}
    if protocol == "canopen":
        slow["drives"]["interface"] = "tautscope"
    config = from_document(slow)
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    with ExitStack() as resources:
        motors = make_motors(require_drives(config), resources, start=np.array([0.01, 0.1, 0.2]))
        resources.enter_context(motors)
        for dof, distance in (("insertion", 0.001), ("bending", 0.1)):
            assert main(["jog", dof, str(distance), "--config", str(file), "--yes", "--json"]) == 0
            found = json.loads(capsys.readouterr().out)
            assert found["moved"] == pytest.approx(distance, rel=0.1)
            assert found["ended_at"] == pytest.approx(0, abs=0.1 * distance)
