"""The degrees of freedom of any robot, its kinematics, and the noise of its sensors."""

from typing import Annotated, Literal

from msgspec import Meta

from tautscope._core import MOST_RANGE, SPEED
from tautscope.config.fields import LIMITS, Angle, Gain, NonNegative, Position, Positive, Rotation
from tautscope.config.section import Section, require, require_at_most

Name = Annotated[str, Meta(min_length=1, max_length=32, pattern=r"^[a-z][a-z0-9_]*$")]


class DofEntry(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One of 1 to 8 degrees of freedom of a robot that is not the article's instrument.

    In the order of every array; insertion, rotation, bending and their values in [safety] are then
    not used.
    """

    name: Name
    """Its name in traces, tables and messages."""
    width_limit: Annotated[float, Meta(gt=0, le=100)]
    """Largest width of the slack that is compensated [m or rad]; unit of its other lengths."""
    unit: Literal["m", "rad"] = "rad"
    """Its unit in every array."""
    range: tuple[float, float] | None = None
    """Least and largest command [m or rad]; else 50 width_limit to both sides of 0."""
    speed: Annotated[float, Meta(gt=0, le=1000)] | None = None
    """Largest speed of the reference that is followed [m or rad per s]; else 2 width_limit per
    s."""
    friction: str = ""
    """DOFs of one name share one friction, as a shaft that slides and turns in a channel; without a
    name it has its own."""
    lever: Annotated[float, Meta(gt=0, le=100)] = 1.0
    """Of one that shares a friction: motion of the rubbing surface over its own [m/rad], 1 for a
    translation."""
    expected_width: Positive | None = None
    """Width of the slack that is expected [m or rad]; else two thirds of width_limit."""
    gain_limit: Gain = 5.0
    """K_b of profile ``paper``."""
    command_speed: Annotated[float, Meta(gt=0, le=10_000)] | None = None
    """Largest speed of the command [m or rad per s]; at most 2 gain_limit times `speed`, and what
    the motors of [drives] can do. ``paper`` follows the reference at this over gain_limit."""
    delta_minus: float = 0.0
    """Initial offset at the negative contact [m or rad]."""
    delta_plus: float = 0.0
    """Initial offset at the positive contact [m or rad], not below delta_minus."""

    @property
    def travel(self) -> tuple[float, float]:
        """Least and largest command [m or rad]: `range`, or the widest one about 0."""
        far = MOST_RANGE / 2 * self.width_limit
        return (-far, far) if self.range is None else self.range

    @property
    def largest_speed(self) -> float:
        """Largest speed of the reference that is followed [m or rad per s]."""
        return SPEED * self.width_limit if self.speed is None else self.speed

    @property
    def label(self) -> str:
        """The name in columns and tables."""
        return self.name

    @property
    def display_unit(self) -> str:
        """The unit in tables and figures: mm for a length. Arrays are in m and rad."""
        return "mm" if self.unit == "m" else "rad"

    @property
    def display_scale(self) -> float:
        """Factor from m or rad to `display_unit`."""
        return 1e3 if self.unit == "m" else 1.0

    def _check(self) -> None:
        if self.range is not None:
            low, high = self.range
            require(low < high, "range", self.range, LIMITS)
            most = MOST_RANGE * self.width_limit
            degrees = "; in m and rad, not mm and degrees" if high - low > most else ""
            require(not degrees, "range", self.range, f"at most {most:.3g} wide{degrees}")
        if self.unit == "m":  # a slack of more than a metre is one in millimetres
            require(self.width_limit <= 1, "width_limit", self.width_limit, "at most 1 m")
            require(self.largest_speed <= 10, "speed", self.largest_speed, "at most 10 m/s")
        if self.expected_width is not None:
            require_at_most("", self, "expected_width", "width_limit")
        require_at_most("", self, "delta_minus", "delta_plus")


class KinematicsConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where the tip is in a state of the degrees of freedom of [[dof]]."""

    kind: str = "joints"
    """"joints": the tip is measured degree by degree; "two_planes": constant curvature with the
    DOFs bend_x, bend_y, insertion and rotation, by name; "segments": two DOFs for each of several
    in a row; or your class as "module:Class"."""
    length: Positive = 0.08
    """Of the bending section of "two_planes", or of each of "segments" [m]."""
    tip_length: Positive = 0.015
    """From its end to the sensor [m]."""
    without: tuple[Name, ...] = ()
    """DOFs that do not move the tip, as of a gripper, with "two_planes" and "segments"; a `Tip` of
    another sensor measures them."""
    skew: Angle = 0.0
    """Of "two_planes": angle from bend_x to bend_y about z, less a right angle [rad]."""
    base_position: Position = (0.0, 0.0, 0.0)
    """Origin of the kinematics in the frame of the sensor that measures poses [m]."""
    base_rotation: Rotation = (0.0, 0.0, 0.0)
    """Rotation vector that turns the kinematics into that frame [rad]."""
    sensor_rotation: Rotation = (0.0, 0.0, 0.0)
    """Rotation vector of the sensor at the tip against the tip of the kinematics [rad]."""


class TopicConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A topic of ROS 2 with which a sensor of the tip measures."""

    name: str
    """Relative to the namespace without a slash at its beginning."""
    type: Literal["JointState", "PointStamped", "PoseStamped", "PoseWithCovarianceStamped"]
    """"JointState" measures DOFs by their names, the others the position of the tip and, but for
    "PointStamped", its orientation."""
    frame: str = ""
    """frame_id of its messages, in which the kinematics gives the tip; empty: that of the first
    message."""


class MeasurementConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Sensors of a robot with [[dof]]; deviations are of measurements without a covariance."""

    delays: Annotated[tuple[NonNegative, ...], Meta(max_length=4)] = ()
    """How much earlier than its stamps say each sensor measures [s], at most `control.history`, by
    `tautscope calibrate latency --rig`."""

    tip_deviation: Positive = 0.01
    """Of a tip that is measured degree by degree [in width_limit]."""
    position_deviation: Positive = 0.5e-3
    """Of a position [m]."""
    orientation_deviation: Positive = 0.01
    """Of an orientation about each axis [rad]."""
    point_deviation: Positive = 0.5
    """Of a point of an image [px]."""
    topics: Annotated[tuple[TopicConfig, ...], Meta(max_length=4)] = ()
    """Sensors in ROS 2, in the order of delays."""
