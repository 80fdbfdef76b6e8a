"""Configuration: frozen structures read from TOML; the only place of a default.

Units are SI: m, rad, s; px for images. Brackets have the unit of a key and the origin of its
default: [paper] is Reilink et al. 2013, [ours] is chosen here, [geometry] is a plausible instrument
that no publication describes. Missing keys have their defaults.
"""

from tautscope.config.actuators import ActuatorsConfig
from tautscope.config.axes import DofEntry, KinematicsConfig, MeasurementConfig, TopicConfig
from tautscope.config.calibration import CalibrationConfig, CalibrationRecord
from tautscope.config.camera import CameraConfig, PixelFormat, PoseConfig, SourceConfig
from tautscope.config.control import ControlConfig, DofConfig, EstimationConfig, LawConfig
from tautscope.config.drives import AxisConfig, DrivesConfig
from tautscope.config.experiment import ExperimentConfig, InstrumentConfig, Sine
from tautscope.config.load import RIGS, axes, config_file, dump_config, load_config
from tautscope.config.recording import RecordingConfig
from tautscope.config.root import Config, Profile, check_config, from_document, to_document
from tautscope.config.safety import SafetyConfig
from tautscope.config.twin import (
    DISTURBANCES,
    CableConfig,
    DriveConfig,
    FrictionConfig,
    SensorConfig,
    ShaftConfig,
    TransmissionConfig,
    TwinConfig,
)
from tautscope.config.vision import VisionConfig
