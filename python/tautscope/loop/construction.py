"""The blocks of the core, built from a configuration: every argument by name, units converted."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from tautscope import _core
from tautscope.config import Config, DofConfig
from tautscope.dof import Dof

T = TypeVar("T")


def each_dof(of: Callable[[Dof], T]) -> tuple[T, T, T]:
    """One thing per degree of freedom, in their order."""
    return of(Dof.INSERTION), of(Dof.ROTATION), of(Dof.BENDING)


def build_compensator(dof: DofConfig, compensate: bool = True) -> _core.Compensator:
    """The compensator of one DOF, Eqs. (2)-(3); without compensation its gain is 1."""
    return _core.Compensator(
        free_gain=dof.free_gain if compensate else 1.0,
        gain_limit=dof.gain_limit,
        delta_minus=dof.delta_minus,
        delta_plus=dof.delta_plus,
        recovery=dof.recovery,
    )


def build_adaptive_axis(config: Config, dof: Dof, compensate: bool = True) -> _core.AdaptiveAxis:
    """One DOF of profile ``best``; without compensation its gains are 1."""
    own, shared = config[dof], config.adaptive
    unit = own.update_distance
    free = own.free_gain if compensate else 1.0
    contact = min(shared.contact_gain, free)
    return _core.AdaptiveAxis(
        free_gain=free,
        contact_gain=contact,
        cautious_gain=min(shared.cautious_gain, contact),
        cautious_deviation=unit * shared.cautious_deviation,
        gain_limit=own.gain_limit,
        taper=unit * shared.taper,
        settling=unit * shared.settling,
        node_spacing=unit * shared.node_spacing,
        level_deviation=unit * shared.level_deviation,
        gain_deviation=shared.gain_deviation,
        local_deviation=unit * shared.local_deviation,
        correlation=unit * shared.correlation,
        # A deviation per square root of travel.
        level_drift=math.sqrt(unit) * shared.level_drift,
        gain_drift=shared.gain_drift / math.sqrt(unit),
        local_drift=math.sqrt(unit) * shared.local_drift,
        symmetry=shared.symmetry,
        change_rate=unit * shared.change_rate[dof],
        change_spare=unit * shared.change_spare,
        known_travel=unit * shared.known_travel,
        contact_distance=unit * shared.contact_distance,
        contact_moved=unit * shared.contact_moved,
        slope_tolerance=shared.slope_tolerance,
        model_deviation=unit * shared.model_deviation,
        state_correction=shared.state_correction,
        tremor_time=shared.tremor_time,
        period=config.control.period,
        delta_minus=own.delta_minus,
        delta_plus=own.delta_plus,
    )


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
    """The state estimation with its rank watch, Eqs. (13)-(16)."""
    return _core.StateEstimator(
        observable_deviation=each_dof(lambda dof: config[dof].observable_deviation)
    )


def build_weighted_estimator(config: Config) -> _core.WeightedEstimator:
    """The state estimation of profile ``best``, decision 0018."""
    settings = config.state_estimation
    return _core.WeightedEstimator(
        build_state_estimator(config),
        marker_deviation=settings.marker_deviation,
        model_deviation=settings.model_deviation,
        sideways_deviation=settings.sideways_deviation,
        outlier_distance=settings.outlier_distance,
        steps=settings.steps,
    )


def build_monitors(config: Config) -> _core.Monitors:
    """The monitors and the supervisor of the loop."""
    return _core.Monitors(config.safety, each_dof(lambda dof: config[dof]), config.control.period)


def build_friction(config: Config) -> tuple[float, float, float] | None:
    """What insertion and rotation share: arm [m], memory [m] and deviation; None for nothing."""
    settings = config.adaptive
    if not settings.one_friction:
        return None
    memory = settings.friction_memory * config.insertion.update_distance
    return config.instrument.diameter / 2, memory, settings.friction_deviation


def build_loop(config: Config, compensate: bool = True) -> _core.Reduction:
    """The whole loop, Fig. 6, without checks of what goes in: `HysteresisReduction` has those."""
    model = build_feature_model(config)
    monitors = build_monitors(config)
    span, period = config.control.history, config.control.period
    start_deviation = each_dof(lambda dof: config[dof].start_deviation)
    if config.profile == "best":
        rest = config.state_estimation.rest_deviation
        return _core.Reduction.adaptive(
            each_dof(lambda dof: build_adaptive_axis(config, dof, compensate)),
            model,
            build_weighted_estimator(config),
            monitors,
            span=span,
            period=period,
            start_deviation=start_deviation,
            rest_deviation=each_dof(lambda dof: config[dof].update_distance * rest),
            settling_time=config.state_estimation.settling_time,
            friction=build_friction(config),
        )
    return _core.Reduction(
        each_dof(lambda dof: build_compensator(config[dof], compensate)),
        each_dof(lambda dof: build_estimator(config[dof])),
        model,
        build_state_estimator(config),
        monitors,
        span=span,
        period=period,
        start_deviation=start_deviation,
    )
