"""Defaults and ranges of the Rust crates and of the C interface are those of Python."""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec.inspect as types
import pytest
import tomlkit
from common.paths import ROOT
from tautscope import axes
from tautscope.config import Config, dump_config
from tautscope.config.checks import ranges
from tautscope.config.fields import MOST_RATIO
from tautscope.config.safety import USUAL_TRAVEL

SOURCE = ROOT / "crates" / "config" / "src"


def defaults() -> str:
    return dump_config(axes(1, width_limit=1.0))


def bounds(path: str, kind: types.Type) -> Iterator[tuple[str, Any, tuple[bool, bool]]]:
    """Key, least and largest value of the numbers whose type has an upper limit, and which of the
    two are excluded; of a list of numbers, those of each that it may have."""
    match kind:
        case types.StructType(fields=fields):
            for field in fields:
                yield from bounds(f"{path}.{field.name}".lstrip("."), field.type)
        case types.FloatType() | types.IntType():
            low, high = kind.ge if kind.gt is None else kind.gt, kind.le or kind.lt
            if high is not None:
                assert low is not None, path
                yield path, [float(low), float(high)], (kind.ge is None, kind.le is None)
        case types.UnionType(types=members):
            for member in members:
                yield from bounds(path, member)
        case types.TupleType(item_types=(item, *others)) if all(one == item for one in others):
            yield from bounds(path, item)
        case types.VarTupleType(item_type=types.StructType() as item):
            yield from bounds(path, item)
        case types.VarTupleType(
            item_type=types.FloatType(ge=float() | int() as low), max_length=int() as most
        ):
            yield path, [[float(low), math.inf]] * most, (False, False)


def limits() -> str:
    """A table of the ranges that a key named in safety.unusual leaves, and one of all others, of
    which an end may be excluded; and keys of sections that have no default."""
    usual: dict[str, Any] = {}
    for key, index, *ends in ranges(Config):
        pair = [float(f"{end:.3g}") for end in ends]
        if index is None:
            usual[key] = pair
        else:
            usual.setdefault(key, []).append(pair)
    far = [MOST_RATIO * max(map(abs, limits)) for limits in USUAL_TRAVEL]
    usual["safety.command_travel"] = [[-one, one] for one in far]
    # The others, [drives] and [actuators], have no defaults.
    sections = tuple(f"{name}." for name in tomlkit.parse(defaults()))
    always = [each for each in bounds("", types.type_info(Config)) if each[0].startswith(sections)]
    return tomlkit.dumps(
        {
            "optional": list(optional("", types.type_info(Config), tomlkit.parse(defaults()))),
            "above": [key for key, _, (is_above, _) in always if is_above],
            "below": [key for key, _, (_, is_below) in always if is_below],
            "usual": {key: found for key, found in usual.items() if key.startswith(sections)},
            "always": {key: found for key, found, _ in always},
        }
    )


def optional(path: str, kind: types.Type, known: Any) -> Iterator[str]:
    """Keys without a default below a path, in sections that have one."""
    assert isinstance(kind, types.StructType)
    for field in kind.fields:
        key = f"{path}.{field.name}".lstrip(".")
        if field.name not in known:
            yield key
        elif isinstance(field.type, types.StructType):
            yield from optional(key, field.type, known[field.name])


@pytest.mark.parametrize(("file", "text"), [("defaults", defaults), ("ranges", limits)])
def test_those_in_rust_are_these(file: str, text: Any) -> None:
    path: Path = SOURCE / f"{file}.toml"
    if "TAUTSCOPE_WRITE_DEFAULTS" in os.environ:
        path.write_text(text(), encoding="utf-8")
    found = path.read_text(encoding="utf-8") if path.exists() else ""
    assert found == text(), f"write it: TAUTSCOPE_WRITE_DEFAULTS=1 uv run pytest {__file__}"
