"""Checks of the calibration: what was never calibrated, or belongs to another device or state."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime

from tautscope.config import CalibrationConfig, CalibrationRecord
from tautscope.config.calibration import CALIBRATIONS
from tautscope.hardware.doctor.check_result import CheckResult

BASES = {"geometry": ("camera", "colour"), "latency": ("geometry",)}
"""Calibration -> calibrations whose values it uses."""
_CLOCK_TOLERANCE = 60.0
"""A date may be so far in the future [s]."""


def check_calibration(
    config: CalibrationConfig, serial_numbers: Mapping[str, str], now: datetime | None = None
) -> list[CheckResult]:
    """Check the records of all calibrations.

    A calibration of other devices, or older than one that it builds on, is missing: its values do
    not belong to this rig. One that was never done with ``tautscope calibrate``, or is older than
    `CalibrationConfig.largest_age`, is a note: its values may be right.

    Args:
        config: Section ``calibration``.
        serial_numbers: Those of the devices that are connected, as far as known.
        now: Present time.
    """
    return [_check(kind, config, serial_numbers, now or datetime.now(UTC)) for kind in CALIBRATIONS]


def _check(
    kind: str, config: CalibrationConfig, serial_numbers: Mapping[str, str], now: datetime
) -> CheckResult:
    record: CalibrationRecord | None = getattr(config, kind)
    todo = f"tautscope calibrate {kind} --config rig.toml --write"
    if record is None:
        return CheckResult("calibration", kind, "note", "never calibrated", todo)
    age = (now - record.at).total_seconds()
    found = f"{record.at.date()}, {_days(age)}"
    if record.residual is not None:
        found += f", residual {record.residual:.2g} px"
    data = {"date": record.date, "age": age, "serial_numbers": record.serial_numbers}
    other = [
        f"{device} {serial_numbers[device]}, calibrated with {number}"
        for device, number in record.serial_numbers.items()
        if serial_numbers.get(device, number) != number
    ]
    newer = [base for base in BASES.get(kind, ()) if _is_newer(getattr(config, base), record)]
    if other:
        found = f"{found}; another device is connected: {', '.join(other)}"
        return CheckResult("calibration", kind, "missing", found, todo, data)
    if newer:
        found = f"{found}; older than the calibration of {' and '.join(newer)} that it uses"
        return CheckResult("calibration", kind, "missing", found, todo, data)
    if age < -_CLOCK_TOLERANCE:
        clock = "Set the clock of the computer: date"
        return CheckResult("calibration", kind, "note", f"{found}: in the future", clock, data)
    if age > config.largest_age * 86400:
        found = f"{found}; stale: calibration.largest_age is {config.largest_age:g} days"
        return CheckResult("calibration", kind, "note", found, todo, data)
    return CheckResult("calibration", kind, "ok", found, data=data)


def _is_newer(base: CalibrationRecord | None, record: CalibrationRecord) -> bool:
    return base is not None and base.at > record.at


def _days(age: float) -> str:
    days = int(age // 86400)
    return "today" if days == 0 else f"{days} day{'s' * (days != 1)} ago"
