"""The command ``tautscope calibrate stops``."""

import argparse

from tautscope.commands import arguments
from tautscope.commands.calibration_rig import add_yes, refuse_wrong_limits
from tautscope.commands.printing import print_json
from tautscope.commands.question import confirm
from tautscope.config.edit import writable_file, write_values
from tautscope.config.servos import PORTS
from tautscope.dof import Dof
from tautscope.errors import ConfigError, FieldError


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    stops = arguments.add_verb(
        kinds,
        "stops",
        _run,
        help="mechanical stops and zero position of a servo",
        description="Drive a servo slowly against both of its stops with little torque, and back. "
        "The first time, print its stops and a travel between them; later, print home, so that the "
        "stops are where they were: a servo forgets its turns without power. THE MOTOR MOVES; "
        "take the instrument off, have an emergency stop within reach.",
        extras=["hardware"],
    )
    stops.add_argument("dof", choices=[dof.label for dof in Dof], help="the motor")
    stops.add_argument(
        "--torque",
        type=float,
        default=0.3,
        metavar="SHARE",
        help="torque_limit during the search, 0 to 1 [%(default)s]",
    )
    add_yes(stops)
    stops.add_argument(
        "--write", action="store_true", help="write the values into the file of --config"
    )
    arguments.add_config(stops, required=True)
    arguments.add_json(stops)


def _run(options: argparse.Namespace) -> None:
    from tautscope.hardware.stops import find_stops  # noqa: PLC0415

    config, dof = arguments.article_config(options.config), Dof[options.dof.upper()]
    if config.drives is None or config.drives.protocol not in PORTS:
        found = None if config.drives is None else config.drives.protocol
        raise ConfigError("drives.protocol", found, "dynamixel or feetech, whose torque is limited")
    if not 0 < options.torque <= 1:
        raise FieldError("--torque", options.torque, "above 0 and at most 1")
    refuse_wrong_limits(options.config)
    if options.write:
        writable_file(options.config)
    confirm(f"{dof.label} will move to both of its stops.", options, config.camera)
    stops = find_stops(config, dof, options.torque)
    changes = stops.changes(config.drives, dof)
    ends = [stops.lower, stops.upper]
    print_json(options, {"dof": dof.label, "stops": ends, "changes": changes})
    for path, value in changes.items():
        print(f"{path} = {value}")
    if options.write:  # what is printed already is not lost by an error
        write_values(options.config, changes)
        print(f"# written: {options.config}")
