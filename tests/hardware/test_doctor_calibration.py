"""What doctor says of the calibration."""

from datetime import UTC, datetime, timedelta

import pytest
from tautscope.config import load_config
from tautscope.hardware.doctor.calibration import check_calibration

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)
KINDS = ("camera", "colour", "geometry", "latency")


def checked(
    days: dict[str, float], serial_numbers: dict[str, str], connected: dict[str, str]
) -> dict[str, tuple[str, str]]:
    """Status and text of each calibration, done so many days ago."""
    changes = {
        f"calibration.{kind}": {
            "date": (NOW - timedelta(days=age)).isoformat(),
            "serial_numbers": serial_numbers,
            "residual": 0.25,
        }
        for kind, age in days.items()
    }
    config = load_config().replace(**changes).calibration
    found = check_calibration(config, connected, "rig.toml", NOW)
    assert all(each.todo for each in found if each.status != "ok")
    return {each.what: (each.status, each.found) for each in found}


def test_without_records_nothing_is_calibrated() -> None:
    found = check_calibration(load_config().calibration, {}, "my rig.toml", NOW)
    assert [(each.what, each.status, each.found) for each in found] == [
        (kind, "note", "never calibrated") for kind in KINDS
    ]
    assert found[0].todo == "tautscope calibrate camera --config 'my rig.toml' --write"


def test_fresh_records_of_the_connected_devices_are_ok() -> None:
    serials = {"camera": "A", "bending": "7"}
    found = checked({"camera": 3, "colour": 2, "geometry": 1, "latency": 0.5}, serials, serials)
    assert {status for status, _ in found.values()} == {"ok"}
    assert "3 days ago" in found["camera"][1]
    assert "0.25 px" in found["camera"][1]
    assert "today" in found["latency"][1]
    # A device whose number is not known now may be the same.
    found = checked(dict.fromkeys(KINDS, 1), serials, {"camera": "A"})
    assert {status for status, _ in found.values()} == {"ok"}


@pytest.mark.parametrize("device", ["camera", "bending"])
def test_another_device_is_named(device: str) -> None:
    serials = {"camera": "A", "bending": "7"}
    found = checked({"geometry": 1}, serials, serials | {device: "B"})
    status, text = found["geometry"]
    assert status == "missing"
    assert f"{device} B, calibrated with {serials[device]}" in text


def test_a_calibration_older_than_its_base_is_missing() -> None:
    found = checked({"camera": 1, "colour": 3, "geometry": 2, "latency": 2}, {}, {})
    assert found["geometry"][0] == "missing"
    assert "older than the calibration of camera " in found["geometry"][1]
    assert {found[kind][0] for kind in ("camera", "colour", "latency")} == {"ok"}


def test_age_and_future_are_notes() -> None:
    found = checked({"camera": 91, "colour": 89, "geometry": -1}, {}, {})
    assert found["camera"][0] == "note"
    assert "stale" in found["camera"][1]
    assert found["colour"][0] == "ok"
    assert found["geometry"][0] == "note"
    assert "in the future" in found["geometry"][1]
