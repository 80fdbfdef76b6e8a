"""Calibration records whose truth is known: plays of this folder, centroids by OpenCV's camera."""

import cv2
import numpy as np
from numpy.typing import NDArray
from play_model import play
from tautscope.calibration.geometry import Recording
from tautscope.calibration.motion import sweep_motion
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model

Floats = NDArray[np.float64]
HALF_WIDTHS = (4.5e-3, 0.7, 0.5)
DELAY = 0.12
TILT = (0.05, -0.04, 0.02)
"""Rotation by which the actual guide differs [rad]."""
SHIFT = (2e-3, -1.5e-3, 3e-3)


def told() -> Config:
    """The configuration before the calibration."""
    return load_config()


def actual() -> Config:
    """The rig: everything that is calibrated differs from `told`."""
    config = told()
    camera, instrument = config.camera, config.instrument
    pose = camera.camera_from_guide
    turn, nominal = (cv2.Rodrigues(np.array(each))[0] for each in (TILT, pose.rotation))
    return config.replace(
        **{
            "camera.camera_from_guide.rotation": cv2.Rodrigues(turn @ nominal)[0].ravel().tolist(),
            "camera.camera_from_guide.translation": [
                old + shift for old, shift in zip(pose.translation, SHIFT, strict=True)
            ],
            "camera.fx": camera.fx * 1.02,
            "camera.fy": camera.fy * 1.02,
            "instrument.bending_length": instrument.bending_length * 0.94,
            "instrument.marker_a": instrument.marker_a + 0.5e-3,
            "instrument.marker_b": instrument.marker_b - 0.4e-3,
        }
    )


def states_of(motors: Floats, elastic: float = 0.0) -> Floats:
    """Tips (n, 3) that lag behind motors (n, 3) by a play each; insertion follows by a share."""
    columns = [
        play(motors[:, dof], -half, half, start=motors[0, dof])
        for dof, half in zip(Dof, HALF_WIDTHS, strict=True)
    ]
    columns[0] = (1 - elastic) * columns[0] + elastic * motors[:, 0]
    return np.stack(columns, axis=1)


def simulate(
    seed: int = 0,
    noise: float = 0.3,
    duration: float = 60.0,
    rig: Config | None = None,
    elastic: float = 0.0,
) -> tuple[Recording, Floats]:
    """A record of the calibration motion, and the true states of its images."""
    rig = rig or actual()
    time = np.arange(0.0, duration, 0.01)
    reference = sweep_motion(told(), duration)
    motors = np.array([reference(at) for at in time])
    states = states_of(motors, elastic)[::8]
    features = build_feature_model(rig).predict_all(states, np.zeros(len(states)))[0]
    features += noise * np.random.default_rng(seed).standard_normal(features.shape)
    camera = rig.camera
    size = np.array([camera.width, camera.height] * 2)
    features[~((features > 0) & (features < size)).all(axis=1)] = np.nan
    return Recording(time, motors, time[::8] + DELAY, features), states
