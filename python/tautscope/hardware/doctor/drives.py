"""Checks of the bus and the drives: configured as before a run, never enabled."""

from __future__ import annotations

import logging
import statistics
import time
from pathlib import Path

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import DriveError, FieldError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Scale, State
from tautscope.hardware.commissioning import CommissionedDrive, commission
from tautscope.hardware.doctor.check_result import CheckResult, from_error, none_found
from tautscope.hardware.drives import open_fieldbus
from tautscope.hardware.fieldbus import AbsentError, Fieldbus

MODES = {
    1: "profile position",
    2: "velocity",
    3: "profile velocity",
    4: "torque",
    6: "homing",
    7: "interpolated position",
    8: "cyclic synchronous position",
    9: "cyclic synchronous velocity",
    10: "cyclic synchronous torque",
}
"""Modes of operation of CiA 402; mode n is bit n - 1 of 0x6502."""
VIRTUAL_INTERFACES = ("virtual", "udp_multicast", "tautscope")
"""Interfaces of python-can without a physical bus."""
BUILT_IN_PORT = "/dev/ttyS"
"""Prefix of serial ports that are no adapters."""
CYCLES = 50
"""Minimum number of set-points in the test of the answers."""


def check_interfaces(*, needed: bool) -> CheckResult:
    """Find CAN interfaces with python-can; it is missing only if one is `needed`."""
    what = "CAN interfaces"
    try:
        from can import detect_available_configs  # noqa: PLC0415
    except ImportError:
        return CheckResult("drives", what, "note", "not searched: python-can is not installed")
    logger = logging.getLogger("can")  # it logs every manufacturer's library that is not installed
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        detected = detect_available_configs()
    finally:
        logger.setLevel(level)
    names = {
        f"{one['interface']} {one['channel']}"
        for one in detected
        if one["interface"] not in VIRTUAL_INTERFACES
        and not str(one["channel"]).startswith(BUILT_IN_PORT)
    }
    names |= {f"socketcan {path.name}" for path in Path("/sys/class/net").glob("can*")}
    data = {"interfaces": sorted(names)}
    if names:
        return CheckResult("drives", what, "ok", ", ".join(sorted(names)), data=data)
    todo = (
        "Connect an adapter; on Linux: sudo modprobe can_dev; ip -br link | grep can; sudo ip link "
        "set can0 up type can bitrate 1000000"
    )
    return none_found("drives", what, todo, needed=needed)


def check_drives(config: DrivesConfig) -> list[CheckResult]:
    """Check bus, drives, settings, heartbeats and answers.

    Nothing is written to a drive that is enabled or in fault. A motor in quick stop stays held.
    """
    bus = f"bus {config.interface if config.protocol == 'canopen' else 'EtherCAT'} {config.channel}"
    try:
        fieldbus = open_fieldbus(config)
    except (DriveError, FieldError) as error:
        return [from_error("drives", bus, error)]
    try:
        findings = [CheckResult("drives", bus, "ok", "open; no other master found")]
        findings += [_check_drive(fieldbus, config, dof) for dof in Dof]
        if any(finding.status == "missing" for finding in findings):
            return findings
        settings, modes = [], {}
        for dof in Dof:
            try:
                drive = commission(fieldbus, config, dof)
            except DriveError as error:
                settings.append(from_error("drives", f"{fieldbus.name(dof)}: settings", error))
            else:
                settings.append(_settings(drive, config))
                modes[dof] = drive.mode
        findings += settings
        if len(modes) == len(Dof):
            fieldbus.configure(modes)
            findings.append(_check_answers(fieldbus, config))
    except DriveError as error:
        findings.append(from_error("drives", "heartbeats and answers", error))
    finally:
        fieldbus.close()
    return findings


