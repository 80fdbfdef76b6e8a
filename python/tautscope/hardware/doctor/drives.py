"""Checks of the bus and the drives: configured as before a run, never enabled."""

import logging
import statistics
import time
from contextlib import ExitStack
from pathlib import Path

from tautscope.config import Config, DrivesConfig
from tautscope.config.microcontroller import SERIAL_PORTS
from tautscope.dof import Motor
from tautscope.errors import ConfigError, DriveError, TautscopeError
from tautscope.hardware.doctor.check_result import CheckResult, from_error, none_found, result
from tautscope.hardware.drive_group import DriveGroup
from tautscope.hardware.drives import open_group
from tautscope.hardware.plausibility import check_experiment
from tautscope.hardware.rig_lock import RigLock
from tautscope.hardware.scale import Scale

VIRTUAL_INTERFACES = ("virtual", "udp_multicast", "tautscope")
"""Interfaces of python-can without a physical bus."""
BUILT_IN_PORT = "/dev/ttyS"
"""Prefix of serial ports that are no adapters."""
SERIAL_DRIVERS = Path("/sys/bus/usb-serial/devices")
"""Drivers of serial adapters, by the name of the port."""
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
    if names:
        return result("drives", what, ", ".join(sorted(names)), {"interfaces": sorted(names)})
    todo = (
        "Connect an adapter; on Linux: sudo modprobe can_dev; ip -br link | grep can; sudo ip link "
        "set can0 up type can bitrate 1000000"
    )
    return none_found("drives", what, todo, needed=needed)


def check_drives(config: DrivesConfig) -> list[CheckResult]:
    """Check bus, drives, settings, heartbeats and answers.

    Nothing is written to a drive that is enabled or in fault, or to a servo whose torque is on. A
    motor in quick stop stays held.
    """
    name = config.interface if config.protocol == "canopen" else config.protocol
    bus = f"bus {name} {config.channel}"
    with ExitStack() as resources:
        try:
            resources.enter_context(RigLock(config))
            group = open_group(config)
        except TautscopeError as error:
            return [from_error("drives", bus, error)]
        resources.callback(group.close)
        findings = [CheckResult("drives", bus, "ok", "open; no other master found")]
        try:
            findings += _check_latency(config)
            findings += [_check_drive(group, config, dof) for dof in config.all_motors]
            if any(finding.status == "missing" for finding in findings):
                return findings
            settings = [_check_settings(group, config, dof) for dof in config.all_motors]
            findings += settings
            if all(finding.status != "missing" for finding in settings):
                group.configure()
                findings.append(_check_answers(group, config))
        except DriveError as error:
            findings.append(from_error("drives", "heartbeats and answers", error))
        return findings


def check_commands(config: Config) -> CheckResult:
    """Check that travel and speed limits are enough for the experiment, with compensation."""
    try:
        check_experiment(config)
    except ConfigError as error:
        return from_error("drives", "commands", error)
    return CheckResult("drives", "commands", "ok", "travel and speed limits are enough for them")


def _check_latency(config: DrivesConfig) -> list[CheckResult]:
    """Check how long the driver of a serial adapter (FTDI) keeps answers back."""
    timer = SERIAL_DRIVERS / Path(config.channel).resolve().name / "latency_timer"
    if config.protocol not in SERIAL_PORTS or not timer.is_file():
        return []
    found = int(timer.read_text(encoding="ascii"))
    what = f"latency of {config.channel}"
    todo = ""
    if 1e-3 * found >= config.reply_timeout / 2:
        todo = (
            f"echo 1 | sudo tee {timer}; again after each time it is connected, or by a udev rule"
        )
    return [result("drives", what, f"{found} ms", {}, missing=todo)]


def _check_drive(group: DriveGroup, config: DrivesConfig, dof: Motor) -> CheckResult:
    """Read state and position of one drive without writing to it."""
    what = group.names[dof]
    try:
        status = group.status(dof)
    except DriveError as error:
        return from_error("drives", what, error)
    position = Scale(config[dof], dof).to_position(status.position)
    unit, scale = dof.display_unit, dof.display_scale
    found = f"at {scale * position:.4g} {unit}; {status.found}"
    data = {
        "dof": dof.label,
        "position": position,
        "serial_number": status.serial_number or None,
        **status.data,
    }
    lower, upper = config[dof].travel
    todo = status.problem
    if not todo and not lower <= position <= upper:
        todo = (
            f"Move it by hand into {dof.key}.travel, {scale * lower:.4g} to "
            f"{scale * upper:.4g} {unit}; or correct home, sign or counts_per_unit"
        )
    return result("drives", what, found, data, missing=todo)


def _check_settings(group: DriveGroup, config: DrivesConfig, dof: Motor) -> CheckResult:
    what = f"{group.names[dof]}: settings"
    try:
        if group.may_move_if_set(dof):
            found = "not checked: its torque is on, so that nothing is written to it"
            return CheckResult("drives", what, "note", found)
        drive = group.commission(dof)
    except DriveError as error:
        return from_error("drives", what, error)
    mode = f"mode {drive.mode}; " if drive.mode else ""
    found = f"{mode}{len(drive.settings)} settings read back correctly"
    data = {"mode": drive.mode, "settings": drive.settings, "absent": list(drive.absent)}
    todo = ""
    if config.waive:
        found += f"; waived: {', '.join(config.waive)}"
    if drive.absent:
        todo = "Make sure that other protections replace these objects"
        found += f"; it does not have or take {', '.join(drive.absent)}"
    return result("drives", what, found, data, note=todo)


def _check_answers(group: DriveGroup, config: DrivesConfig) -> CheckResult:
    """Run cycles as in an experiment, in which no motor is enabled."""
    group.start(group.read_positions())
    times: list[float] = []
    late, answers = 0, [0] * len(config.all_motors)
    end = time.monotonic() + max(CYCLES * config.cycle, 1.5 * config.heartbeat_timeout)
    while (began := time.monotonic()) < end:
        feedback = group.probe()
        times.append(time.monotonic() - began)
        late += sum(one.age > 0 for one in feedback)
        answers = [one.answers for one in feedback]
        time.sleep(max(0.0, config.cycle - times[-1]))
    silent = [group.names[dof] for dof in config.all_motors if not answers[dof]]
    what = "answers" if config.protocol in SERIAL_PORTS else "heartbeats and answers"
    data = {"cycles": len(times), "late": late, "median": statistics.median(times)}
    if silent:
        found = f"no answer to any of {len(times)} set-points from {', '.join(silent)}"
        todo = "Its PDOs are not as configured; power-cycle it"
        return result("drives", what, found, data, missing=todo)
    every = f"both ways every {1e3 * config.heartbeat_period:.0f} ms; "
    found = (
        f"{'' if config.protocol in SERIAL_PORTS else every}{len(times)} set-points, "
        f"answered in {1e3 * data['median']:.1f} ms (median), {1e3 * max(times):.1f} ms (worst), "
        f"{late} of {len(config.all_motors) * len(times)} late"
    )
    todo = "Expected: none, with real-time priority and no other load" if late else ""
    return result("drives", what, found, data, note=todo)
