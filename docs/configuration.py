"""Write docs/configuration.md: every key, from the docstrings and types of the sections.

``uv run docs/configuration.py``; tests/config/test_config_reference.py requires that the page is
up to date.
"""

import re
from pathlib import Path

import tomlkit
from tautscope.config import Config
from tautscope.config.descriptions import Key, all_sections, keys, package_text, section_text
from tautscope.config.fields import MOST_RATIO

PAGE = Path(__file__).with_suffix(".md")
HEAD = """# Configuration

{package}

`tautscope config` prints the default with these explanations, and with `--config rig.toml` yours.
A line whose comment has the word REPLACE is a placeholder: `tautscope run` refuses it,
`tautscope doctor` lists it.

After the default come unit and limits; without limits, a number has to be above 0. "any" is any
number, "3 x" three values of the kind, DOF the unit of the degree of freedom, m or rad. A number
with a default and without an upper limit may be from a {factor:.0f}th to {factor:.0f} times its
default: robots differ by less, and a wrong unit, which would switch a limit off, is more.
`[safety] unusual = ["safety.stall"]` allows any value for the keys that it names.
"""
SHORT = {
    r"a number (from|above|below|of)": r"\1",
    r"a whole number (from|above|below|of)": r"whole, \1",
    r"(?:from )([-\d.,]+ to)": r"\1",
    r"above ": "> ",
    r"below ": "< ",
    r"of at least ": ">= ",
    r"of at most ": "<= ",
    r"(\d) values, each a number(?= and a|$)": r"\1 x any",
    r"(\d) values, each": r"\1 x",
    r"a (list|table), each (item|value) a text$": "texts",
    r" or (?=\")": ", ",
}
"""Words of a range -> how the page writes them."""
LAST = """
## Settings of algorithms

`tautscope config` prints the keys, with units, limits and meaning, of marker detection and
simulation, and of `tautscope calibrate`.
"""
INTERNAL = ("vision", "twin", "calibration")
"""Sections without their keys: whoever sets them reads `tautscope config`."""


def page() -> str:
    """The whole page."""
    parts = [
        HEAD.format(
            package=package_text(),
            factor=MOST_RATIO,
        )
    ]
    described: set[object] = set()
    internal = []
    for path, section in all_sections():
        if path.startswith(INTERNAL):
            internal.append(f"- `[{path}]`: {section_text(section).splitlines()[0]}")
            continue
        title = f"`[{path}]`" if path else "Top level"
        parts.append(f"\n## {title}\n")
        if section in described:
            first = next(name for name, kind in all_sections() if kind is section)
            parts.append(f"As `[{first}]`{_other_defaults(path, first)}.\n")
            continue
        described.add(section)
        parts.append(f"{section_text(section)}\n")
        rows = [key for key in keys(section) if key.section is None]
        if rows:
            parts.append("| key | default | meaning |\n|---|---|---|")
            parts += [_row(path, key) for key in rows]
            parts.append("")
    return "\n".join([*parts, LAST, *internal, ""])


def _row(path: str, key: Key) -> str:
    unit = f" [{key.unit}]" if key.unit else ""
    limits = short_range(key.allowed)
    is_whole = isinstance(_value(path, key.name), int)
    limits = limits.removeprefix("whole, ") if is_whole else limits
    limits = "" if re.fullmatch(r"(\d x )?> 0", limits) else limits
    limits = f"of {limits}" if limits.startswith('"') else limits
    value = f"{_default(key, _value(path, key.name))} {key.unit.replace('m or rad', 'DOF')}".strip()
    cells = (
        f"`{key.name}`",
        ", ".join(filter(None, (value, limits))),
        key.text.removeprefix(f"{unit[1:]}; ").replace(unit, "", 1),
    )
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def short_range(allowed: str) -> str:
    """A range in symbols: ``> 0`` for ``a number above 0``; empty for a whole type."""
    if allowed in ("a text", "true or false", "a table"):
        return ""
    if allowed == "a number":
        return "any"
    for words, symbols in SHORT.items():
        allowed = re.sub(words, symbols, allowed)
    return allowed


def _other_defaults(path: str, first: str) -> str:
    """The defaults that differ from those of the first section of the same type."""
    found = [
        f"`{key.name}` {_default(key, _value(path, key.name))}"
        for key in keys(dict(all_sections())[path])
        if key.section is None and _value(path, key.name) != _value(first, key.name)
    ]
    return f", but {', '.join(found)}" if found else ""


def _value(path: str, name: str) -> object:
    """The value in the default configuration; None without one."""
    place: object = Config()
    for part in [*path.split("."), name] if path else [name]:
        place = getattr(place, part, None)
    return place


def _default(key: Key, value: object) -> str:
    if key.is_required and value is None:
        return "required"
    value = key.default if value is None else value
    if value is None:
        return "none"
    plain = list(value) if isinstance(value, tuple) else value
    return f"`{tomlkit.item(plain).as_string()}`" if plain != {} else "`{}`"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
