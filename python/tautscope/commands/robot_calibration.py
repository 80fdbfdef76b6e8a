"""``tautscope calibrate robot``, and ``calibrate latency --rig``: any robot, from a sweep."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from contextlib import closing
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_output
from tautscope.commands.calibration_rig import add_yes, confirm_motion, refuse_wrong_limits
from tautscope.commands.printing import progress_bar
from tautscope.commands.rig_choice import add_rig, choose_rig
from tautscope.commands.robot import DURATION, add_seconds
from tautscope.config import Config
from tautscope.errors import CalibrationError, ConfigError

if TYPE_CHECKING:
    from tautscope.calibration.robot import RobotFit

SYSTEMATIC = 0.01
"""Standard deviation of what loops take for a delay, or the reverse [s]."""
_REMEDY = "Check that each motor moves the tip, and move for longer or farther"


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    robot = arguments.add_verb(
        kinds,
        "robot",
        _run,
        help="kinematics, zeros, gains and delay of a rig with [[dof]]",
        description="Move all degrees of freedom by slow sines over 80 % of their ranges, and fit "
        "lengths, pose of the sensor's frame, delay, zeros and gains to what was measured. THE "
        "MOTORS MOVE, after a question.",
        extras=["analysis"],
    )
    add_rig(robot, "a rig of your own", required=True)
    robot.add_argument(
        "--keep",
        action="append",
        default=[],
        metavar="NAME",
        help="a parameter that stays as configured, as kinematics.tip_length, or all of "
        "kinematics.base_rotation; repeatable",
    )
    add_seconds(robot, "the sweep", DURATION / 2)
    add_yes(robot)
    calibration_output.add_options(robot)


def _run(options: argparse.Namespace) -> None:
    calibration_output.check_options(options)
    config, found = _sweep(options, options.keep)
    if found.undetermined:
        keep = " ".join(f"--keep {name}" for name in found.undetermined if "gain" not in name)
        raise CalibrationError(
            "The sweep does not determine " + ", ".join(found.undetermined),
            f"{_REMEDY}, or keep what is configured: {keep}" if keep else _REMEDY,
        )
    calibration_output.finish(options, result("robot", found, config))


def run_latency(options: argparse.Namespace) -> None:
    """The delays alone, with the kinematics as configured."""
    config, found = _sweep(options, ("kinematics",))
    lost = [name for name in found.undetermined if name.startswith("measurement.delays")]
    if lost:
        what = "The sweep does not determine " + ", ".join(lost)
        raise CalibrationError(what, _REMEDY)
    calibration_output.finish(options, result("latency", found, config))


def _sweep(options: argparse.Namespace, keep: Sequence[str]) -> tuple[Config, RobotFit]:
    from tautscope.calibration.robot import fit, move, sweep_motion  # noqa: PLC0415
    from tautscope.calibration.robot.parameters import check_keep  # noqa: PLC0415

    config, make = choose_rig(options)
    if not config.dof:
        raise ConfigError("dof", "none", "degrees of freedom: [[dof]]")
    refuse_wrong_limits(options.config)
    check_keep(config, keep)  # after the motion it would be too late
    sweep = sweep_motion(config, options.seconds or DURATION / 2)
    confirm_motion(options, "over 80 % of each range. Keep", config)
    with closing(make(config)) as rig, progress_bar("sweep") as progress:
        record = move(rig, sweep, config, progress)
    return config, fit(record, config, keep)


def result(kind: str, found: RobotFit, config: Config) -> CalibrationResult:
    """The fit in the form that all calibrations have; of ``latency`` the delays alone."""
    from tautscope.calibration.robot.parameters import motor_map, with_values  # noqa: PLC0415

    motors, motor_std = motor_map(config, found.values, found.std)
    values = {**with_values(config, found.values), **found.deviations, **motors}
    if kind == "latency":
        values = {"measurement.delays": values["measurement.delays"]}
    std = {
        name: math.hypot(each, SYSTEMATIC) if name.startswith("measurement.delays") else each
        for name, each in (*found.std.items(), *motor_std.items())
        if name.partition("[")[0] in values
    }
    notes = []
    for name in values:
        section, key = name.split(".")
        before = getattr(getattr(config, section), key, None)
        notes.append(f"{name} was {'not set' if before in (None, ()) else before}")
    oldest = config.safety.frame_age
    for name, each in std.items():
        if not name.startswith("measurement.delays"):
            continue
        if (delay := found.values[name]) < -2 * each:
            notes.append(
                f"Measurements are stamped {-1e3 * delay:.0f} ms before the motors' clock: {name} "
                "is set to 0, which cannot express it. Check the clock of the sensor"
            )
        if delay > oldest and "late" not in config.safety.off:
            notes.append(
                f"{name} is above safety.frame_age = {oldest:g} s, from which on measurements are "
                f"too old: set safety.frame_age to more than {delay:.2f} s before --write"
            )
    is_written = "actuators.matrix" in values
    written = "in actuators.matrix and offsets" if is_written else "not written"
    for dof in config.dof:
        zero, gain, slack = (f"dof.{dof.name}.{key}" for key in ("zero", "gain", "slack"))
        at = ""
        if zero in found.values:
            at = f", zero {found.values[zero]:.4g} +- {found.std[zero]:.2g} {dof.unit}"
        notes.append(
            f"{dof.name}: gain {found.values[gain]:.4g} +- {found.std[gain]:.2g}{at}, slack "
            f"{found.values[slack]:.3g} {dof.unit}; gain and zero are {written}"
        )
    data = {"fit": dict(found.values)}
    return CalibrationResult(kind, values, std, notes=tuple(notes), data=data)
