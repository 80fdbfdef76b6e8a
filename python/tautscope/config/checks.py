"""Relations between sections; each check raises `ConfigError` with the key from the root."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from operator import attrgetter

from msgspec import Struct
from msgspec.inspect import FloatType, IntType, TupleType, type_info
from msgspec.structs import asdict, fields

from tautscope._core import MOST_DOFS, OFFSET_LIMIT
from tautscope.config.axes import DofEntry, KinematicsConfig, MeasurementConfig
from tautscope.config.control import DofConfig, EstimationConfig
from tautscope.config.experiment import ExperimentConfig
from tautscope.config.fields import MOST_RATIO
from tautscope.config.safety import SafetyConfig
from tautscope.config.section import default_of, require, require_defaults, require_names
from tautscope.dof import Dof
from tautscope.errors import ConfigError


def check_references(
    safety: SafetyConfig, experiment: ExperimentConfig, dofs: Mapping[Dof, DofConfig]
) -> None:
    """Check section ``safety`` against references and estimators."""
    for dof, speed in zip(Dof, safety.reference_speed, strict=True):
        sine = experiment[dof]
        least = 2 * math.pi * sine.amplitude / speed
        is_followed = sine.period >= least or "reference_fast" in safety.off
        allowed = f"at least {least:.3g}: safety.reference_speed limits faster references"
        require(is_followed, f"experiment.{dof.label}.period", sine.period, allowed)
    for dof, noise in zip(Dof, safety.state_noise, strict=True):
        tolerance = dofs[dof].contact_tolerance * dofs[dof].update_distance
        product = f"{dof.label}.contact_tolerance times {dof.label}.update_distance"
        allowed = f"less than a third of {product} = {tolerance:.3g}"
        require(0 <= 3 * noise < tolerance, f"safety.state_noise[{dof}]", noise, allowed)


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
    dofs: Sequence[DofEntry],
    kinematics: KinematicsConfig,
    safety: SafetyConfig,
    estimation: EstimationConfig,
) -> None:
    """Check the entries of [[dof]] with each other, and what names them."""
    known = [dof.name for dof in dofs] if kinematics.kind in ("two_planes", "segments") else []
    for index, name in enumerate(kinematics.without):
        allowed = "a name of [[dof]], and kind two_planes or segments"
        require(name in known, f"kinematics.without[{index}]", name, allowed)
    if not dofs:
        return
    require(len(dofs) <= MOST_DOFS, "dof", f"{len(dofs)} entries", f"1 to {MOST_DOFS}")
    frictions = [dof.friction for dof in dofs]
    for index, dof in enumerate(dofs):
        path, names = f"dof[{index}]", [other.name for other in dofs[:index]]
        require(dof.name not in names, f"{path}.name", dof.name, "a name used once")
        is_shared = not dof.friction or frictions.count(dof.friction) > 1
        require(is_shared, f"{path}.friction", dof.friction, "the name of two or more DOFs")
        allowed = f"its default: {path} shares no friction"
        require(bool(dof.friction) or dof.lever == 1.0, f"{path}.lever", dof.lever, allowed)
        if dof.name in known and dof.name not in kinematics.without:
            _check_unit(path, dof, kinematics.kind == "segments")
    require_defaults(safety, "safety", _OF_THE_ARTICLE, "[[dof]] has its own")
    require_defaults(estimation, "estimation", _OF_IMAGES, "[[dof]] has no bands")


def _check_unit(path: str, dof: DofEntry, is_of_segments: bool) -> None:
    """Check that a degree of freedom has the unit that "two_planes" and "segments" compute with."""
    is_bend = is_of_segments or dof.name in ("bend_x", "bend_y")
    unit = "m" if dof.name == "insertion" and not is_bend else "rad"
    if is_bend or dof.name in ("insertion", "rotation"):
        allowed = f'unit = "{unit}" and its other values in {unit}, as the kinematics needs'
        require(dof.unit == unit, f"{path}.unit", dof.unit, allowed)
    if is_bend:
        turn, most = 2 * math.pi, max(map(abs, dof.range or (0.0,)))
        allowed = f"at most {turn:.3g}, a turn; in rad, not degrees"
        require(most <= turn, f"{path}.range", dof.range, allowed)
        require(dof.width_limit <= turn, f"{path}.width_limit", dof.width_limit, allowed)


_OF_IMAGES = (
    "marker_deviation",
    "shape_deviation",
    "image_deviation",
    "misfit_deviation",
    "misfit_travel",
)
"""Keys of [estimation] that a robot with [[dof]] does not use."""
_ROUNDING = 1 + 1e-9
"""An estimate at a limit may be an initial offset."""


def check_offsets(
    dofs: Sequence[DofEntry], safety: SafetyConfig, article: Mapping[Dof, DofConfig]
) -> None:
    """Check initial offsets against the limits of estimated ones, which `safety.off` may lift."""
    if "width_limit" in safety.off:
        return
    for index, dof in enumerate(dofs):
        limit = OFFSET_LIMIT * dof.width_limit
        _check_offsets(f"dof[{index}]", dof, limit, "2/3 width_limit")
        most = dof.delta_minus + dof.width_limit * _ROUNDING
        near = f"at most {most:.3g}, width_limit above delta_minus"
        require(dof.delta_plus <= most, f"dof[{index}].delta_plus", dof.delta_plus, near)
    if not dofs:
        for (axis, own), limit in zip(article.items(), safety.offset_limit, strict=True):
            _check_offsets(axis.label, own, limit, "safety.offset_limit")


def _check_offsets(path: str, own: DofEntry | DofConfig, limit: float, name: str) -> None:
    near = f"from {-limit:.3g} to {limit:.3g}, {name}"
    for key, offset in (("delta_minus", own.delta_minus), ("delta_plus", own.delta_plus)):
        require(abs(offset) <= limit * _ROUNDING, f"{path}.{key}", offset, near)


def check_unused(config: Struct) -> None:
    """Refuse values in sections that robots with [[dof]] do not use, or the others."""
    has_dofs: bool = bool(config.dof)  # type: ignore[attr-defined]
    article = ("insertion", "rotation", "bending", "instrument")
    unused: Sequence[str] = article if has_dofs else ("kinematics", "measurement")
    allowed = f"its default: not used with{'' if has_dofs else 'out'} [[dof]]"
    for section in fields(type(config)):
        if section.name in unused:
            own, default = getattr(config, section.name), asdict(default_of(section))
            for key, value in asdict(own).items():
                require(value == default[key], f"{section.name}.{key}", value, allowed)


_TOPIC = re.compile(r"(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


def check_topics(kinematics: KinematicsConfig, measurement: MeasurementConfig) -> None:
    """Check measurement.topics."""
    for index, topic in enumerate(measurement.topics):
        path = f"measurement.topics[{index}]"
        names = [other.name for other in measurement.topics[:index]]
        require(topic.name not in names, f"{path}.name", topic.name, "a topic named once")
        allowed = "a topic as /tracker/pose: letters, digits and underscores between slashes"
        require(bool(_TOPIC.fullmatch(topic.name)), f"{path}.name", topic.name, allowed)
        if topic.type != "JointState":
            allowed = f'a kinematics that gives the tip, as "two_planes", for {topic.name}'
            require(kinematics.kind != "joints", "kinematics.kind", kinematics.kind, allowed)


def check_ranges(config: Struct) -> None:
    """Check that numbers whose type has no upper limit are of the order of their defaults."""
    unusual: tuple[str, ...] = config.safety.unusual  # type: ignore[attr-defined]
    usual = ranges(type(config))
    for key, index, low, high in usual:
        value = attrgetter(key)(config)
        one = value if index is None else value[index]
        if not (low <= one <= high or key in unusual):
            path = key if index is None else f"{key}[{index}]"
            allowed = f"{low:.3g} to {high:.3g}, or {key} named in safety.unusual"
            raise ConfigError(path, one, allowed)
    if unusual:
        known = {"safety.command_travel", *(key for key, *_ in usual)}
        require_names("safety.unusual", unusual, sorted(known))


@cache
def ranges(config: type[Struct]) -> tuple[tuple[str, int | None, float, float], ...]:
    """Key, index in a list, least and largest value of the numbers without a limit."""
    made = {each.name: default_of(each) for each in fields(config)}
    sections = {name: section for name, section in made.items() if isinstance(section, Struct)}
    return tuple(one for name, section in sections.items() for one in _ranged(name, section))


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
