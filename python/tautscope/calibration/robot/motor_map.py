"""Gains and zeros that a calibration found, as the map of section ``actuators``."""

from typing import Any

import numpy as np

from tautscope.calibration.robot.fit import RobotFit
from tautscope.config import Config


def motor_map(config: Config, found: RobotFit) -> tuple[dict[str, Any], dict[str, float]]:
    """Changes of section ``actuators`` with which gains are 1 and zeros 0, and their deviations.

    The tip is at zero + gain c, and the motors at M c + o; for a tip at c' they have to be at

        M diag(1 / gain) c' + o - M (zero / gain).

    A rig without the section takes the command: M is the identity. With a function of the user's in
    place of M there are no changes.
    """
    actuators, names = config.actuators, [dof.name for dof in config.dof]
    changes: dict[str, Any] = {}
    if actuators is None:
        matrix, offsets = np.eye(len(names)), np.zeros(len(names))
        units = [str(dof.unit) for dof in config.dof]
        changes = {"actuators.names": names, "actuators.units": units}
    elif actuators.map:
        return {}, {}
    else:
        matrix = np.array(actuators.matrix)
        offsets = np.array(actuators.offsets or [0.0] * len(matrix))
    (gain, zero), (gain_std, zero_std) = (
        np.array([[of.get(f"dof.{name}.{key}", 0.0) for name in names] for key in ("gain", "zero")])
        for of in (found.values, found.std)
    )
    scaled = matrix / gain + 0.0  # no -0.0
    by_gain = np.abs(scaled) * gain_std / np.abs(gain)
    by_offset = np.hypot(scaled @ np.diag(zero_std), by_gain * zero)
    changes["actuators.matrix"] = scaled.tolist()
    changes["actuators.offsets"] = (offsets - scaled @ zero).tolist()
    std = {
        f"actuators.matrix[{row}][{column}]": float(each)
        for (row, column), each in np.ndenumerate(by_gain)
    }
    total = np.sqrt(np.sum(by_offset**2, axis=1))
    return changes, std | {f"actuators.offsets[{k}]": float(each) for k, each in enumerate(total)}
