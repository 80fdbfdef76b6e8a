"""The command ``tautscope jog``."""

from __future__ import annotations

import argparse
import sys

from tautscope.commands import arguments
from tautscope.commands.article_config import article_config
from tautscope.commands.calibration_rig import refuse_wrong_limits
from tautscope.commands.printing import print_json
from tautscope.dof import Dof
from tautscope.errors import ConfigError, FieldError


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    jog = arguments.add_verb(
        verbs,
        "jog",
        help="move one motor slowly out and back",
        description="Move one motor slowly out and back in 4 s, while you watch the instrument. "
        "THE MOTOR MOVES; have an emergency stop within reach.",
        extras=["hardware"],
    )
    jog.add_argument("dof", choices=[dof.label for dof in Dof], help="the motor")
    jog.add_argument(
        "distance", type=float, metavar="DISTANCE", help="m or rad, at most 0.002 m or 0.2 rad"
    )
    jog.add_argument("--yes", action="store_true", help="start without asking")
    arguments.add_config(jog, required=True)
    arguments.add_json(jog)
    jog.set_defaults(run=_jog)


def _jog(options: argparse.Namespace) -> None:
    from tautscope.hardware.jog import check_distance, jog  # noqa: PLC0415

    config, dof, distance = (
        article_config(options.config),
        Dof[options.dof.upper()],
        options.distance,
    )
    if config.drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors")
    check_distance(dof, distance)
    refuse_wrong_limits(options.config)
    if not options.yes:
        question = f"The {dof.label} motor will move by {distance:g} and back. Type y to start: "
        print(question, end="", file=sys.stderr, flush=True)
        if sys.stdin.readline().strip().lower() not in ("y", "yes"):
            raise FieldError("answer", "no", "y, or the option --yes; nothing moved")
    largest, end = jog(config.drives, dof, distance)
    if options.json:
        print_json({"dof": dof.label, "moved": largest, "ended_at": end})
        return
    scale, unit = dof.display_scale, dof.display_unit
    print(f"{dof.label}: moved {scale * largest:.4f} {unit}, ended at {scale * end:.4f} {unit}")
