"""``tautscope calibrate latency --rig``: delay of the sensors of a rig of one's own."""

from __future__ import annotations

import argparse

from tautscope.commands.calibration_output import finish
from tautscope.commands.robot import DURATION
from tautscope.config import load_config
from tautscope.errors import ConfigError, FieldError

QUESTION = (
    "THE MOTORS WILL MOVE, over 60 % of each range. Keep tissue and hands away, the emergency stop "
    "within reach. Type y to start: "
)


def run(options: argparse.Namespace) -> int:
    """Move the rig without compensation, and print or write measurement.delays.

    Raises:
        CalibrationError: No sensor's delay is determined.
        TautscopeError: Errors of the rig.
    """
    from tautscope.calibration.result import CalibrationResult  # noqa: PLC0415
    from tautscope.calibration.sensor_delay import find_delay, move  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.report.operator_motion import motion_of  # noqa: PLC0415
    from tautscope.runs.rigs import rig_maker  # noqa: PLC0415

    config = load_config(options.config)
    if not config.dof:
        raise ConfigError("dof", "none", "degrees of freedom: [[dof]]; without --rig the camera's")
    _confirm(options)
    motion = motion_of(config, options.seed or 0, options.seconds or DURATION / 2)
    rig = rig_maker(options.rig)(config)
    try:
        with progress_bar("motion") as progress:
            passage = move(rig, motion, config, progress)
    finally:
        rig.close()
    sensors = sorted({each.sensor for _, each in passage.measurements} | {0})
    found = [find_delay(passage, config, sensor) for sensor in range(sensors[-1] + 1)]
    result = CalibrationResult(
        "latency",
        {"measurement.delays": [max(each.delay, 0.0) for each in found]},
        {f"measurement.delays[{index}]": each.std for index, each in enumerate(found)},
        notes=tuple(
            f"sensor {index}: {each.delay:.3f} s, standard deviation {each.std:.3f} s; innovations "
            f"{each.misfit:.2f} times those without it"
            for index, each in enumerate(found)
        ),
        data={"delays": [each.delay for each in found], "std": [each.std for each in found]},
    )
    finish(options, result)
    return 0


def _confirm(options: argparse.Namespace) -> None:
    try:
        answer = "y" if options.yes else input(QUESTION)
    except EOFError:
        answer = ""
    if answer.strip() not in ("y", "yes"):
        raise FieldError("answer", "no", "y, or the option --yes; nothing moved")
