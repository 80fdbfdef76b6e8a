"""What columns a table has, and which of them may be a command and its tip."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tautscope.errors import RecordError
from tautscope.runs.pose_columns import Floats, find_axes, title_of
from tautscope.runs.tables import Sheet, filled
from tautscope.runs.units import TIMES, split_unit

_TIMES = {"time", "t", "timestamp", "stamp", "timestamps", "zeit", "datetime", "sec", "seconds"}
_COMMANDS = (
    "motor", "command", "cmd", "servo", "actuator", "setpoint", "input", "encoder", "joint",
    "action",
)  # fmt: skip
_TIPS = ("tip", "measured", "tracker", "jaw", "output", "marker", "sensor", "aurora", "pose")
LEAST_CORRELATION = 0.5
MOST_PAIRS = 3
_ENOUGH = 20_000
"""Samples by which two columns are compared."""


@dataclass(frozen=True)
class Column:
    """A column of numbers, from number 1 on; the unit is empty if the file does not name it."""

    number: int
    title: str
    unit: str
    count: int
    least: float
    largest: float


def time_column(titles: list[str]) -> str | None:
    """Title of the column of the time, if one is called so."""
    for title in titles:
        name, unit = split_unit(title)
        if name.strip("_ ").lower() in _TIMES and (not unit or unit in TIMES):
            return title
    return None


def list_columns(sheet: Sheet) -> tuple[list[Column], list[tuple[str, str]], list[RecordError]]:
    """Columns of numbers, pairs of command and tip, and why other columns are left out.

    The most likely pair is the first.

    A pair is proposed if its values are correlated; names such as motor and tip come first. Which
    of two is the command follows from their names, else from which of them lags.

    Raises:
        RecordError: No column has numbers.
    """
    columns, moving, left_out = [], {}, []
    time = time_column(sheet.titles)
    for index, title in enumerate(sheet.titles):
        try:
            values, _ = sheet.values(index, title)
        except RecordError as error:
            left_out.append(error)
            continue
        seen = values[np.isfinite(values)]
        if not len(seen):
            left_out.append(RecordError(f"{sheet.file}, column {title}", "no value", "numbers"))
            continue
        least, largest = float(seen.min()), float(seen.max())
        columns.append(Column(index + 1, title, sheet.unit(index), len(seen), least, largest))
        is_counter = np.all(np.diff(seen) > 0)
        if title != time and not is_counter and len(seen) > 3 and least < largest:
            name = title if sheet.titles.count(title) == 1 else str(index + 1)
            moving[name] = filled(values)[:: -(-len(values) // _ENOUGH)]
    if not columns:
        begin = f"the data begin at {sheet.line} {sheet.rows[0]}" if len(sheet.rows) else "no data"
        got = f"no column of numbers: {begin}"
        refused = RecordError(sheet.file, got, "numbers below a line of titles")
        for each in left_out if len(sheet.rows) else ():
            refused.add_note(str(each))
        raise refused
    own = _components(sheet.titles)
    pairs = [
        (strength, *_ordered(one, other, moving))
        for one, other in combinations(moving, 2)
        if _parent(one) != _parent(other) and not {(one, other), (other, one)} & own
        if (strength := _strength(one, other, moving)) > LEAST_CORRELATION
    ]
    pairs.sort(key=lambda pair: -pair[0])
    return columns, [(command, tip) for _, command, tip in pairs[:MOST_PAIRS]], left_out


def _components(titles: list[str]) -> set[tuple[str, str]]:
    """Each component of a pose with the column that was made from it."""
    return {
        (titles[k], made)
        for prefix, columns in find_axes(titles)
        for made in titles
        if split_unit(made)[0] in (title_of(prefix, "turn"), title_of(prefix, "travel"))
        for k in columns
    }


def _parent(title: str) -> str:
    """/TOPIC/FIELD of a column of a bag, whose columns have one source; of others the title."""
    return title.rpartition("/")[0] if title.startswith("/") else title


def _rank(name: str) -> int:
    """-1 for a name of a command, 1 for that of a tip, 0 for others."""
    low = name.lower()
    return any(word in low for word in _TIPS) - any(word in low for word in _COMMANDS)


def _strength(one: str, other: str, values: dict[str, Floats]) -> float:
    """Magnitude of the correlation, and 1 more if the names are of a command and of a tip."""
    a, b = (values[name] - values[name].mean() for name in (one, other))
    a, b = (each / (float(np.linalg.norm(each)) or 1.0) for each in (a, b))
    return ({_rank(one), _rank(other)} == {-1, 1}) + abs(float(a @ b))


def _ordered(one: str, other: str, values: dict[str, Floats]) -> tuple[str, str]:
    """Command and tip."""
    if _rank(one) != _rank(other):
        return (one, other) if _rank(one) < _rank(other) else (other, one)
    a, b = (values[name] - values[name].mean() for name in (one, other))
    lag = float(a[:-1] @ b[1:] - a[1:] @ b[:-1]) * np.sign(a @ b)
    return (one, other) if lag >= 0 else (other, one)
