"""Construction of the blocks of the core from a configuration."""

from typing import Any

import msgspec
import numpy as np

from tautscope import _core
from tautscope.config import Config
from tautscope.dof import Dof


def core_settings(config: Config, compensate: bool = True) -> dict[str, Any]:
    """The table of settings that the core reads; without compensation every gain is 1.

    No command is faster than the motors of ``[drives]``, which would refuse it.
    """
    document: dict[str, Any] = msgspec.to_builtins(config)
    told = [dof.command_speed for dof in config.dof] or config.safety.command_speed
    speeds = [
        speed if own is None else min(own, speed)
        for own, speed in zip(told, motor_speeds(config), strict=False)
    ]
    if config.dof:
        for entry, speed in zip(document["dof"], speeds, strict=False):
            entry["command_speed"] = speed
        # Not used with [[dof]]: only its defaults that are no lengths.
        document["insertion"] = msgspec.to_builtins(Config().insertion)
        return document
    if speeds:
        document["safety"]["command_speed"] = speeds
    if not compensate:
        for dof in Dof:
            document[dof.label]["free_gain"] = 1.0
        document["law"]["free_gain"] = 1.0
    return document


def motor_speeds(config: Config) -> list[float]:
    """Speeds (n,) of the DOFs [m/s or rad/s] at which no motor of ``[drives]`` is too fast.

    Of motors = M q, |dq_n| <= w_n min_m (v_m / sum_k |M_mk| w_k) over the motors m that n moves,
    with the speed limits v and the width limits w. Empty without drives, and with
    ``actuators.map``, whose motors are a function of the user's.
    """
    drives, actuators = config.drives, config.actuators
    if drives is None or (actuators is not None and actuators.map):
        return []
    limits = np.array([drives[motor].speed_limit for motor in drives.all_motors])
    if actuators is None:
        return [float(limit) for limit in limits]
    widths = np.array([dof.width_limit for dof in config.dof])
    moved = np.abs(actuators.matrix) * widths
    with np.errstate(divide="ignore"):
        shares = np.where(moved > 0.0, (limits / moved.sum(axis=1))[:, None], np.inf)
    return [float(speed) for speed in widths * shares.min(axis=0)]


def build_instrument(config: Config) -> _core.Instrument:
    """The kinematics, Eq. (7)."""
    instrument = config.instrument
    return _core.Instrument(
        bending_length=instrument.bending_length,
        marker_a=instrument.marker_a,
        marker_b=instrument.marker_b,
        radius=instrument.diameter / 2,
        band_length=instrument.band_length,
    )


def build_camera(config: Config) -> _core.Camera:
    """The projection, Eq. (8)."""
    camera = config.camera
    return _core.Camera(
        fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy, distortion=camera.distortion
    )


def build_feature_model(config: Config) -> _core.FeatureModel:
    """The predicted features and their interaction matrix, Eqs. (9)-(11)."""
    pose = config.camera.camera_from_guide
    parts = build_instrument(config), build_camera(config)
    return _core.FeatureModel(*parts, translation=pose.translation, rotation=pose.rotation)


def build_state_estimator(config: Config) -> _core.StateEstimator:
    """The state estimation with its rank monitored, Eqs. (13)-(16)."""
    insertion, rotation, bending = (config[dof].observable_deviation for dof in Dof)
    return _core.StateEstimator(observable_deviation=(insertion, rotation, bending))


def build_loop(config: Config, compensate: bool = True) -> _core.Reduction:
    """The whole loop, Fig. 6, without the input checks of `HysteresisReduction`."""
    return _core.Reduction(core_settings(config, compensate), compensate)
