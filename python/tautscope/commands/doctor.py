"""The command ``tautscope doctor``."""

import argparse
import itertools
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.commands.question import ask
from tautscope.commands.rig_choice import add_rig, choose_rig
from tautscope.config import Config
from tautscope.config.placeholders import MARK, placeholders
from tautscope.errors import ConfigError
from tautscope.extras import missing_modules
from tautscope.hardware.doctor.calibration import check_calibration
from tautscope.hardware.doctor.check_result import CheckResult
from tautscope.hardware.doctor.rig import check_rig
from tautscope.hardware.signals import exit_on_signals
from tautscope.loop.rig import Rig

QUESTION = (
    "The rig will be reset, WHICH MAY MOVE ITS MOTORS to their start, and held there for 3 s. "
    "Type y to go on: "
)


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    doctor = arguments.add_verb(
        verbs,
        "doctor",
        _doctor,
        help="check a rig, and say what is missing and what to do",
        description="Check the computer, its cameras and CAN interfaces; with a configuration, "
        "open its camera, configure its drives and read the settings back. No motor of a "
        "configuration is enabled; a rig of --rig is reset, and MAY MOVE. "
        "Exit status 0 if nothing is missing, else 1.",
    )
    add_rig(
        doctor,
        "check a rig of your own with [[dof]] instead, while it is held for 3 s: shapes, units, "
        "clock, rates and delays, and whether its sensors determine every degree of freedom",
    )
    doctor.add_argument("--yes", action="store_true", help="reset the rig without asking")
    arguments.add_config(doctor)
    arguments.add_json(doctor)


def run_checks(config: Config, file: str | None) -> Iterator[CheckResult]:
    """Run all checks; without the `file` of a rig, no camera and no drive is opened."""
    from tautscope.hardware.doctor import camera, computer, drives  # noqa: PLC0415

    is_rig = file is not None
    yield from computer.check_computer(config)
    yield computer.check_disk(config, Path.cwd())
    yield camera.check_devices(needed=not is_rig)
    yield drives.check_interfaces(needed=not is_rig)
    if missing_modules("hardware"):
        return
    from tautscope.hardware.serial_numbers import camera_serial_number  # noqa: PLC0415

    if file is None:
        todo = (
            "tautscope doctor --config rig.toml; start from `tautscope config --config article_rig`"
        )
        yield CheckResult("drives", "configuration", "note", "none: no device was opened", todo)
        return
    yield from camera.check_source(config.camera)
    if config.drives is None:
        yield from check_calibration(config.calibration, camera_serial_number(config.camera), file)
        todo = "Add a section [drives] as in `tautscope config --config article_rig`"
        yield CheckResult("drives", "configuration", "missing", "no section [drives]", todo)
        return
    if config.control.period != config.drives.cycle:
        found = f"control.period {config.control.period} s, drives.cycle {config.drives.cycle} s"
        todo = "Make them equal: every tick of the loop sends a set-point"
        yield CheckResult("drives", "pace", "missing", found, todo)
    yield drives.check_commands(config)
    of_drives = drives.check_drives(config.drives)
    yield from of_drives
    serial_numbers = camera_serial_number(config.camera) | {
        each.data["dof"]: each.data["serial_number"]
        for each in of_drives
        if each.data.get("serial_number")
    }
    yield from check_calibration(config.calibration, serial_numbers, file)


def _check_own(
    options: argparse.Namespace, config: Config, make: Callable[[Config], Rig]
) -> Iterator[CheckResult]:
    """Check the drives, open the rig of ``--rig``, and check it if it may be reset."""
    if not config.dof:
        raise ConfigError("dof", "none", "degrees of freedom: [[dof]], in --config")
    if config.drives is not None:
        from tautscope.hardware.doctor import drives  # noqa: PLC0415

        of_drives = drives.check_drives(config.drives)
        yield from of_drives
        if any(each.status == "missing" for each in of_drives):
            return
    kinds = [kind for kind in ("robot", "latency") if getattr(config.calibration, kind) is not None]
    yield from check_calibration(config.calibration, {}, options.config, kinds=kinds)
    with closing(make(config)) as rig:
        period = f"control_period {1e3 * config.control.period:g} ms, as control.period"
        yield CheckResult("rig", options.rig, "ok", period)
        if options.yes or ask(QUESTION, config.camera).strip() in ("y", "yes"):
            yield from check_rig(rig, config)
        else:
            todo = "Answer y, or give --yes"
            yield CheckResult("rig", "samples", "note", "not checked: nothing moved", todo)


def _doctor(options: argparse.Namespace) -> int:
    if options.rig is None:
        arguments.refuse_unused(options, "--rig, which it resets", "yes")
        config = arguments.article_config(options.config)
        checks = run_checks(config, options.config)
    else:
        checks = _check_own(options, *choose_rig(options))
    marked = placeholders(options.config)
    findings: list[CheckResult] = []
    with exit_on_signals():
        if marked:
            todo = f"Replace each value, then delete the word {MARK} beside it"
            what = f"not replaced: {', '.join(marked)}"
            checks = itertools.chain(
                [CheckResult("configuration", "placeholders", "missing", what, todo)], checks
            )
        for found in checks:
            findings.append(found)
            _print(found)
    missing = sum(found.status == "missing" for found in findings)
    shown = [asdict(found) for found in findings]
    print_json(options, {"complete": not missing, "findings": shown})
    result = f"{missing} missing." if missing else "All there."
    print(f"\n{result} No motor was enabled." if options.rig is None else f"\n{result}")
    return 1 if missing else 0


def _print(found: CheckResult) -> None:
    mark = {"ok": "ok     ", "missing": "MISSING", "note": "       "}[found.status]
    print(f"{mark} {found.what}: {found.found}", flush=True)
    if found.todo:
        print(f"        -> {found.todo}", flush=True)
