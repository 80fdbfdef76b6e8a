"""EDS files (CiA 306): the types of a drive's objects, and whose drive it is.

Makers' files have comments in any encoding, blank, missing, double and orphaned entries. Nothing
but the types of objects that are used, vendor and product number is read, so that no other entry
can make a file unusable.
"""

import re
from pathlib import Path
from typing import NamedTuple

from tautscope.hardware.object_dictionary import MODES_OF_OPERATION, device_profile

_SECTION = re.compile(r"\[\s*([^]]*?)\s*\]")
_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_FLOATS = (0x08, 0x11)
"""CiA 301 data types REAL32 and REAL64."""

Sections = dict[str, dict[str, str]]


class Described(NamedTuple):
    """What an EDS file tells: CiA 301 data types by index and sub-index, vendor, product number."""

    types: dict[tuple[int, int], int]
    vendor: int | None = None
    product: int | None = None


def load_eds(path: str | None, node: int) -> Described:
    """The types of objects in an EDS file; without a file, those of `device_profile`.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is not an EDS file of a CiA 402 drive; the message says why.
    """
    profile = {(entry.index, entry.subindex): entry for entry in device_profile(node)}
    if path is None:
        return Described({key: entry.data_type for key, entry in profile.items()})
    sections = _sections(_decoded(Path(path).read_bytes()))
    found = {key: number for key in profile if (number := _data_type(sections, key)) is not None}
    for key, number in found.items():
        if number in _FLOATS:
            raise ValueError(f"{profile[key]} is not an integer: DataType 0x{number:04X}")
    if not any(index == MODES_OF_OPERATION.index for index, _ in found):
        raise ValueError(f"it does not describe a CiA 402 drive: no {MODES_OF_OPERATION}")
    vendor, product = (
        _number(sections, "deviceinfo", key) for key in ("vendornumber", "productnumber")
    )
    return Described(found, vendor, product)


def _decoded(data: bytes) -> str:
    """The text of a file in UTF-8 or UTF-16 with byte order mark, else in Windows' code page."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _sections(text: str) -> Sections:
    """Sections, keys and values in lower case; of double ones the first counts, as on Windows.

    Numbers of objects are without leading zeros: ``[1018Sub01]`` is ``1018sub1``.
    """
    sections: Sections = {}
    section: dict[str, str] = {}
    for line in text.lower().splitlines():
        stripped = line.strip()
        key, separator, value = stripped.partition("=")
        if heading := _SECTION.match(stripped):
            name = heading[1]
            if found := _OBJECT.fullmatch(name):
                name = _name(int(found[1], 16), int(found[2], 16) if found[2] else None)
            section = sections.setdefault(name, {})
        elif separator and not stripped.startswith((";", "#")):
            section.setdefault(key.strip(), value.partition(";")[0].strip())
    return sections


def _name(index: int, subindex: int | None) -> str:
    return f"{index:04x}" if subindex is None else f"{index:04x}sub{subindex:x}"


def _data_type(sections: Sections, key: tuple[int, int]) -> int | None:
    """The type of an object; None if the file lacks it or leaves it blank."""
    index, subindex = key
    found = _number(sections, _name(index, subindex), "datatype")
    whole = sections.get(_name(index, None), {})
    if found is None and (not subindex or whole.get("compactsubobj", "0") not in ("", "0")):
        found = _number(sections, _name(index, None), "datatype")
    return found


def _number(sections: Sections, section: str, key: str) -> int | None:
    """A number as in CiA 306: decimal, hexadecimal with 0x, octal with 0; None if it is blank."""
    text = sections.get(section, {}).get(key, "")
    try:
        octal = re.fullmatch(r"0[0-7]+", text)
        return int(text, 8 if octal else 0) if text else None
    except ValueError:
        if text.isdecimal():  # 08
            return int(text)
        raise ValueError(f"[{section}] {key}: got {text!r}, expected a number") from None
