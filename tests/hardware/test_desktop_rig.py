"""The desktop rig: its configuration is that of its CAD; its protocol on the simulated bus."""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from common.paths import ROOT
from refused import failed
from tautscope.cli import main
from tautscope.config import Config, load_config
from tautscope.config.servos import COUNTS_PER_TURN, MODELS
from tautscope.dof import Dof
from tautscope.hardware.motor_rig import require_drives
from tautscope.log.reader import read_log
from test_servo_bench import running_bench, slow_config

ROUNDED = 1e-4
"""Relative error of the rounded numbers in the configuration."""


@pytest.fixture(scope="module")
def cad() -> ModuleType:
    """The dimensions of the CAD, which need no library."""
    place = ROOT / "rigs" / "desktop" / "parameters.py"
    spec = importlib.util.spec_from_file_location("desktop_parameters", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config("desktop")


def test_the_drives_are_those_of_the_cad(cad: ModuleType, config: Config) -> None:
    drives = require_drives(config)
    for dof, counts, home, travel in zip(
        Dof, cad.counts_per_unit(), cad.home(), cad.travel(), strict=True
    ):
        assert drives[dof].counts_per_unit == pytest.approx(counts, rel=ROUNDED), dof
        assert drives[dof].home == pytest.approx(home, rel=ROUNDED), dof
        assert drives[dof].travel == pytest.approx(travel), dof


def test_the_instrument_and_the_camera_are_those_of_the_cad(
    cad: ModuleType, config: Config
) -> None:
    tip = config.instrument
    lengths = (tip.diameter, tip.bending_length, tip.tip_length)
    bands = (tip.marker_a, tip.marker_b, tip.band_length)
    of_cad = (cad.TIP_DIAMETER, cad.SECTION_LENGTH, cad.TIP_LENGTH)
    assert np.multiply(lengths, 1e3) == pytest.approx(of_cad)
    assert np.multiply(bands, 1e3) == pytest.approx((cad.BAND_A, cad.BAND_B, cad.BAND_LENGTH))
    translation, rotation = cad.camera_from_guide()
    assert config.camera.camera_from_guide.translation == pytest.approx(translation, rel=ROUNDED)
    assert config.camera.camera_from_guide.rotation == pytest.approx(rotation)


def test_a_servo_knows_its_position_anywhere_in_its_travel(config: Config) -> None:
    # After a restart it knows its position within one turn only.
    drives = require_drives(config)
    for dof in Dof:
        axis = drives[dof]
        counts = (np.array(axis.travel) - axis.home) * axis.counts_per_unit
        assert (counts > 0).all(), dof
        assert (counts < COUNTS_PER_TURN).all(), dof


def test_the_servos_are_fast_enough_for_the_experiment(config: Config) -> None:
    # Across the slack the motor moves K_b times as fast as the reference; a servo with a share of
    # its torque has that share of its speed.
    drives = require_drives(config)
    for dof in Dof:
        sine, axis = config.experiment[dof], drives[dof]
        fastest = config[dof].free_gain * 2 * np.pi * sine.amplitude / sine.period
        turns = axis.torque_limit * MODELS["STS3215"].speed / 60
        assert fastest < min(axis.speed_limit, turns * COUNTS_PER_TURN / axis.counts_per_unit), dof


@pytest.mark.usefixtures("undrawn")
def test_the_protocol_ends_in_a_folder_to_share(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    with running_bench(slow_config("desktop", tmp_path), tmp_path) as (file, _, lines):
        arguments = ["--config", str(file), "--out", str(out), "--yes", "--json"]
        assert main(["run", "--protocol", "desktop", "--bend", "180", *arguments]) == 0
        lines.until("torque on", 3)
    printed = json.loads(capsys.readouterr().out)
    assert set(printed["runs"]) == {"uncompensated", "compensated"}
    for name in ("report.html", "config.toml", "trace.csv", "trace_uncompensated.csv"):
        assert (out / name).stat().st_size > 0
    facts = json.loads((out / "environment.json").read_text(encoding="utf-8"))
    assert (facts["protocol"], facts["bend"]) == ("desktop", 180)
    assert {"tautscope", "python", "numpy"} <= facts["software"].keys()
    about = (out / "README.txt").read_text(encoding="utf-8")
    described = [line.split()[0] for line in about.splitlines() if "   " in line.strip()]
    assert len(described) >= 5
    for name in described:
        assert list(out.glob(name)), name
    assert read_log(out / "compensated.mcap").config == load_config(out / "config.toml")


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (["--protocol", "desktop"], "--protocol: got .desktop.*--bend with"),
        (["--bend", "90"], "--bend: got 90, .*--protocol desktop"),
        (["--protocol", "desktop", "--bend", "0", "--reference", "a.csv"], "no --reference"),
        (["--protocol", "desktop", "--bend", "0", "--rig", "a:B"], "no --rig"),
    ],
)
def test_a_protocol_that_cannot_be_run_is_refused(
    options: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = failed(capsys, "run", "--config", "desktop", "--yes", *options)
    assert re.search(error, found), found
