"""Configuration of the calibration: when, with which devices and how well it was done."""

from datetime import datetime

from msgspec import field

from tautscope.config.fields import NonNegative, Positive
from tautscope.config.section import Section, require

CALIBRATIONS = ("camera", "colour", "geometry", "latency")
"""The calibrations in the order in which they build on each other."""
TWIN = "twin"
"""A simulated rig among the devices of a calibration; its seed is the serial number."""


class CalibrationRecord(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One calibration; written by ``tautscope calibrate``."""

    date: str
    """When it was done: ISO 8601 with time zone."""
    serial_numbers: dict[str, str] = field(default_factory=dict)
    """Serial numbers of the devices that took part: camera, insertion, rotation, bending; or the
    seed of the twin."""
    std: dict[str, NonNegative] = field(default_factory=dict)
    """Standard deviation of each value, by the dotted path of its key, in the unit of the key."""
    residual: NonNegative | None = None
    """Root mean square of the residuals [px]."""

    @property
    def at(self) -> datetime:
        """The date."""
        return datetime.fromisoformat(self.date)

    def _check(self) -> None:
        try:
            is_valid = self.at.tzinfo is not None
        except ValueError:
            is_valid = False
        require(is_valid, "date", self.date, "a time with zone: 2026-11-22T12:00:00+00:00")


class CalibrationConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The calibrations of a rig; ``tautscope doctor`` checks them, no loop reads them."""

    largest_age: Positive = 90.0
    """Age from which doctor reports a calibration as stale [in days] [ours]."""
    camera: CalibrationRecord | None = None
    """Intrinsics of the camera."""
    colour: CalibrationRecord | None = None
    """Colour of the bands."""
    geometry: CalibrationRecord | None = None
    """Pose of the guide, lengths of the instrument, zeros and gains of the drives."""
    latency: CalibrationRecord | None = None
    """Delay between motors and images, or of the sensors of a robot with [[dof]]."""
    robot: CalibrationRecord | None = None
    """Kinematics and delays of a robot with [[dof]]."""
