"""Construction of the blocks of the core from a configuration."""

from __future__ import annotations

from typing import Any

import msgspec

from tautscope import _core
from tautscope.config import Config
from tautscope.dof import Dof


def core_settings(config: Config, compensate: bool = True) -> dict[str, Any]:
    """The table of settings that the core reads; without compensation every gain is 1."""
    document: dict[str, Any] = msgspec.to_builtins(config)
    if config.dof:
        # Not used with [[dof]]: only its defaults that are no lengths.
        document["insertion"] = msgspec.to_builtins(Config().insertion)
    elif not compensate:
        for dof in Dof:
            document[dof.label]["free_gain"] = 1.0
    return document


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
    return _core.FeatureModel(
        build_instrument(config),
        build_camera(config),
        translation=pose.translation,
        rotation=pose.rotation,
    )


def build_state_estimator(config: Config) -> _core.StateEstimator:
    """The state estimation with its rank monitored, Eqs. (13)-(16)."""
    insertion, rotation, bending = (config[dof].observable_deviation for dof in Dof)
    return _core.StateEstimator(observable_deviation=(insertion, rotation, bending))


def build_loop(config: Config, compensate: bool = True) -> _core.Reduction:
    """The whole loop, Fig. 6, without the input checks of `HysteresisReduction`."""
    return _core.Reduction(core_settings(config, compensate), compensate)
