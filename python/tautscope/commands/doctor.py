"""The verb ``doctor``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.config import load_config

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tautscope.config import Config
    from tautscope.hardware.doctor.finding import Finding


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the verb to the command's."""
    doctor = verbs.add_parser(
        "doctor",
        allow_abbrev=False,
        help="say what of a rig is there, what is missing, and what to type",
        description="Look at the computer, its cameras and CAN interfaces; with a configuration, "
        "open its camera, set its drives and read them back. No motor is enabled. Exit status 0 "
        "if all is there, 1 if something is missing.",
    )
    doctor.add_argument("config", nargs="?", metavar="CONFIG", help="TOML file of a rig")
    arguments.add_json(doctor)
    doctor.set_defaults(run=_doctor)


def examine(config: Config, *, is_rig: bool, folder: Path) -> Iterator[Finding]:
    """Everything, one after the other.

    Args:
        config: The rig's, or the default.
        is_rig: Whether it names a rig's camera and drives, which are then opened.
        folder: Where recordings would go.
    """
    from tautscope.hardware.doctor import camera, computer, drives  # noqa: PLC0415
    from tautscope.hardware.doctor.finding import Finding  # noqa: PLC0415

    libraries = computer.check_computer(config)
    yield from libraries
    yield computer.check_disk(config, folder)
    yield camera.check_devices(needed=not is_rig)
    yield drives.check_interfaces(needed=not is_rig)
    if not is_rig:
        todo = "uv run tautscope doctor CONFIG; configs/article_rig.toml is one to begin with"
        yield Finding("drives", "configuration", "note", "none: nothing was opened", todo)
        return
    yield from camera.check_source(config.camera)
    if config.drives is None:
        todo = "Add a section [drives], as in configs/article_rig.toml; docs/hardware.md says how"
        yield Finding("drives", "configuration", "missing", "no section [drives]", todo)
        return
    if config.control.period != config.drives.cycle:
        found = f"control.period {config.control.period} s, drives.cycle {config.drives.cycle} s"
        todo = "Make them the same: every tick of the loop is a set-point"
        yield Finding("drives", "pace", "missing", found, todo)
    yield from drives.check_drives(config.drives)


def _doctor(options: argparse.Namespace) -> int:
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    config = load_config(options.config)
    findings: list[Finding] = []
    with exit_on_signals():
        for found in examine(config, is_rig=options.config is not None, folder=Path.cwd()):
            findings.append(found)
            if not options.json:
                _print(found)
    missing = sum(found.status == "missing" for found in findings)
    if options.json:
        print_json({"complete": not missing, "findings": [found.to_json() for found in findings]})
    elif missing:
        print(f"\n{missing} missing. No motor was enabled.")
    else:
        print("\nAll there. No motor was enabled.")
    return 1 if missing else 0


def _print(found: Finding) -> None:
    mark = {"ok": "ok     ", "missing": "MISSING", "note": "       "}[found.status]
    print(f"{mark} {found.what}: {found.found}", flush=True)
    if found.todo:
        print(f"        -> {found.todo}", flush=True)
