"""Settings of motors behind a microcontroller for tests, and the tools that some tests need."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from common.paths import ROOT
from servo_settings import TIMES
from tautscope.config import DrivesConfig, from_document

ARDUINO = ROOT / "arduino" / "tautscope_stepper"
HERE = Path(__file__).parent
AXES: dict[str, dict[str, Any]] = {
    "insertion": {"node": 3, "counts_per_unit": 1e5, "travel": [-0.05, 0.08], "speed_limit": 0.15},
    "rotation": {"node": 1, "counts_per_unit": 500.0, "travel": [-9.0, 9.0], "speed_limit": 20.0},
    "bending": {
        "node": 2,
        "counts_per_unit": 1e3,
        "travel": [-3.0, 3.0],
        "speed_limit": 10.0,
        "sign": -1,
        "home": 0.5,
    },
}


def serial_document(folder: Path, **changes: Any) -> dict[str, Any]:
    return {"protocol": "serial", "channel": str(folder / "board"), **AXES, **TIMES, **changes}


def serial_config(folder: Path, **changes: Any) -> DrivesConfig:
    config = from_document({"drives": serial_document(folder, **changes)}).drives
    assert config is not None
    return config


def require_tool(found: bool, what: str) -> None:
    """Skip a test without a tool; on CI it fails."""
    if not found:
        if os.environ.get("CI") == "true":
            pytest.fail(f"no {what}")
        pytest.skip(f"no {what}")


def run(*command: str | Path) -> str:
    """Run a command; its standard output. Its failure is that of the test."""
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, check=False, cwd=HERE
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def compiled(source: str, folder: Path, *options: str) -> Path:
    """A file in C of this folder as a shared library."""
    require_tool(shutil.which("gcc") is not None, "gcc")
    library = folder / f"{source}.so"
    run("gcc", "-O2", "-shared", "-fPIC", *options[:1], source, "-o", library, *options[1:])
    return library
