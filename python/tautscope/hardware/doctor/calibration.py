"""Checks of the calibration: what was never calibrated, or belongs to another device or state."""

import shlex
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime

from tautscope.config import CalibrationConfig, CalibrationRecord
from tautscope.config.calibration import CALIBRATIONS
from tautscope.hardware.doctor.check_result import CheckResult, result

BASES = {"geometry": ("camera", "colour"), "latency": ("geometry",)}
"""Calibration -> calibrations whose values it uses."""
_CLOCK_TOLERANCE = 60.0
"""A date may be so far in the future [s]."""


def check_calibration(
    config: CalibrationConfig,
    serial_numbers: Mapping[str, str],
    file: str,
    now: datetime | None = None,
    kinds: Iterable[str] = CALIBRATIONS,
) -> list[CheckResult]:
    """Check the records of calibrations.

    A calibration of other devices, or older than one that it builds on, is missing: its values do
    not belong to this rig. One that was never done with ``tautscope calibrate``, or is older than
    `CalibrationConfig.largest_age`, is a note: its values may be right.

    Args:
        config: Section ``calibration``.
        serial_numbers: Those of the devices that are connected, as far as known.
        file: The configuration, for the remedies.
        now: Present time.
        kinds: The calibrations, by default all of the article's instrument.
    """
    at = now or datetime.now(UTC)
    return [_check(kind, config, serial_numbers, shlex.quote(file), at) for kind in kinds]


def _check(
    kind: str,
    config: CalibrationConfig,
    serial_numbers: Mapping[str, str],
    file: str,
    now: datetime,
) -> CheckResult:
    record: CalibrationRecord | None = getattr(config, kind)
    todo = f"tautscope calibrate {kind} --config {file} --write"
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
    bases = {base: getattr(config, base) for base in BASES.get(kind, ())}
    newer = [base for base, used in bases.items() if used is not None and used.at > record.at]
    missing = note = ""
    if other:
        found, missing = f"{found}; another device is connected: {', '.join(other)}", todo
    elif newer:
        found += f"; older than the calibration of {' and '.join(newer)} that it uses"
        missing = todo
    elif age < -_CLOCK_TOLERANCE:
        found, note = f"{found}: in the future", "Set the clock of the computer: date"
    elif age > config.largest_age * 86400:
        found += f"; stale: calibration.largest_age is {config.largest_age:g} days"
        note = todo
    return result("calibration", kind, found, data, missing=missing, note=note)


def _days(age: float) -> str:
    days = int(age // 86400)
    return "today" if days == 0 else f"{days} day{'s' * (days != 1)} ago"
