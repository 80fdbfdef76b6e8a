"""A configuration as TOML that explains itself: each key with its meaning, unit and range."""

import textwrap
from collections.abc import Collection, Iterator

import tomlkit

from tautscope.config.descriptions import keys, package_text, section_text
from tautscope.config.edit import inline
from tautscope.config.placeholders import MARK
from tautscope.config.root import Config
from tautscope.config.section import Section

_WIDTH = 98
_MARK = f"  # {MARK}"


def template(config: Config, placeholders: Collection[str] = ()) -> str:
    """TOML with every key; `load_config` reads it back equal.

    Keys and sections without a value are comments. Those in `placeholders`, by dotted path, keep
    their mark.
    """
    header = "\n".join(_comment(package_text(), ""))
    lines = _section(config, Config, ("", ""), set(placeholders), set())
    return "\n".join([header, *lines]) + "\n"


def _section(
    values: Section | None,
    kind: type[Section],
    at: tuple[str, str],
    marked: set[str],
    described: set[type[Section]],
) -> Iterator[str]:
    """The lines of a section at (header, path), and of those in it; comments without values."""
    header, path = at
    is_new, sign = kind not in described, "# " if values is None else ""
    described.add(kind)
    yield ""
    if header:
        yield f"{sign}[{header}]" + (_MARK if path in marked else "")
    yield from _comment(section_text(kind) if is_new else "Keys as described above.", sign)
    yield ""
    named: list[tuple[str, Section]] = []
    for key in keys(kind):
        value = key.default if values is None else getattr(values, key.name)
        place = f"{path}.{key.name}".lstrip(".")
        if key.is_list and key.section is not None:
            for k, entry in enumerate(value or (None,)):
                of_entry = f"[{place}]", f"{place}[{k}]"
                yield from _section(entry, key.section, of_entry, marked, described)
            continue
        if key.section is not None:
            yield from _section(value, key.section, (place, place), marked, described)
            continue
        if is_new:
            yield from _comment(f"{key.text} Allowed: {key.allowed}.", sign)
        if isinstance(value, dict) and any(isinstance(one, Section) for one in value.values()):
            named += [(f"{place}.{name}", entry) for name, entry in value.items()]
        elif value is None:
            yield f"{sign}{key.name} = ...  # required" if key.is_required else f"# {key.name} ="
        else:
            mark = _MARK if any(f"{one}.".startswith(f"{place}.") for one in marked) else ""
            yield f"{sign}{key.name} = {tomlkit.item(inline(value)).as_string()}{mark}"
    for place, entry in named:
        yield from _section(entry, type(entry), (place, place), marked, described)


def _comment(text: str, sign: str) -> Iterator[str]:
    for paragraph in text.split("\n\n"):
        for line in textwrap.wrap(paragraph, _WIDTH - len(sign)):
            yield f"{sign}# {line}"
