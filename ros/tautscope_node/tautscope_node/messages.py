"""Conversions between messages and the loop; nothing of ROS is imported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope.config import CameraConfig, Config
from tautscope.loop.reduction import Report, Status

DEFAULT_JOINTS = ["insertion", "rotation", "bending"]
CALIBRATION_TOLERANCE = 0.01
"""Largest difference of focal length or principal point from the configuration, of the width."""
MEASURED = (Status.OK, Status.HELD, Status.PARTIAL)
"""Image updates that measured the tip."""


def joints_of(names: Sequence[str], config: Config) -> list[str]:
    """The joints' names by the parameter; of a robot with [[dof]] by default those of its entries.

    Raises:
        ValueError: They are not different names, one per degree of freedom.
    """
    labels = [dof.label for dof in config.dofs]
    joints = labels if config.dof and list(names) == DEFAULT_JOINTS else list(names)
    if len(joints) != len(labels) or len(set(joints)) != len(labels):
        raise ValueError(
            f"Parameter joints: expected {len(labels)} different names, of {', '.join(labels)}, "
            f"got {', '.join(names)}"
        )
    return joints


def nanoseconds(stamp: Any) -> int:
    """A stamp, builtin_interfaces/Time, in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def positions(message: Any, joints: Sequence[str]) -> NDArray[np.float64] | None:
    """Positions (n,) of the joints in a JointState: by name, by order where it has no names.

    None if one is missing.
    """
    names, values = list(message.name), list(message.position)
    if not names:
        return np.array(values, np.float64) if len(values) == len(joints) else None
    if len(values) < len(names) or not set(joints) <= set(names):
        return None
    return np.array([values[names.index(joint)] for joint in joints], np.float64)


def calibration_problem(message: Any, camera: CameraConfig) -> str:
    """What a CameraInfo has differently from the configuration; empty if nothing is."""
    if (message.width, message.height) != (camera.width, camera.height):
        return (
            f"camera_info: {message.width} x {message.height} px, "
            f"configured {camera.width} x {camera.height} px"
        )
    matrix = np.array(message.k, np.float64).reshape(3, 3)
    if matrix[0, 0] == 0:
        return ""  # Not calibrated.
    configured = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    found = matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    if (np.abs(found - configured) > CALIBRATION_TOLERANCE * camera.width).any():
        return f"camera_info: fx, fy, cx, cy {found.round(1)}, configured {configured.round(1)}"
    return ""


def is_measured(report: Report) -> bool:
    """Whether an image update measured the tip; else the stamp of `measured_js` is 0."""
    return report.status in MEASURED


def offsets(report: Report) -> list[float]:
    """delta_minus and delta_plus of each DOF, one after the other (2 n,)."""
    values = np.stack([report.delta_minus, report.delta_plus], axis=1)
    return [float(value) for value in values.ravel()]
