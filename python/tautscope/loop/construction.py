"""Construction of the blocks of the core from a configuration."""

from __future__ import annotations

from typing import Any

import msgspec

from tautscope import _core
from tautscope.config import Config, DofConfig, DofEntry
from tautscope.config.axes import EXPECTED_WIDTH, RANGE, SPEED, START_DEVIATION
from tautscope.dof import Dof


def core_settings(config: Config, compensate: bool = True) -> dict[str, Any]:
    """The table of settings that the core reads; without compensation every gain is 1."""
    document: dict[str, Any] = msgspec.to_builtins(config)
    if not compensate:
        for dof in Dof:
            document[dof.label]["free_gain"] = 1.0
    return document


def build_estimator(dof: DofConfig) -> _core.Estimator:
    """The hysteresis estimator of one DOF, Eqs. (4)-(6)."""
    return _core.Estimator(
        update_distance=dof.update_distance,
        contact_tolerance=dof.contact_tolerance,
        smoothing_factor=dof.smoothing_factor,
        delta_minus=dof.delta_minus,
        delta_plus=dof.delta_plus,
    )


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


def axes_settings(config: Config, compensate: bool = True) -> dict[str, Any]:
    """The table of settings that the core reads of a robot with [[dof]]."""
    document: dict[str, Any] = msgspec.to_builtins(config)
    names = [dof.friction or f"{index} alone" for index, dof in enumerate(config.dof)]
    safety = document["safety"] | {
        "width_limit": [dof.width_limit for dof in config.dof],
        "offset_limit": [_OFFSET_LIMIT * dof.width_limit for dof in config.dof],
        "reference_speed": [_speed(dof) for dof in config.dof],
        "command_speed": [_COMMAND_SPEED * dof.gain_limit * _speed(dof) for dof in config.dof],
        "command_travel": [
            dof.range or (-RANGE * dof.width_limit, RANGE * dof.width_limit) for dof in config.dof
        ],
        "reference_count": [dof.width_limit / _COUNTS for dof in config.dof],
        # An encoder repeats its value bit for bit while the slack is crossed.
        "frozen_travel": 2 * _UPDATES,
    }
    return {
        "dof": [_dof_settings(dof, compensate) for dof in config.dof],
        "group": [names.index(name) for name in names],
        "lever": [dof.lever for dof in config.dof],
        "control": document["control"],
        "safety": safety,
        "law": document["law"],
        "estimation": document["estimation"],
    }


# The article's instrument has about these ratios of its lengths to safety.width_limit.
_OFFSET_LIMIT = 2 / 3
_UPDATES = 50
_COUNTS = 250
_COMMAND_SPEED = 2.0


def _speed(dof: DofEntry) -> float:
    return SPEED * dof.width_limit if dof.speed is None else dof.speed


def _dof_settings(dof: DofEntry, compensate: bool) -> dict[str, float]:
    width = dof.width_limit
    article: dict[str, float] = msgspec.to_builtins(Config().insertion)
    return article | {
        "update_distance": width / _UPDATES,
        "expected_width": dof.expected_width or EXPECTED_WIDTH * width,
        "start_deviation": START_DEVIATION * width,
        "free_gain": dof.gain_limit if compensate else 1.0,
        "gain_limit": dof.gain_limit,
        "delta_minus": dof.delta_minus,
        "delta_plus": dof.delta_plus,
    }


def build_axes(config: Config, compensate: bool = True) -> _core.AxesReduction:
    """The loop of a robot with [[dof]], without the input checks of `HysteresisReduction`."""
    return _core.AxesReduction(axes_settings(config, compensate), len(config.dof))


def build_loop(config: Config, compensate: bool = True) -> _core.Reduction:
    """The whole loop, Fig. 6, without the input checks of `HysteresisReduction`."""
    return _core.Reduction(core_settings(config, compensate), config.profile)
