"""Types and ranges of configuration values in words."""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import msgspec
import msgspec.inspect as types


def allowed_values(kind: types.Type) -> str:
    """The allowed values of a type in words: ``a number above 0``, ``"paper" or "best"``."""
    match kind:
        case types.LiteralType(values=values):
            text = " or ".join(f'"{one}"' if isinstance(one, str) else str(one) for one in values)
        case types.FloatType() | types.IntType():
            text = (
                "a number" if isinstance(kind, types.FloatType) else "a whole number"
            ) + _bounds(kind)
        case types.StrType(pattern=str(pattern), min_length=least, max_length=most):
            text = f"a text of {least} to {most} characters like {pattern}"
        case types.StrType():
            text = "a text"
        case types.BoolType():
            text = "true or false"
        case types.TupleType(item_types=items) if all(item == items[0] for item in items):
            text = f"{len(items)} values, each {allowed_values(items[0])}"
        case types.TupleType(item_types=items):
            text = "a list of " + " and ".join(map(allowed_values, items))
        case types.VarTupleType(item_type=item, max_length=most):
            text = (
                f"a list{f' of at most {most}' if most else ''}, each item {allowed_values(item)}"
            )
        case types.DictType(value_type=value):
            text = f"a table, each value {allowed_values(value)}"
        case types.UnionType(types=members):
            some = (one for one in members if not isinstance(one, types.NoneType))
            text = " or ".join(map(allowed_values, some))
        case _:
            text = "a table"
    return text


def allowed_at(kind: Any, keys: Sequence[str]) -> str:
    """The allowed values at a path of keys and indices within an annotation."""
    return allowed_values(reduce(_member, keys, types.type_info(kind)))


def wrong_entry(kind: Any, keys: Sequence[str], entries: Any) -> str | None:
    """The first key of a table of sections whose section is wrong; the table is at a path."""
    place = reduce(_member, keys, types.type_info(kind))
    if not isinstance(place, types.DictType) or not isinstance(place.value_type, types.StructType):
        return None
    for name, entry in entries.items():
        try:
            msgspec.convert(entry, place.value_type.cls)
        except msgspec.ValidationError:
            return str(name)
    return None


def _member(kind: types.Type, key: str) -> Any:
    """The type at a key of a section, list or table; the type itself if it has no members."""
    match kind:
        case types.StructType(fields=fields):
            return next((field.type for field in fields if field.name == key), kind)
        case types.TupleType(item_types=items) if key.isdecimal():
            return items[min(int(key), len(items) - 1)]
        case types.VarTupleType(item_type=item):
            return item
        case types.DictType(value_type=value):
            return value
        case types.UnionType(types=members):
            return next((found for one in members if (found := _member(one, key)) is not one), kind)
    return kind


def _bounds(kind: Any) -> str:
    low = f"above {kind.gt:,.12g}" if kind.gt is not None else ""
    low = f"of at least {kind.ge:,.12g}" if kind.ge is not None else low
    high = f"below {kind.lt:,.12g}" if kind.lt is not None else ""
    high = f"of at most {kind.le:,.12g}" if kind.le is not None else high
    if kind.ge is not None and kind.le is not None:
        return f" from {kind.ge:,.12g} to {kind.le:,.12g}"
    return "".join(f" {part}" for part in (low, "and" if low and high else "", high) if part)
