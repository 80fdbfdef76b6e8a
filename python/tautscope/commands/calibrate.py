"""The command ``tautscope calibrate``: one file per kind of calibration."""

from tautscope.commands import (
    arguments,
    calibrate_all,
    calibrate_camera,
    calibrate_colour,
    calibrate_geometry,
    calibrate_latency,
    calibrate_stops,
    robot_calibration,
)


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    calibrate = arguments.add_verb(
        verbs,
        "calibrate",
        help="find settings of a rig from images and motions",
        description="Find settings of a rig from images and motions, and print them as TOML.",
    )
    kinds = calibrate.add_subparsers(dest="kind", required=True, metavar="WHAT")
    calibrate_all.add_parser(kinds)
    calibrate_camera.add_parser(kinds)
    calibrate_colour.add_parser(kinds)
    calibrate_geometry.add_parser(kinds)
    calibrate_latency.add_parser(kinds)
    calibrate_stops.add_parser(kinds)
    robot_calibration.add_parser(kinds)
