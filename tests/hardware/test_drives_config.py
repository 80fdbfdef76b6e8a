"""Validation of the section [drives], and conversion of units."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from drive_settings import AXES, drives_config, drives_document
from tautscope.config import Config, dump_config, from_document, load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware.drives import open_drives
from tautscope.hardware.scale import Scale


def rotation(**changes: Any) -> dict[str, Any]:
    return {"rotation": {**AXES["rotation"], **changes}}


@pytest.mark.parametrize(
    ("changes", "field", "message"),
    [
        (rotation(node=0), "drives.rotation.node", "from 1 to 127"),
        (rotation(node=128), "drives.rotation.node", "from 1 to 127"),
        (rotation(node=1), "drives.rotation.node", "not that of insertion"),
        (rotation(node=127), "drives.rotation.node", "not that of master_node"),
        (rotation(sign=0), "drives.rotation.sign", " or "),
        (rotation(sign=-2), "drives.rotation.sign", " or "),
        (rotation(counts_per_unit=0.0), "drives.rotation.counts_per_unit", "above 0"),
        (rotation(counts_per_unit=float("inf")), "drives.rotation.counts_per_unit", "finite"),
        (rotation(counts_per_unit=1e9), "drives.rotation.counts_per_unit", "less than 2^31"),
        (rotation(counts_per_unit=1.0), "drives.rotation.counts_per_unit", "not mm or deg"),
        (rotation(travel=[1.0, -1.0]), "drives.rotation.travel", "lower limit"),
        (rotation(speed_limit=-1.0), "drives.rotation.speed_limit", "above 0"),
        (rotation(following_window=0.31), "drives.rotation.following_window", "at most"),
        (rotation(following_window=0.0), "drives.rotation.following_window", "above 0"),
        (rotation(following_error=3.3), "drives.rotation.following_error", "half of the width"),
        (rotation(unit="mm"), "drives.rotation.unit", "no such key"),
        ({"rotation": {"node": 2}}, "drives.rotation.counts_per_unit", "no default"),
        ({"cycle": 0.0105}, "drives.cycle", "whole milliseconds"),
        ({"cycle": 0.3}, "drives.cycle", "whole milliseconds"),
        ({"following_timeout": 0.0505}, "drives.following_timeout", "whole milliseconds"),
        ({"lag": 0.0}, "drives.lag", "above 0"),
        ({"lag": 20}, "drives.lag", "at most 1"),
        ({"command_timeout": 500}, "drives.command_timeout", "at most 60"),
        ({"state_timeout": 1000}, "drives.state_timeout", "at most 60"),
        ({"request_timeout": 300}, "drives.request_timeout", "at most 60"),
        ({"following_timeout": 50}, "drives.following_timeout", "0.001 to 1.5"),
        ({"following_timeout": 1e308}, "drives.following_timeout", "0.001 to 1.5"),
        ({"heartbeat_timeout": 50}, "drives.heartbeat_timeout", "0.001 to 5"),
        ({"reply_timeout": 0.02}, "drives.reply_timeout", "less than cycle"),
        ({"heartbeat_timeout": 0.15}, "drives.heartbeat_timeout", "two heartbeats"),
        ({"waive": ["6040"]}, "drives.waive[0]", " or "),
    ],
)
def test_error_names_the_invalid_field(changes: dict[str, Any], field: str, message: str) -> None:
    with pytest.raises(ConfigError) as found:
        from_document({"drives": drives_document(**changes)})
    assert found.value.field == field
    assert message in found.value.allowed


def test_drives_section_is_optional_and_survives_a_round_trip(tmp_path: Path) -> None:
    assert Config().drives is None
    config = from_document({"drives": drives_document()})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert load_config(file) == config


@pytest.mark.parametrize("text", [None, "no EDS\n", "[6040]\nParameterName=x\nObjectType=7\n"])
def test_unusable_eds_file(tmp_path: Path, text: str | None) -> None:
    file = tmp_path / "drive.eds"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as found:
        open_drives(drives_config(**rotation(eds=str(file))))
    assert found.value.field == "drives.rotation.eds"
    assert found.value.value == str(file)


@pytest.mark.parametrize(
    ("dof", "position", "counts"),
    [
        (Dof.INSERTION, 0.0123456, 12_346),
        (Dof.ROTATION, 0.25, 0),
        (Dof.ROTATION, 1.25, -10_000),
        (Dof.BENDING, -1.5, -15_000),
    ],
)
def test_units_and_signs(dof: Dof, position: float, counts: int) -> None:
    """Calculated by hand from the axes' settings."""
    scale = Scale(drives_config()[dof], dof)
    assert scale.to_counts(position) == counts
    assert scale.to_position(counts) == pytest.approx(position, abs=1e-6)


