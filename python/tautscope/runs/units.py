"""Units of recorded columns."""

import math
import re
from collections.abc import Mapping

from tautscope.dof import Dof
from tautscope.errors import FieldError, RecordError

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "in": 0.0254}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180, "rev": 2 * math.pi}
TIMES = {
    "s": 1.0,
    "sec": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
}
_WORDS = {
    "m": "meter meters metre metres",
    "cm": "centimeter centimeters centimetre centimetres",
    "mm": "millimeter millimeters millimetre millimetres",
    "um": "micron microns micrometer micrometers micrometre micrometres",
    "in": "inch inches",
    "rad": "radian radians",
    "mrad": "milliradian milliradians",
    "deg": "degree degrees degs",
    "rev": "turn turns revolution revolutions",
    "s": "second seconds secs",
    "ms": "msec msecs millisecond milliseconds",
    "us": "usec usecs microsecond microseconds",
    "ns": "nsec nsecs nanosecond nanoseconds",
    "min": "minute minutes",
}
_OTHERS = "count counts step steps tick ticks pulse pulses px pixel pixels v mv a ma n nm % 1 -"
_UNITS = {
    **{unit: unit for unit in (*LENGTHS, *ANGLES, *TIMES)},
    **{word: unit for unit, words in _WORDS.items() for word in words.split()},
}
_ANY = _UNITS | {unit: unit for unit in _OTHERS.split()}
_IN_BRACKETS = re.compile(r"(.*?)\s*(?:\[\s*([^\]]*?)\s*\]|\(\s*([^)]*?)\s*\))")
_AFTER_MARK = re.compile(r"(.+?)\s*[,/]\s*(\S+)")
_SUFFIX = re.compile(r"(.+)_([A-Za-zµμ°]+)")


def unit_of(text: str) -> str:
    """The unit that a text is, with or without brackets; empty if it is none."""
    return _ANY.get(text.strip().strip("[]()").strip().lower(), "")


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a column's title; the unit is empty if the title has none."""
    title = title.strip()
    if match := _IN_BRACKETS.fullmatch(title):
        return match[1], unit_of(match[2] or match[3] or "")
    if (match := _AFTER_MARK.fullmatch(title)) and (unit := unit_of(match[2])):
        return match[1], unit
    if (match := _SUFFIX.fullmatch(title)) and (unit := _UNITS.get(match[2].lower(), "")):
        return match[1], unit
    return title, ""


def check_unit(where: str, title: str) -> None:
    """Refuse a title with neither a unit nor an index in square brackets, with a `RecordError`."""
    match = _IN_BRACKETS.fullmatch(title.strip())
    if match and match[2] and not match[2].isdecimal() and not unit_of(match[2]):
        known = ", ".join(dict.fromkeys(_ANY.values()))
        raise RecordError(where, f"unit {match[2]}", f"one of {known}")


def units_of(dof: Dof) -> Mapping[str, float]:
    """The units of a DOF's position, in m or rad."""
    return LENGTHS if dof is Dof.INSERTION else ANGLES


def time_scale(largest: float) -> float:
    """Seconds per tick of times without a unit: since 1970 in s, ms, us or ns by their size."""
    for least, scale in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)):
        if largest > least:
            return scale
    return 1.0


def parse_units(text: str) -> dict[str, str]:
    """Units as typed, ``insertion=mm,rotation=deg,time=ms``; else a `FieldError`."""
    allowed = {dof.label: tuple(units_of(dof)) for dof in Dof} | {"time": tuple(TIMES)}
    found = {}
    for part in filter(None, (each.strip() for each in text.split(","))):
        name, _, unit = (each.strip() for each in part.partition("="))
        if name not in allowed:
            raise FieldError(
                "--units", part, f"column=unit, the column one of {', '.join(allowed)}"
            )
        unit = unit_of(unit) or unit
        if unit not in allowed[name]:
            raise FieldError("--units", part, f"for {name} one of {', '.join(allowed[name])}")
        found[name] = unit
    return found
