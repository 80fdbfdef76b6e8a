"""Protocols of ``tautscope run``: the article's experiment, and that of the desktop rig."""

import argparse
import datetime
import json
from pathlib import Path

from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.hardware.doctor.computer import check_computer
from tautscope.log.header import software_versions

BENDS = (0, 90, 180, 360)
"""Bends of the desktop rig's channel [degrees]."""
DESKTOP_PERIODS = 3
"""Periods per DOF of protocol ``desktop``: the fewest that the experiment may have."""
ENVIRONMENT = "environment.json"
_ABOUT = """A record of the desktop rig of tautscope, made by `tautscope run --protocol desktop`.

report.html             tables and figures; open it in a browser
compensated.mcap        log of the run with compensation: images, references, motors, estimates
uncompensated.mcap      log of the same motion without it, which was recorded first
config.toml             the configuration, every key
{environment:<24}bend of the channel, software, computer
*.csv                   tables of both runs; recording*.toml describe them

Before you share this folder look through {environment} and run.json: they name your computer's
system and folders. docs/records.md of tautscope says where records go, and under which licence.
"""


def add_protocol(parser: argparse.ArgumentParser) -> None:
    """``--protocol`` and ``--bend``."""
    parser.add_argument(
        "--protocol",
        choices=("article", "desktop"),
        default="article",
        help="desktop: three periods per DOF without, then with compensation, and a folder to "
        "share, see docs/records.md [%(default)s]",
    )
    parser.add_argument(
        "--bend",
        type=int,
        choices=BENDS,
        help="of --protocol desktop: bend of the channel [degrees]",
    )


def apply_protocol(options: argparse.Namespace) -> None:
    """Set what the protocol determines: both runs, and three periods.

    Raises:
        FieldError: ``--bend`` is missing, or is of another protocol; ``--reference`` or ``--rig``
            is in the protocol's place.
    """
    if options.protocol != "desktop":
        if options.bend is not None:
            raise FieldError("--bend", options.bend, "--protocol desktop, of whose rig it is")
        return
    for name in ("reference", "rig"):
        if getattr(options, name) is not None:
            raise FieldError(
                "--protocol", "desktop", f"no --{name}, which is another motion or rig"
            )
    if options.bend is None:
        allowed = f"--bend with the bend of the channel in degrees: {', '.join(map(str, BENDS))}"
        raise FieldError("--protocol", "desktop", allowed)
    options.compare = True
    options.periods = options.periods or DESKTOP_PERIODS


def write_environment(options: argparse.Namespace, config: Config, folder: Path) -> None:
    """Write what a shared record needs beside log and report: `ENVIRONMENT` and README.txt.

    Args:
        options: Of ``tautscope run``.
        config: Of the run.
        folder: That of the run.
    """
    facts = {
        "protocol": options.protocol,
        "bend": options.bend,
        "recorded": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "software": software_versions(),
        "computer": {check.what: check.found for check in check_computer(config)},
    }
    (folder / ENVIRONMENT).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    text = _ABOUT.format(environment=ENVIRONMENT)
    (folder / "README.txt").write_text(text, encoding="utf-8")
