"""Base of the sections of a configuration: every constructor checks its values."""

import math
import re
from collections.abc import Sequence
from functools import cache
from typing import Any, get_type_hints

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
        raise _config_error(error, value, path, kind) from None
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


def _config_error(
    error: msgspec.ValidationError, document: Any, prefix: str, kind: Any
) -> ConfigError:
    """Translate an error of msgspec, which names the key but not its value."""
    message = str(error)
    expected, _, path = (
        message.rpartition(" - at `$") if " - at `$" in message else (message, "", "")
    )
    path = _with_entry(path.rstrip("`").lstrip("."), document, kind)
    cause = error.__cause__
    if isinstance(cause, ConfigError):  # of a section's own constructor
        return ConfigError(_joined(prefix, path, cause.field), cause.value, cause.allowed)
    unknown = re.search(r"unknown field `([^`]*)`", expected)
    missing = re.search(r"missing required field `([^`]*)`", expected)
    if match := unknown or missing:
        path = _joined(path, match[1])
    value: Any = document
    keys = re.findall(r"[^.\[\]]+", path)
    for key in keys:
        try:
            value = value[int(key)] if isinstance(value, list | tuple) else value[key]
        except (KeyError, TypeError, IndexError, ValueError):
            value = None
            break
    if unknown:
        allowed = "no such key; `tautscope config` prints all keys"
    elif missing:
        allowed = "a value: it has no default"
    else:
        from tautscope.config.ranges import allowed_at  # noqa: PLC0415  only errors need it

        allowed = allowed_at(kind, keys)
    return ConfigError(_joined(prefix, path) or "config", value, allowed)


def _with_entry(path: str, document: Any, kind: Any) -> str:
    """A path with the name of a table's entry, for which msgspec has "[...]"."""
    place, found, rest = path.partition("[...]")
    if not found:
        return path
    from tautscope.config.ranges import wrong_entry  # noqa: PLC0415  only errors need it

    keys = re.findall(r"[^.\[\]]+", place)
    for key in keys:
        document = document[int(key) if isinstance(document, list | tuple) else key]
    name = wrong_entry(kind, keys, document)
    return path if name is None else f"{place}.{name}{rest}"


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
