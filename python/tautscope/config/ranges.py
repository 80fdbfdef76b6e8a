"""Types and ranges of configuration values in words."""

from typing import Any

import msgspec.inspect as types


def allowed_values(kind: types.Type) -> str:
    """The allowed values of a type in words: ``a number above 0``, ``"paper" or "best"``."""
    match kind:
        case types.LiteralType(values=values):
            text = " or ".join(f'"{one}"' if isinstance(one, str) else str(one) for one in values)
        case types.FloatType():
            text = f"a number{_bounds(kind)}"
        case types.IntType():
            text = f"a whole number{_bounds(kind)}"
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
            size = f" of at most {most}" if most else ""
            text = f"a list{size}, each item {allowed_values(item)}"
        case types.DictType(value_type=value):
            text = f"a table, each value {allowed_values(value)}"
        case types.UnionType(types=members):
            some = (one for one in members if not isinstance(one, types.NoneType))
            text = " or ".join(map(allowed_values, some))
        case _:
            text = "a table"
    return text


def allowed_by(annotation: Any) -> str:
    """The allowed values of an annotation in words."""
    return allowed_values(types.type_info(annotation))


def _bounds(kind: Any) -> str:
    if kind.ge is not None and kind.le is not None:
        return f" from {kind.ge:,.12g} to {kind.le:,.12g}"
    limits = {"above": kind.gt, "of at least": kind.ge, "below": kind.lt, "of at most": kind.le}
    words = (f" {word} {limit:,.12g}" for word, limit in limits.items() if limit is not None)
    return " and".join(words)
