"""The whole configuration, as a structure and as a nested dictionary for TOML."""

from __future__ import annotations

import logging
from typing import Any, Literal

import msgspec
from msgspec import field

from tautscope.config.actuators import ActuatorsConfig, check_actuators, check_motors
from tautscope.config.axes import DofEntry, KinematicsConfig, MeasurementConfig
from tautscope.config.calibration import CalibrationConfig
from tautscope.config.camera import CameraConfig
from tautscope.config.checks import (
    check_axes,
    check_offsets,
    check_ranges,
    check_references,
    check_topics,
    check_unused,
)
from tautscope.config.control import ControlConfig, DofConfig, EstimationConfig, LawConfig
from tautscope.config.drive_defaults import with_drive_defaults
from tautscope.config.drives import DrivesConfig
from tautscope.config.experiment import ExperimentConfig, InstrumentConfig
from tautscope.config.recording import RecordingConfig
from tautscope.config.safety import SafetyConfig
from tautscope.config.section import Section, converted_value, require, without_numpy
from tautscope.config.twin import TwinConfig
from tautscope.config.vision import VisionConfig
from tautscope.dof import Dof, NamedDof
from tautscope.errors import ConfigError

_LOG = logging.getLogger(__name__)

Profile = Literal["paper", "best"]

_WITHOUT_EFFECT = ("adaptive", "state_estimation")
"""Sections that older documents have and that set nothing."""
_RENAMED: dict[str, Profile] = {"plays": "best"}
"""Profiles by the names in older documents."""


class Config(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All settings of a run. The defaults are the article's experiment with profile ``best``."""

    profile: Profile = "best"
    """Scheme of compensation and estimation: ``paper`` is the article's, ``best`` that of
    docs/best.md."""
    law: LawConfig = field(default_factory=LawConfig)
    estimation: EstimationConfig = field(default_factory=EstimationConfig)
    insertion: DofConfig = DofConfig(
        update_distance=0.4e-3, observable_deviation=2e-3, expected_width=8e-3, start_deviation=5e-3
    )
    rotation: DofConfig = DofConfig(
        update_distance=0.04, observable_deviation=0.1, expected_width=1.75, start_deviation=0.6
    )
    bending: DofConfig = DofConfig(
        update_distance=0.02, observable_deviation=0.1, expected_width=1.0, start_deviation=0.5
    )
    instrument: InstrumentConfig = field(default_factory=InstrumentConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    vision: VisionConfig = field(default_factory=VisionConfig)
    control: ControlConfig = field(default_factory=ControlConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
    experiment: ExperimentConfig = field(default_factory=ExperimentConfig)
    twin: TwinConfig = field(default_factory=TwinConfig)
    calibration: CalibrationConfig = field(default_factory=CalibrationConfig)
    drives: DrivesConfig | None = None
    """Motors of a rig; they have no default."""
    dof: tuple[DofEntry, ...] = ()
    """The degrees of freedom of another robot; without them those of the article."""
    kinematics: KinematicsConfig = field(default_factory=KinematicsConfig)
    measurement: MeasurementConfig = field(default_factory=MeasurementConfig)
    actuators: ActuatorsConfig | None = None
    """Motors that are not the degrees of freedom."""

    def _check(self) -> None:
        article = {dof: self[dof] for dof in Dof}
        check_references(self.safety, self.experiment, article)
        check_axes(self.dof, self.kinematics, self.safety, self.estimation)
        check_offsets(self.dof, self.safety, article)
        check_ranges(self)
        check_unused(self)
        check_topics(self.kinematics, self.measurement)
        stall, least = self.safety.stall, 2 * self.control.period
        allowed = f"at least {least:g}, two of control.period: each tick would stop the motion"
        require(stall >= least, "safety.stall", stall, allowed)
        limits = {"control.history": self.control.history}
        if "late" not in self.safety.off:
            limits["safety.frame_age"] = self.safety.frame_age
        delays = enumerate(self.measurement.delays)
        ages = {f"measurement.delays[{index}]": delay for index, delay in delays}
        for key, age in (ages | {"safety.frame_age": self.safety.frame_age}).items():
            for name, limit in limits.items():
                require(age <= limit, key, age, f"at most {name} = {limit:g}")
        if self.actuators is not None:
            check_actuators(self.actuators, self.dof)
        if self.drives is not None:
            check_motors(self.drives, self.actuators, self.dof, self.safety)

    @property
    def dofs(self) -> tuple[NamedDof, ...]:
        """The degrees of freedom in the order of every array, with name and unit."""
        return self.dof or tuple(Dof)

    def __getitem__(self, dof: Dof) -> DofConfig:
        """The settings of one DOF."""
        settings: DofConfig = getattr(self, dof.label)
        return settings

    def replace(self, **changes: Any) -> Config:
        """A checked copy with changes by dotted path: ``replace(**{"twin.seed": 3})``.

        Raises:
            ConfigError: As `load_config`.
        """
        document = to_document(self)
        for path, value in changes.items():
            *sections, key = path.split(".")
            place = document
            for section in sections:
                place = place.setdefault(section, {})
                if not isinstance(place, dict):
                    raise ConfigError(path, value, f"no such key: {section} has none below it")
            place[key] = value
        return _checked(document)


def check_config(config: Config) -> Config:
    """The configuration; a `ConfigError` if it is something else, as the name of a file."""
    if not isinstance(config, Config):
        raise ConfigError("config", config, "a tautscope.Config, as load_config(path) returns it")
    return config


def from_document(document: dict[str, Any]) -> Config:
    """Make a checked `Config` of a nested dictionary; keys not in it keep their defaults.

    Sections that only older documents have are ignored with a warning.

    Raises:
        ConfigError: As `load_config`.
    """
    document = dict(document)
    ignored = [f"[{name}]" for name in _WITHOUT_EFFECT if document.pop(name, None) is not None]
    if ignored:
        _LOG.warning("ignored sections of an older configuration: %s", ", ".join(ignored))
    profile = document.get("profile")
    if isinstance(profile, str) and profile in _RENAMED:
        document["profile"] = _RENAMED[profile]
    return _checked(document)


def _checked(document: dict[str, Any]) -> Config:
    try:
        document = _merged(to_document(Config()), without_numpy(document))
        if isinstance(document.get("drives"), dict):
            document["drives"] = with_drive_defaults(document["drives"])
        config: Config = converted_value("", document, Config)
    except RecursionError:
        raise ConfigError("config", "hundreds of tables in each other", "a few") from None
    return config


def to_document(config: Config) -> dict[str, Any]:
    """The nested dictionary of a configuration, without the keys that are None."""
    document: dict[str, Any] = _without_none(msgspec.to_builtins(config))
    return document


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in changes.items():
        is_table = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = _merged(base[key], value) if is_table else value
    return merged


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_without_none(item) for item in value]
    return value
