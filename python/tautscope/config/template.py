"""A configuration as TOML that explains itself: each key with its meaning, unit and range."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator

import tomlkit

from tautscope.config.descriptions import keys, package_text, section_text
from tautscope.config.edit import inline
from tautscope.config.placeholders import MARK
from tautscope.config.root import Config
from tautscope.config.section import Section

_WIDTH = 98


def template(config: Config, placeholders: Collection[str] = ()) -> str:
    """TOML with every key; `load_config` reads it back equal.

    Keys and sections without a value are comments. Keys in `placeholders`, by dotted path, keep
    their mark.
    """
    header = "\n".join(_comment(package_text(), ""))
    return "\n".join([header, *_section(config, Config, "", set(placeholders), set())]) + "\n"


def _section(
    values: Section | None,
    kind: type[Section],
    path: str,
    marked: set[str],
    described: set[type[Section]],
) -> Iterator[str]:
    """The lines of a section and of those in it; comments if it has no values."""
    is_new, sign = kind not in described, "# " if values is None else ""
    described.add(kind)
    yield ""
    if path:
        yield f"{sign}[{path}]"
    yield from _comment(section_text(kind) if is_new else "Keys as described above.", sign)
    yield ""
    for key in keys(kind):
        value = key.default if values is None else getattr(values, key.name)
        place = f"{path}.{key.name}".lstrip(".")
        if key.is_list and key.section is not None:
            for entry in value or (None,):
                yield from _section(entry, key.section, f"[{place}]", marked, described)
            continue
        if key.section is not None:
            yield from _section(value, key.section, place, marked, described)
            continue
        if is_new:
            yield from _comment(f"{key.text} Allowed: {key.allowed}.", sign)
        if value is None:
            yield f"{sign}{key.name} = ...  # required" if key.is_required else f"# {key.name} ="
        else:
            mark = f"  # {MARK}" if place in marked else ""
            yield f"{sign}{key.name} = {tomlkit.item(inline(value)).as_string()}{mark}"


def _comment(text: str, sign: str) -> Iterator[str]:
    for paragraph in text.split("\n\n"):
        for line in textwrap.wrap(paragraph, _WIDTH - len(sign)):
            yield f"{sign}# {line}"
