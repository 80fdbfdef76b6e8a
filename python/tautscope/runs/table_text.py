"""A table as text: where it begins, its delimiter, titles and units, recognised by its head."""

import csv
import gzip
import re
import zlib
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import RecordError
from tautscope.runs.units import unit_of

NO_VALUE = ("", "nan", "na", "n/a", "null", "none", "-")
_LEFT_OUT = re.compile(rb"^[ \t]*(?:$|#|%|//)", re.MULTILINE)
_MARK = re.compile(r"^\s*(?:#+|%+|//+)\s*")
_SEPARATOR = re.compile(rb'"?sep=(.)"?\n', re.IGNORECASE)
_END_OF_HEADER = b"***End_of_Header***"  # of LabVIEW, once or twice
_HEAD = 100  # lines by which the table is recognised
_DELIMITERS = ("\t", ";", ",", "|", " ")
_VALUE = re.compile(
    r"[+-]?(\d+([.,]\d*)*|[.,]\d+)([eE][+-]?\d+)?|[+-]?inf|\d+[-/.:]\d+[-/.:]\d+.*", re.IGNORECASE
)
_INTEGER = re.compile(r"[+-]?\d+")


@dataclass(frozen=True, eq=False)
class TableText:
    """Data lines of a table, and what is above them.

    Attributes:
        titles: Of the columns; their numbers where there is no title.
        groups: Titles above the titles, each for all columns up to the next; empty if there are
            none.
        units: Of a line of units below the titles; empty if there is none.
        data: The lines below, without comments and blank lines.
        rows: (n,) their numbers in the file, from 1 on.
    """

    titles: list[str]
    groups: list[str]
    units: list[str]
    delimiter: str
    data: bytes
    rows: NDArray[np.int64]


def split_table(data: bytes, file: str) -> TableText:
    """Find titles, units and data lines.

    Data begin at the first of two lines with numbers and as many cells as most lines have. The
    line above has the titles, or else the last comment line with as many cells.

    Raises:
        RecordError: It is no text, or has no lines.
    """
    data = _as_utf8(_unpacked(data, file), file).rstrip()
    above, forced = 0, None
    header, end, rest = data.rpartition(_END_OF_HEADER)
    if end:
        _, _, data = rest.partition(b"\n")
        above = header.count(b"\n") + 1
    if match := _SEPARATOR.match(data):
        data, forced, above = data[match.end() :], match[1].decode(), above + 1
    kept = np.arange(data.count(b"\n") + 1)
    comments: list[bytes] = []
    if _LEFT_OUT.search(data):
        lines = data.split(b"\n")
        kept = np.array([k for k, x in enumerate(lines) if not _LEFT_OUT.match(x)], np.int64)
        comments = lines[: kept[-1]][:_HEAD] if len(kept) else []
        data = b"\n".join([lines[k] for k in kept])
    if not data:
        raise RecordError(file, "there is no header", "a header line with the columns' titles")
    head = [line.decode() for line in data.split(b"\n", _HEAD)[:_HEAD]]
    delimiter = forced or _delimiter(head)
    cells = [_cells(line, delimiter) for line in head]
    width = _usual_width(cells)
    begin = _first_data(cells, width)
    if delimiter == "," and begin < len(cells):
        _check_decimal_commas(cells[:begin], cells[begin:], file)
    titles, groups, units, used = _titles(cells[:begin], width)
    if not titles:
        marked = [_cells(_MARK.sub("", line.decode()), delimiter) for line in comments]
        begins = kept[begin] if begin < len(kept) else len(marked)
        matching = [line for line in marked[:begins] if len(line) == width and width > 1]
        titles = matching[-1] if matching else []
    if begin == len(cells) and used == 0:
        titles, begin = cells[0], 1
    body = data.split(b"\n", begin)[begin] if data.count(b"\n") >= begin else b""
    if delimiter == " ":
        body = re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+", b"", body))
    titles = titles + [str(k + 1) for k in range(len(titles), width)]
    delimiter = "\t" if delimiter == " " else delimiter
    return TableText(titles, groups, units, delimiter, body, kept[begin:] + 1 + above)


def _check_decimal_commas(above: list[list[str]], data: list[list[str]], file: str) -> None:
    """Refuse 0,5,1,5 below two titles: decimal commas between commas."""
    count = len(above[-1]) if above else 0
    if count > 1 and all(
        len(line) == 2 * count and all(map(_INTEGER.fullmatch, line)) for line in data
    ):
        found = f"{2 * count} whole numbers in a line below {count} titles"
        allowed = "a delimiter that is not the decimal comma, such as a semicolon"
        raise RecordError(file, found, allowed)


def _titles(above: list[list[str]], width: int) -> tuple[list[str], list[str], list[str], int]:
    """Titles, groups and units of the lines above the data, and how many lines those are."""
    units: list[str] = []
    used = 0
    if above and any(above[-1]) and all(not cell or unit_of(cell) for cell in above[-1]):
        units = [unit_of(cell) for cell in above[-1]]
        above, used = above[:-1], 1
    if not above or len(above[-1]) < max(width - 1, 1):
        return [], [], units, used
    titles = above[-1]
    groups: list[str] = []
    if len(above) > 1 and len(above[-2]) == len(titles) and not all(above[-2]) and any(above[-2]):
        for cell in above[-2]:
            groups.append(cell or (groups[-1] if groups else ""))
    return titles, groups, units, used + 1


def _first_data(cells: list[list[str]], width: int) -> int:
    is_data = [
        len(line) >= width - 1
        and (any(map(_VALUE.fullmatch, line)) or all(cell.lower() in NO_VALUE for cell in line))
        for line in cells
    ]
    for k, now in enumerate(is_data):
        if now and (k + 1 == len(is_data) or is_data[k + 1]):
            return k
    return len(cells)


def _usual_width(cells: list[list[str]]) -> int:
    """Number of cells of most lines; the larger one if two are as frequent."""
    counts = Counter(map(len, cells))
    return max(counts, key=lambda size: (counts[size], size))


def _delimiter(head: list[str]) -> str:
    """The delimiter by which most lines have as many cells, more than one."""

    def score(delimiter: str) -> tuple[float, bool]:
        widths = Counter(len(_cells(line, delimiter)) for line in head)
        widths.pop(1, None)
        return max(widths.values(), default=0), delimiter in head[-1]

    best = max(_DELIMITERS, key=score)
    return best if score(best)[0] else ","


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    if len(line) > csv.field_size_limit():  # which the reader refuses; it is no line of titles
        return [cell.strip() for cell in line.split(delimiter)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def _unpacked(data: bytes, file: str) -> bytes:
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordError(file, str(error), "a complete gzip file") from None


def _as_utf8(data: bytes, file: str) -> bytes:
    allowed = "a CSV file, also as .gz, or a Parquet, .npz or .mat file"
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeDecodeError as error:
            raise RecordError(file, str(error), allowed) from None
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\0" in data:
        raise RecordError(file, "a zero byte", allowed)
    try:
        data.decode()
    except UnicodeDecodeError:
        data = data.decode("latin-1").encode()
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