def test_import_loads_no_bus_library() -> None:
    code = (
        "import sys, tautscope, tautscope.hardware.drives, tautscope.config\n"
        "assert not {'can', 'canopen', 'pysoem', 'serial'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SERVO = {
    "protocol": "feetech",
    "insertion": {"node": 1, "model": "STS3215", "counts_per_unit": 1e5, "travel": [0.0, 0.04]},
    "rotation": {"node": 2, "model": "STS3215", "travel": [-3.0, 3.0]},
    "bending": {"node": 3, "model": "STS3215", "travel": [0.0, 2.0]},
}


def test_limits_of_following_errors_have_defaults() -> None:
    axis = {"node": 1, "counts_per_unit": 1e5, "travel": [-0.01, 0.04], "speed_limit": 0.1}
    axes = {"rotation": axis | {"node": 2, "following_error": 0.002}, "bending": axis | {"node": 3}}
    drives = from_document({"drives": {"insertion": axis, **axes}}).drives
    assert drives is not None
    # 1 % of 50 mm, and half of it for longer; half of what is given.
    assert drives.insertion.following_error == pytest.approx(0.5e-3)
    assert drives.insertion.following_window == pytest.approx(0.25e-3)
    assert drives.rotation.following_window == pytest.approx(1e-3)
    assert drives.insertion.sign == 1


def test_servos_have_defaults_in_units_of_the_dof() -> None:
    drives = from_document({"drives": SERVO}).drives
    assert drives is not None
    assert drives.channel == "/dev/ttyACM0"
    # 0.8 of 50 turns per minute; a turn of rotation is 2 pi rad, one of insertion 40.96 mm.
    assert drives.rotation.speed_limit == pytest.approx(0.8 * 50 / 60 * 2 * math.pi)
    assert drives.insertion.speed_limit == pytest.approx(0.8 * 50 / 60 * 40.96e-3)
    assert drives.bending.following_error == pytest.approx(math.radians(5.625))


@pytest.mark.parametrize(
    ("changes", "field", "message"),
    [
        ({"rotation": {"node": 2, "travel": [0, 1]}}, "drives.rotation.model", "one of STS3215"),
        ({"rotation": SERVO["rotation"] | {"model": "XL330-M288"}}, "drives.rotation.model", "STS"),  # type: ignore[operator]
        ({"rotation": SERVO["rotation"] | {"eds": "x"}}, "drives.rotation.eds", "CiA 402"),  # type: ignore[operator]
        (
            {"rotation": SERVO["rotation"] | {"torque_limit": 1.5}},
            "drives.rotation.torque_limit",
            "1",
        ),  # type: ignore[operator]
        (
            {"rotation": SERVO["rotation"] | {"torque_limit": 0}},
            "drives.rotation.torque_limit",
            "above 0",
        ),  # type: ignore[operator]
        (
            {"rotation": SERVO["rotation"] | {"following_error": -1}},
            "drives.rotation.following_error",
            "above 0",
        ),  # type: ignore[operator]
        (
            {"insertion": {"node": 1, "model": "STS3215", "travel": [0, 1]}},
            "drives.insertion.counts_per_unit",
            "no default",
        ),
        ({"interface": "slcan"}, "drives.interface", "CiA 402"),
        ({"waive": ["6007"]}, "drives.waive", "CiA 402"),
    ],
)
def test_error_names_the_invalid_field_of_servos(
    changes: dict[str, Any], field: str, message: str
) -> None:
    with pytest.raises(ConfigError) as found:
        from_document({"drives": SERVO | changes})
    assert found.value.field == field
    assert message in found.value.allowed


def test_a_watchdog_time_is_one_that_a_dynamixel_takes() -> None:
    model = {"model": "XL330-M288"}
    axes = {key: axis | model for key, axis in SERVO.items() if isinstance(axis, dict)}
    document = axes | {"protocol": "dynamixel", "heartbeat_timeout": 2.54}
    from_document({"drives": document})
    with pytest.raises(ConfigError, match=r"drives\.heartbeat_timeout: got 2\.56"):
        from_document({"drives": document | {"heartbeat_timeout": 2.56}})


@pytest.mark.parametrize(
    "changes", [{"model": "STS3215"}, {"homing_offset": 3}, {"torque_limit": 0.5}]
)
def test_cia_402_drives_have_no_keys_of_servos(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="only servos use it"):
        from_document({"drives": drives_document(**rotation(**changes))})
