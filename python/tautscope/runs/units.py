"""Units of recorded columns."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from tautscope.dof import Dof
from tautscope.errors import FieldError

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}
ANGLES = {
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180,
    "°": math.pi / 180,
    "rev": 2 * math.pi,
}
TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_KNOWN = LENGTHS | ANGLES | TIMES
_IN_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*([^\])]+?)\s*[\])]")
_SUFFIX = re.compile(r"(.+)_([a-zµμ°]+)")


def unit_of(text: str) -> str:
    """The unit that a text is, with or without brackets; empty if it is none."""
    inner = text.strip().strip("[]()").strip()
    return inner if inner in _KNOWN else ""


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a column's title; the unit is empty if the title has none."""
    if match := _IN_BRACKETS.fullmatch(title.strip()):
        return match[1], unit_of(match[2])
    if (match := _SUFFIX.fullmatch(title.strip())) and match[2] in _KNOWN:
        return match[1], match[2]
    return title.strip(), ""


def units_of(dof: Dof) -> Mapping[str, float]:
    """The units of a DOF's position, in m or rad."""
    return LENGTHS if dof is Dof.INSERTION else ANGLES


def parse_units(text: str) -> dict[str, str]:
    """Units as typed: ``insertion=mm,rotation=deg,bending=deg,time=ms``.

    Raises:
        FieldError: A column or a unit is not known.
    """
    allowed = {dof.label: tuple(units_of(dof)) for dof in Dof} | {"time": tuple(TIMES)}
    found = {}
    for part in filter(None, (each.strip() for each in text.split(","))):
        name, _, unit = (each.strip() for each in part.partition("="))
        if name not in allowed:
            raise FieldError(
                "--units", part, f"column=unit, the column one of {', '.join(allowed)}"
            )
        if unit not in allowed[name]:
            raise FieldError("--units", part, f"for {name} one of {', '.join(allowed[name])}")
        found[name] = unit
    return found