def _check_drive(fieldbus: Fieldbus, config: DrivesConfig, dof: Dof) -> CheckResult:
    """Read state, position and supported modes of one drive without writing to it."""
    what = fieldbus.name(dof)
    try:
        supported = fieldbus.read(dof, objects.SUPPORTED_MODES)
        state = cia402.state_of(fieldbus.read(dof, objects.STATUSWORD))
        position = Scale(config[dof], dof.label).to_position(
            fieldbus.read(dof, objects.POSITION_ACTUAL)
        )
        vendor = _or_zero(fieldbus, dof, objects.VENDOR_ID)
        serial_number = _or_zero(fieldbus, dof, objects.SERIAL_NUMBER)
    except DriveError as error:
        return from_error("drives", what, error)
    modes = [number for number in MODES if supported >> (number - 1) & 1]
    unit, scale = dof.display_unit, dof.display_scale
    found = (
        f"vendor 0x{vendor:X}; {state.value if state else 'unknown state'}; "
        f"at {scale * position:.4g} {unit}; modes "
        + ", ".join(f"{number} {MODES[number]}" for number in modes)
    )
    data = {
        "dof": dof.label,
        "vendor": vendor,
        "serial_number": f"{serial_number:08X}" if serial_number else None,
        "state": state.value if state else None,
        "position": position,
        "modes": modes,
    }
    lower, upper = config[dof].travel
    if state in (State.FAULT, State.FAULT_REACTION):
        todo = "Find the cause: look its error code (0x603F) up in the manual, then power-cycle it"
    elif state is State.OPERATION_ENABLED:
        todo = "It is enabled: end the program that commands it, or power-cycle it"
    elif not {7, 8} & set(modes):
        todo = "It cannot follow a stream of positions; use another drive or firmware"
    elif not lower <= position <= upper:
        todo = (
            f"Move it by hand into drives.{dof.label}.travel, {scale * lower:.4g} to "
            f"{scale * upper:.4g} {unit}; or correct home, sign or counts_per_unit"
        )
    else:
        return CheckResult("drives", what, "ok", found, data=data)
    return CheckResult("drives", what, "missing", found, todo, data)


def _or_zero(fieldbus: Fieldbus, dof: Dof, entry: objects.Entry) -> int:
    try:
        return fieldbus.read(dof, entry)
    except AbsentError:
        return 0


def _settings(drive: CommissionedDrive, config: DrivesConfig) -> CheckResult:
    found = f"mode {drive.mode.value}; {len(drive.settings)} settings read back correctly"
    data = {"mode": drive.mode.value, "settings": drive.settings, "absent": list(drive.absent)}
    what = f"{drive.name}: settings"
    if drive.absent:
        waived = f"; waived: {', '.join(config.waive)}" if config.waive else ""
        todo = "Make sure that other protections replace these objects"
        found = f"{found}; it does not have {', '.join(drive.absent)}{waived}"
        return CheckResult("drives", what, "note", found, todo, data)
    return CheckResult("drives", what, "ok", found, data=data)


def _check_answers(fieldbus: Fieldbus, config: DrivesConfig) -> CheckResult:
    """Run cycles as in an experiment, all with the controlword quick stop."""
    targets = [fieldbus.read(dof, objects.POSITION_ACTUAL) for dof in Dof]
    fieldbus.start()
    times: list[float] = []
    late, answers = 0, [0, 0, 0]
    end = time.monotonic() + max(CYCLES * config.cycle, 1.5 * config.heartbeat_timeout)
    while (began := time.monotonic()) < end:
        feedback = fieldbus.exchange([cia402.QUICK_STOP] * 3, targets)
        times.append(time.monotonic() - began)
        late += sum(one.age > 0 for one in feedback)
        answers = [one.answers for one in feedback]
        time.sleep(max(0.0, config.cycle - times[-1]))
    silent = [fieldbus.name(dof) for dof in Dof if not answers[dof]]
    what = "heartbeats and answers"
    data = {"cycles": len(times), "late": late, "median": statistics.median(times)}
    if silent:
        found = f"no answer to any of {len(times)} set-points from {', '.join(silent)}"
        todo = "Its PDOs are not as configured; power-cycle it"
        return CheckResult("drives", what, "missing", found, todo, data)
    found = (
        f"both ways every {1e3 * config.heartbeat_period:.0f} ms; {len(times)} set-points, "
        f"answered in {1e3 * data['median']:.1f} ms (median), {1e3 * max(times):.1f} ms (worst), "
        f"{late} of {3 * len(times)} late"
    )
    if late:
        todo = "Expected: none, with real-time priority and no other load"
        return CheckResult("drives", what, "note", found, todo, data)
    return CheckResult("drives", what, "ok", found, data=data)
