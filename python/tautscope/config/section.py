"""Base of the sections of a configuration: every constructor checks its values."""

import math
import re
from collections.abc import Iterator, Sequence
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from tautscope.errors import ConfigError


class Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A section of a configuration, with typed and checked values.

    NumPy numbers and arrays become Python's.

    Raises:
        ConfigError: A value has the wrong type, is out of range or not finite, or contradicts
            another one of the section.
    """

    def __post_init__(self) -> None:
        for name, kind in _types(type(self)).items():
            value = getattr(self, name)
            converted = converted_value(name, value, kind)
            if converted is not value:
                msgspec.structs.force_setattr(self, name, converted)
        self._check()

    def _check(self) -> None:
        """Check relations between the values; the key in an error is relative to the section."""

    def __repr__(self) -> str:
        """A call that makes an equal section: the profile, and values that are not defaults."""
        values = (
            f"{field.name}={value!r}"
            for field in msgspec.structs.fields(type(self))
            if (value := getattr(self, field.name)) != default_of(field) or field.name == "profile"
        )
        return f"{type(self).__name__}({', '.join(values)})"


def default_of(field: msgspec.structs.FieldInfo) -> Any:
    """The default of a field; `msgspec.NODEFAULT` if it is required."""
    if field.default_factory is msgspec.NODEFAULT:
        return field.default
    return field.default_factory()


def require(is_valid: bool, field: str, value: object, allowed: str) -> None:
    """Raise a `ConfigError` if a value is not valid."""
    if not is_valid:
        raise ConfigError(field, value, allowed)


def require_defaults(block: Section, path: str, names: Sequence[str], why: str) -> None:
    """Refuse keys that have another value than their default."""
    defaults = {one.name: default_of(one) for one in msgspec.structs.fields(block)}
    for name in names:
        value, field = getattr(block, name), f"{path}.{name}".lstrip(".")
        require(value == defaults[name], field, value, f"its default: {why}")


def require_names(field: str, names: Sequence[str], allowed: Sequence[str]) -> None:
    """Refuse a list with other names than the allowed ones."""
    for index, name in enumerate(names):
        require(name in allowed, f"{field}[{index}]", name, "one of " + ", ".join(allowed))


def require_at_most(path: str, block: Section, name: str, limit_name: str) -> None:
    """Refuse a value above that of another key."""
    value, limit = getattr(block, name), getattr(block, limit_name)
    field = f"{path}.{name}".lstrip(".")
    require(value <= limit, field, value, f"at most {limit_name} = {limit}")


def converted_value(path: str, value: Any, kind: Any) -> Any:
    """Convert a value to a type of the configuration, and check type, range and finiteness.

    The dotted path is for errors; empty for a whole configuration.

    Raises:
        ConfigError: The value is not of this type; the error names it by its dotted path.
    """
    value = without_numpy(value)
    try:
        converted = msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise _error_at(path, value, kind, error) from None
    _check_finite(converted, path)
    return converted


def without_numpy(value: Any) -> Any:
    """A nested value with NumPy's numbers and arrays replaced by Python's."""
    if isinstance(value, dict):
        return {key: without_numpy(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(without_numpy, value))
    return value.tolist() if hasattr(value, "tolist") else value


@cache
def _types(section: type[Section]) -> dict[str, Any]:
    return get_type_hints(section, include_extras=True)


def _error_at(path: str, value: Any, kind: Any, error: Exception) -> ConfigError:
    """The error of the innermost value that is wrong, within one that is not of its type."""
    for key, part, of in _parts(value, kind):
        try:
            msgspec.convert(part, of)
        except msgspec.ValidationError as inner:
            return _error_at(_joined(path, key), part, of, inner)
    cause = error.__cause__
    if isinstance(cause, ConfigError):  # of a section's own constructor
        return ConfigError(_joined(path, cause.field), cause.value, cause.allowed)
    match = re.search("(unknown|missing required) field `([^`]*)`", str(error))
    if match and isinstance(value, dict):
        unknown = "no such key; `tautscope config` prints all keys"
        allowed = unknown if match[1] == "unknown" else "a value: it has no default"
        return ConfigError(_joined(path, match[2]), value.get(match[2]), allowed)
    from tautscope.config.ranges import allowed_by  # noqa: PLC0415  only errors need it

    return ConfigError(path or "config", value, allowed_by(kind))


def _parts(value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """Key, value and type of each part of a section, table or list."""
    origin, of = get_origin(kind), get_args(kind)
    if origin in (Annotated, Union, UnionType):
        for member in of[:1] if origin is Annotated else of:
            yield from _parts(value, member)
    elif origin is tuple and isinstance(value, list | tuple):
        kinds = of[:1] * len(value) if Ellipsis in of else of
        if len(kinds) == len(value):  # else it is the list that is wrong
            places = (f"[{index}]" for index in range(len(value)))
            yield from zip(places, value, kinds, strict=True)
    elif origin is dict and isinstance(value, dict):
        yield from ((str(name), part, of[1]) for name, part in value.items())
    elif isinstance(value, dict) and isinstance(kind, type) and issubclass(kind, Section):
        yield from ((key, value[key], of) for key, of in _types(kind).items() if key in value)


def _joined(*parts: str) -> str:
    return ".".join(part for part in parts if part).replace(".[", "[")


def _check_finite(value: Any, path: str) -> None:
    """Reject nan and inf, which TOML allows and ranges do not exclude."""
    if isinstance(value, dict):
        for key, item in value.items():
            _check_finite(item, _joined(path, str(key)))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_finite(item, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(path, value, "a finite number")
