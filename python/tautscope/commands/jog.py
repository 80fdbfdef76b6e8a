"""The command ``tautscope jog``."""

import argparse
from contextlib import closing
from dataclasses import asdict

from tautscope.commands import arguments
from tautscope.commands.calibration_rig import refuse_wrong_limits
from tautscope.commands.printing import print_json
from tautscope.commands.question import confirm
from tautscope.commands.rig_choice import add_rig, choose_rig
from tautscope.dof import Dof, display_text
from tautscope.errors import ConfigError, FieldError


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    jog = arguments.add_verb(
        verbs,
        "jog",
        _jog,
        help="move one motor slowly out and back",
        description="Move one motor slowly out and back in 4 s, while you watch the instrument. "
        "THE MOTOR MOVES; have an emergency stop within reach.",
        extras=["hardware"],
    )
    jog.add_argument("dof", help="the motor: insertion, rotation, bending, or a name of [[dof]]")
    jog.add_argument(
        "distance",
        type=float,
        metavar="DISTANCE",
        help="m or rad, at most 0.002 m or 0.2 rad; with --rig at most width_limit",
    )
    add_rig(
        jog,
        "move a degree of freedom of a rig of your own with [[dof]], and print what its sensors "
        "measured",
    )
    jog.add_argument(
        "--reset-faults",
        action="store_true",
        help="reset faults of the drives first; find their cause before; not with --rig",
    )
    jog.add_argument("--yes", action="store_true", help="start without asking")
    arguments.add_config(jog, required=True)
    arguments.add_json(jog)


def _jog(options: argparse.Namespace) -> None:
    from tautscope.hardware.jog import check_distance, jog, jog_rig  # noqa: PLC0415

    distance = options.distance
    if options.rig is None:
        config = arguments.article_config(options.config)
    else:
        config, make_rig = choose_rig(options)
    names = [dof.label for dof in config.dofs]
    if options.dof not in names:
        raise FieldError("dof", options.dof, f"one of {', '.join(names)}")
    index = names.index(options.dof)
    dof = config.dofs[index]
    if options.rig is None and config.drives is None:
        raise ConfigError("drives", None, "a section [drives] that names the motors, or --rig")
    if options.rig is not None and options.reset_faults:
        raise FieldError("--reset-faults", options.rig, "no --rig, which starts its motors itself")
    check_distance(dof, distance)
    refuse_wrong_limits(options.config)
    before = "After a reset, which may move all motors to their start, " if options.rig else ""
    before = "Faults of all drives are reset. " if options.reset_faults else before
    question = f"{before}{dof.label} will move by {display_text([distance], [dof])} and back."
    confirm(question, options, config.camera)
    if options.rig is not None:
        with closing(make_rig(config)) as rig:
            largest, end, seen = jog_rig(rig, config, index, distance)
    else:
        assert config.drives is not None
        largest, end = jog(config.drives, Dof(index), distance, reset_faults=options.reset_faults)
        seen = []
    found = {"dof": dof.label, "moved": largest, "ended_at": end}
    sensors = {"sensors": [asdict(each) for each in seen]} if options.rig else {}
    print_json(options, found | sensors)
    scale, unit = dof.display_scale, dof.display_unit
    print(f"{dof.label}: moved {scale * largest:.4f} {unit}, ended at {scale * end:.4f} {unit}")
    for each in seen:
        print(
            f"{each.what}, sensor {each.sensor}: moved {each.scale * each.moved:.4g} {each.unit}, "
            f"ended at {each.scale * each.ended_at:.4g} {each.unit}"
        )
