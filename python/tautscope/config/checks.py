"""Relations between the values of a section, and between sections.

Each check raises `ConfigError` with the key, relative to its section.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from operator import attrgetter

import msgspec
from msgspec import Struct
from msgspec.inspect import FloatType, IntType, TupleType, type_info
from msgspec.structs import fields

from tautscope._core import DETECTORS, MOST_DOFS, MOST_RANGE
from tautscope.config.axes import DofEntry, KinematicsConfig, MeasurementConfig
from tautscope.config.control import ControlConfig
from tautscope.config.dof import DofConfig
from tautscope.config.drives import DrivesConfig
from tautscope.config.experiment import ExperimentConfig
from tautscope.config.instrument import InstrumentConfig
from tautscope.config.microcontroller import MOST_AXES, PROTOCOL, SERIAL_PORTS
from tautscope.config.safety import SafetyConfig
from tautscope.config.section import default_of, relation
from tautscope.config.servos import PORTS, models_of
from tautscope.config.twin import DISTURBANCES, TwinConfig
from tautscope.dof import Dof
from tautscope.errors import ConfigError

_RANGE = "the lower limit, then the upper"
MOST_RATIO = 30.0
"""Largest ratio of a number to its default, in either direction. Robots differ by less; a wrong
unit (mm for m, degrees for rad) or a digit too many is more."""
RANGED = (
    "law", "estimation", "insertion", "rotation", "bending", "instrument", "camera", "control",
    "safety", "kinematics", "vision",
)  # fmt: skip
"""Sections in which it holds for every number whose type has no upper limit."""


@relation(DofConfig)
def _check_dof(settings: DofConfig) -> None:
    _require_at_most("", settings, "free_gain", "gain_limit")
    _require_at_most("", settings, "delta_minus", "delta_plus")


@relation(InstrumentConfig)
def _check_instrument(instrument: InstrumentConfig) -> None:
    """Both bands are on the tip, one behind the other."""
    a, b, half = instrument.marker_a, instrument.marker_b, instrument.band_length / 2
    proximal = "a band on the tip, proximal of marker_b's band and not overlapping it"
    _require(half <= a <= b - 2 * half, "marker_a", a, proximal)
    _require(b + half <= instrument.tip_length, "marker_b", b, "a band within tip_length")


@relation(TwinConfig)
def _check_twin(twin: TwinConfig) -> None:
    _require_at_most("", twin, "latency_jitter", "latency")
    _require_names("disturb", twin.disturb, DISTURBANCES)
    readout, frame_period = twin.sensor.readout, 1 / twin.frame_rate
    _require(
        readout <= frame_period,
        "sensor.readout",
        readout,
        f"at most one frame period, {frame_period:.3g}",
    )


@relation(ControlConfig)
def _check_control(control: ControlConfig) -> None:
    """The history has 1 to 1024 ticks."""
    _require(
        1 <= control.history / control.period <= 1024,
        "history",
        control.history,
        f"1 to 1024 ticks of period = {control.period}",
    )


_TRAVEL = next(each.default for each in fields(SafetyConfig) if each.name == "command_travel")


@relation(SafetyConfig)
def _check_safety(safety: SafetyConfig) -> None:
    _require_names("off", safety.off, DETECTORS)
    for index, limits in enumerate(safety.command_travel):
        _require(limits[0] < limits[1], f"command_travel[{index}]", limits, _RANGE)
        most = MOST_RATIO * max(map(abs, _TRAVEL[index]))
        is_usual = max(map(abs, limits)) <= most or "safety.command_travel" in safety.unusual
        _require(is_usual, f"command_travel[{index}]", limits, f"within -{most:.3g} to {most:.3g}")


def check_references(
    safety: SafetyConfig, experiment: ExperimentConfig, dofs: Mapping[Dof, DofConfig]
) -> None:
    """Check section ``safety`` against references and estimators; keys from the root."""
    for dof, speed in zip(Dof, safety.reference_speed, strict=True):
        sine = experiment[dof]
        least_period = 2 * math.pi * sine.amplitude / speed
        _require(
            sine.period >= least_period or "reference_fast" in safety.off,
            f"experiment.{dof.label}.period",
            sine.period,
            f"at least {least_period:.3g}: safety.reference_speed limits faster references",
        )
    for dof, noise in zip(Dof, safety.state_noise, strict=True):
        tolerance = dofs[dof].contact_tolerance * dofs[dof].update_distance
        _require(
            0 <= 3 * noise < tolerance,
            f"safety.state_noise[{dof}]",
            noise,
            f"less than a third of {dof.label}.contact_tolerance times "
            f"{dof.label}.update_distance = {tolerance:.3g}",
        )


@relation(DofEntry)
def _check_dof_entry(dof: DofEntry) -> None:
    if dof.range is not None:
        low, high = dof.range
        _require(low < high, "range", dof.range, _RANGE)
        most = MOST_RANGE * dof.width_limit
        degrees = "; in m and rad, not mm and degrees" if high - low > most else ""
        _require(not degrees, "range", dof.range, f"at most {most:.3g} wide{degrees}")
    if dof.unit == "m":  # a slack of more than a metre is one in millimetres
        _require(dof.width_limit <= 1, "width_limit", dof.width_limit, "at most 1 m")
        _require(dof.largest_speed <= 10, "speed", dof.largest_speed, "at most 10 m/s")
    if dof.expected_width is not None:
        _require_at_most("", dof, "expected_width", "width_limit")
    _require_at_most("", dof, "delta_minus", "delta_plus")


_OF_THE_ARTICLE = (
    "width_limit",
    "offset_limit",
    "reference_speed",
    "command_speed",
    "command_travel",
    "reference_count",
    "state_noise",
    "frozen_travel",
)
"""Keys of [safety] that a robot with [[dof]] does not use."""


def check_axes(
    dofs: Sequence[DofEntry], kinematics: KinematicsConfig, safety: SafetyConfig
) -> None:
    """Check the entries of [[dof]] with each other, and what names them; keys from the root."""
    known = [dof.name for dof in dofs] if kinematics.kind in ("two_planes", "segments") else []
    for index, name in enumerate(kinematics.without):
        allowed = "a name of [[dof]], and kind two_planes or segments"
        _require(name in known, f"kinematics.without[{index}]", name, allowed)
    if not dofs:
        return
    _require(len(dofs) <= MOST_DOFS, "dof", f"{len(dofs)} entries", f"1 to {MOST_DOFS}")
    for index, dof in enumerate(dofs):
        names = [other.name for other in dofs[:index]]
        _require(dof.name not in names, f"dof[{index}].name", dof.name, "a name used once")
    for name in _OF_THE_ARTICLE:
        value = getattr(safety, name)
        default = getattr(SafetyConfig(), name)
        _require(value == default, f"safety.{name}", value, "its default: [[dof]] has its own")


_TOPIC = re.compile(r"(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


def check_topics(
    dofs: Sequence[DofEntry], kinematics: KinematicsConfig, measurement: MeasurementConfig
) -> None:
    """Check measurement.topics; keys from the root."""
    for index, topic in enumerate(measurement.topics):
        path = f"measurement.topics[{index}]"
        names = [other.name for other in measurement.topics[:index]]
        _require(bool(dofs), path, topic.name, "none without [[dof]]")
        _require(topic.name not in names, f"{path}.name", topic.name, "a topic named once")
        allowed = "a topic as /tracker/pose: letters, digits and underscores between slashes"
        _require(bool(_TOPIC.fullmatch(topic.name)), f"{path}.name", topic.name, allowed)
        if topic.type != "JointState":
            allowed = f'a kinematics that gives the tip, as "two_planes", for {topic.name}'
            _require(kinematics.kind != "joints", "kinematics.kind", kinematics.kind, allowed)


_OF_CIA_402 = (
    "interface",
    "options",
    "lead_points",
    "master_node",
    "heartbeat_period",
    "preset",
    "interpolation_time",
    "waive",
)
"""Keys of [drives] that only CiA 402 drives use."""
_OF_SERVOS = ("model", "homing_offset", "stops", "torque_limit")
"""Keys of a motor that only servos use."""


@relation(DrivesConfig)
def _check_drives(drives: DrivesConfig) -> None:
    """Also the ranges that CANopen can express."""
    given = [dof.label for dof in Dof if getattr(drives, dof.label) is not None]
    if drives.motors:
        _require(not given, "motors", list(drives.motors), f"either motors or {', '.join(given)}")
    for dof in () if drives.motors else Dof:
        allowed = "a motor, or motors of [[dof]] in [drives.motors]"
        _require(dof.label in given, dof.label, None, allowed)
    taken = {drives.master_node: "master_node"}
    for motor in drives.all_motors:
        axis, path = drives[motor], motor.key.removeprefix("drives.")
        owner = taken.get(axis.node)
        _require(owner is None, f"{path}.node", axis.node, f"not that of {owner}")
        taken[axis.node] = motor.label
        _require(axis.travel[0] < axis.travel[1], f"{path}.travel", axis.travel, _RANGE)
        _require(
            max(abs(end - axis.home) for end in axis.travel) * axis.counts_per_unit < 2**31,
            f"{path}.counts_per_unit",
            axis.counts_per_unit,
            f"less than 2^31 counts from home = {axis.home} to both ends of travel = {axis.travel}",
        )
        _require_at_most(path, axis, "following_window", "following_error")
        if drives.protocol in PORTS:
            allowed = "one of " + ", ".join(models_of(drives.protocol))
            known = axis.model in models_of(drives.protocol)
            _require(known, f"{path}.model", axis.model, allowed)
            lower, upper = axis.stops or (-math.inf, math.inf)
            inside = lower <= axis.travel[0] and axis.travel[1] <= upper
            _require(inside, f"{path}.travel", axis.travel, f"within stops = {axis.stops}")
        else:
            _require_defaults(axis, path, _OF_SERVOS, "only servos use it")
        if drives.protocol in SERIAL_PORTS:
            _require_defaults(axis, path, ("eds",), "only CiA 402 drives use it")
        if drives.protocol == PROTOCOL:
            allowed = f"an axis of the microcontroller, 1 to {MOST_AXES}"
            _require(axis.node <= MOST_AXES, f"{path}.node", axis.node, allowed)
        _require(
            axis.speed_limit * drives.cycle * axis.counts_per_unit >= 1,
            f"{path}.counts_per_unit",
            axis.counts_per_unit,
            "at least one count per cycle at the speed limit; per m or rad, not mm or deg",
        )
    if drives.protocol in SERIAL_PORTS:
        _require_defaults(drives, "", _OF_CIA_402, "only CiA 402 drives use it")
    else:
        _require(drives.bitrate <= 1_000_000, "bitrate", drives.bitrate, "at most 1000000 on CAN")
    for name, most in (
        ("cycle", 0.255),
        ("heartbeat_period", 65.535),
        ("heartbeat_timeout", 65.535),
        ("following_timeout", 65.535),
    ):
        value = getattr(drives, name)
        is_whole = math.isclose(value * 1e3, round(value * 1e3))
        allowed = f"whole milliseconds, 0.001 to {most}"
        _require(0.001 <= value <= most and is_whole, name, value, allowed)
    reply, cycle = drives.reply_timeout, drives.cycle
    _require(reply < cycle, "reply_timeout", reply, f"less than cycle = {cycle}")
    least = 2 * max(drives.heartbeat_period, cycle)
    _require(
        drives.heartbeat_timeout >= least,
        "heartbeat_timeout",
        drives.heartbeat_timeout,
        f"at least {least}: two heartbeats and two cycles",
    )


def check_ranges(config: Struct) -> None:
    """Check that numbers are of the order of their defaults; keys from the root."""
    unusual: tuple[str, ...] = config.safety.unusual  # type: ignore[attr-defined]
    ranges = _ranges(type(config))
    for key, index, low, high in ranges:
        value = attrgetter(key)(config)
        one = value if index is None else value[index]
        if not (low <= one <= high or key in unusual):
            path = key if index is None else f"{key}[{index}]"
            allowed = f"{low:.3g} to {high:.3g}, or {key} named in safety.unusual"
            raise ConfigError(path, one, allowed)
    if unusual:
        known = {"safety.command_travel", *(key for key, *_ in ranges)}
        _require_names("safety.unusual", unusual, sorted(known))


@cache
def _ranges(config: type[Struct]) -> tuple[tuple[str, int | None, float, float], ...]:
    """Key, index in a list, least and largest value of the numbers without a limit."""
    factories = {field.name: field.default_factory for field in fields(config)}
    return tuple(one for name in RANGED for one in _ranged(name, factories[name]()))


def _ranged(path: str, default: Struct) -> Iterator[tuple[str, int | None, float, float]]:
    for field in type_info(type(default)).fields:  # type: ignore[attr-defined]
        key, usual = f"{path}.{field.name}", getattr(default, field.name)
        if isinstance(usual, Struct):
            yield from _ranged(key, usual)
            continue
        is_list = isinstance(field.type, TupleType)
        kinds, values = (field.type.item_types, usual) if is_list else ((field.type,), (usual,))
        for index, (kind, one) in enumerate(zip(kinds, values, strict=True)):
            if not isinstance(kind, FloatType | IntType):
                continue
            is_positive = isinstance(kind, FloatType) and kind.gt is not None
            if one and kind.lt is kind.le is None and (is_positive or kind.ge is not None):
                low = one / MOST_RATIO * is_positive
                yield key, index if is_list else None, low, one * MOST_RATIO


def _require(is_valid: bool, field: str, value: object, allowed: str) -> None:
    if not is_valid:
        raise ConfigError(field, value, allowed)


def _require_defaults(block: msgspec.Struct, path: str, names: Sequence[str], why: str) -> None:
    defaults = {one.name: default_of(one) for one in msgspec.structs.fields(block)}
    for name in names:
        value, field = getattr(block, name), f"{path}.{name}".lstrip(".")
        _require(value == defaults[name], field, value, f"its default: {why}")


def _require_names(field: str, names: Sequence[str], allowed: Sequence[str]) -> None:
    for index, name in enumerate(names):
        _require(name in allowed, f"{field}[{index}]", name, "one of " + ", ".join(allowed))


def _require_at_most(path: str, block: object, name: str, limit_name: str) -> None:
    value, limit = getattr(block, name), getattr(block, limit_name)
    field = f"{path}.{name}".lstrip(".")
    _require(value <= limit, field, value, f"at most {limit_name} = {limit}")
