"""The bus and the drives on it: set and read back as before a run, never enabled."""

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
from tautscope.hardware.commissioning import Commissioned, commission
from tautscope.hardware.doctor.finding import Finding, absent, failed
from tautscope.hardware.drives import open_link
from tautscope.hardware.link import AbsentError, Link

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
"""CiA 402, 0x6502: bit number + 1 -> mode of operation."""
NOT_REAL = ("virtual", "udp_multicast", "tautscope")
"""Interfaces of python-can without a bus behind them."""
BUILT_IN = "/dev/ttyS"
"""A serial port of the computer itself; adapters have others."""
CYCLES = 50
"""Set-points by which the answers are judged, at least."""


def check_interfaces(*, needed: bool) -> Finding:
    """The CAN interfaces python-can finds; `needed` if there should be one."""
    what = "CAN interfaces"
    try:
        from can import detect_available_configs  # noqa: PLC0415
    except ImportError:
        return Finding("drives", what, "note", "cannot be looked for without python-can")
    logger = logging.getLogger("can")  # it lists every maker's library that is not installed
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        detected = detect_available_configs()
    finally:
        logger.setLevel(level)
    names = {
        f"{one['interface']} {one['channel']}"
        for one in detected
        if one["interface"] not in NOT_REAL and not str(one["channel"]).startswith(BUILT_IN)
    }
    names |= {f"socketcan {path.name}" for path in Path("/sys/class/net").glob("can*")}
    data = {"interfaces": sorted(names)}
    if names:
        return Finding("drives", what, "ok", ", ".join(sorted(names)), data=data)
    todo = (
        "Connect an adapter; on Linux: sudo modprobe can_dev; ip -br link | grep can; sudo ip link "
        "set can0 up type can bitrate 1000000"
    )
    return absent("drives", what, todo, needed=needed)


def check_drives(config: DrivesConfig) -> list[Finding]:
    """Bus, drives, settings, heartbeats and answers.

    A drive that is enabled or in a fault is told nothing. Motors that a quick stop holds stay held.
    """
    bus = f"bus {config.interface if config.protocol == 'canopen' else 'EtherCAT'} {config.channel}"
    try:
        link = open_link(config)
    except (DriveError, FieldError) as error:
        return [failed("drives", bus, error)]
    try:
        findings = [Finding("drives", bus, "ok", "open; no other master was heard")]
        findings += [_look(link, config, dof) for dof in Dof]
        if any(finding.status == "missing" for finding in findings):
            return findings
        settings, modes = [], {}
        for dof in Dof:
            try:
                done = commission(link, config, dof)
            except DriveError as error:
                settings.append(failed("drives", f"{link.name(dof)}: settings", error))
            else:
                settings.append(_settings(done, config))
                modes[dof] = done.mode
        findings += settings
        if len(modes) == len(Dof):
            link.prepare(modes)
            findings.append(_heartbeats(link, config))
    except DriveError as error:
        findings.append(failed("drives", "heartbeats and answers", error))
    finally:
        link.close()
    return findings


def _look(link: Link, config: DrivesConfig, dof: Dof) -> Finding:
    """What one drive says without being told anything."""
    what = link.name(dof)
    try:
        supported = link.read(dof, objects.SUPPORTED_MODES)
        state = cia402.state_of(link.read(dof, objects.STATUSWORD))
        position = Scale(config[dof], dof.label).to_position(link.read(dof, objects.POSITION))
        vendor = _or_zero(link, dof)
    except DriveError as error:
        return failed("drives", what, error)
    modes = [number for number in MODES if supported >> (number - 1) & 1]
    unit, scale = dof.display_unit, dof.display_scale
    here = f"{scale * position:.4g} {unit}"
    found = (
        f"vendor 0x{vendor:X}; {state.value if state else 'unknown state'}; at {here}; modes "
        + ", ".join(f"{number} {MODES[number]}" for number in modes)
    )
    data = {
        "dof": dof.label,
        "vendor": vendor,
        "state": state.value if state else None,
        "position": position,
        "modes": modes,
    }
    lower, upper = config[dof].travel
    if state in (State.FAULT, State.FAULT_REACTION):
        todo = "Find the cause in its manual by its emergency or 0x603F; then switch it off and on"
    elif state is State.OPERATION_ENABLED:
        todo = "It is enabled: end the program that drives it, or switch it off and on"
    elif not {7, 8} & set(modes):
        todo = "It follows no streamed positions; other firmware or another drive is needed"
    elif not lower <= position <= upper:
        todo = (
            f"Move it by hand into drives.{dof.label}.travel, {scale * lower:.4g} to "
            f"{scale * upper:.4g} {unit}; or mend home, sign or counts_per_unit"
        )
    else:
        return Finding("drives", what, "ok", found, data=data)
    return Finding("drives", what, "missing", found, todo, data)


def _or_zero(link: Link, dof: Dof) -> int:
    try:
        return link.read(dof, objects.VENDOR)
    except AbsentError:
        return 0


def _settings(done: Commissioned, config: DrivesConfig) -> Finding:
    found = f"mode {done.mode.value} taken; {len(done.settings)} settings read back as set"
    data = {"mode": done.mode.value, "settings": done.settings, "absent": list(done.absent)}
    what = f"{done.name}: settings"
    if done.absent:
        waived = f"; waived: {', '.join(config.waive)}" if config.waive else ""
        todo = "See that something else protects what these would"
        found = f"{found}; it does not have {', '.join(done.absent)}{waived}"
        return Finding("drives", what, "note", found, todo, data)
    return Finding("drives", what, "ok", found, data=data)


def _heartbeats(link: Link, config: DrivesConfig) -> Finding:
    """Cycles as in a run, but all of them with a quick stop."""
    targets = [link.read(dof, objects.POSITION) for dof in Dof]
    link.operational()
    times: list[float] = []
    late, answers = 0, [0, 0, 0]
    end = time.monotonic() + max(CYCLES * config.cycle, 1.5 * config.heartbeat_timeout)
    while (began := time.monotonic()) < end:
        said = link.cycle([cia402.QUICK_STOP] * 3, targets)
        times.append(time.monotonic() - began)
        late += sum(one.age > 0 for one in said)
        answers = [one.answers for one in said]
        time.sleep(max(0.0, config.cycle - times[-1]))
    silent = [link.name(dof) for dof in Dof if not answers[dof]]
    what = "heartbeats and answers"
    data = {"cycles": len(times), "late": late, "median": statistics.median(times)}
    if silent:
        found = f"no answer to any of {len(times)} set-points from {', '.join(silent)}"
        todo = "Its process data (PDOs) are not as they were set; switch it off and on"
        return Finding("drives", what, "missing", found, todo, data)
    found = (
        f"both ways every {1e3 * config.heartbeat_period:.0f} ms; {len(times)} set-points, "
        f"answered in {1e3 * data['median']:.1f} ms (median), {1e3 * max(times):.1f} ms (worst), "
        f"{late} of {3 * len(times)} late"
    )
    if late:
        todo = "With real-time priority and nothing else running it should be none"
        return Finding("drives", what, "note", found, todo, data)
    return Finding("drives", what, "ok", found, data=data)
