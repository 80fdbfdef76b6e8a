"""Write docs/configuration.md: every key, from the docstrings and types of the sections.

``uv run docs/configuration.py``; tests/config/test_config_reference.py requires that the page is
up to date.
"""

from __future__ import annotations

import re
from pathlib import Path

import tomlkit
from tautscope.config import Config
from tautscope.config.checks import RANGED
from tautscope.config.descriptions import Key, all_sections, keys, package_text, section_text
from tautscope.config.fields import MOST_RATIO

PAGE = Path(__file__).with_suffix(".md")
HEAD = """# Configuration

{package}

`tautscope config` prints the default with these explanations, and with `--config rig.toml` yours.
`Config(profile="nope")` in Python raises the same `ConfigError` as a file that
`tautscope.load_config` reads. A line whose comment has the word REPLACE is a placeholder:
`tautscope run` refuses it, `tautscope doctor` lists it. `uv run docs/configuration.py` writes this
page.

"Allowed" is empty where every value of the default's type is; "3 x" is three values of the kind.

In {ranged}
a number that has no upper limit below may be from a {factor:.0f}th to {factor:.0f} times its
default: robots differ by less, and a wrong unit or a digit too many, which would switch a limit
off, is more. `[safety] unusual = ["safety.stall"]` allows any value for the keys that it names;
every report names them.
"""
SHORT = {
    r"a number (from|above|below|of)": r"\1",
    r"a whole number (from|above|below|of)": r"whole, \1",
    r"(?:from )([-\d.,]+ to)": r"\1",
    r"above ": "> ",
    r"below ": "< ",
    r"of at least ": ">= ",
    r"of at most ": "<= ",
    r"(\d) values, each a number(?= and a|$)": r"\1 numbers",
    r"(\d) values, each": r"\1 x",
}
"""Words of a range -> how the page writes them."""


def page() -> str:
    """The whole page."""
    parts = [
        HEAD.format(
            package=package_text(),
            factor=MOST_RATIO,
            ranged=", ".join(f"`[{name}]`" for name in RANGED),
        )
    ]
    described: set[object] = set()
    for path, section in all_sections():
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
            parts.append("| key | default | allowed [unit] | meaning |\n|---|---|---|---|")
            parts += [_row(path, key) for key in rows]
            parts.append("")
    return "\n".join(parts)


def _row(path: str, key: Key) -> str:
    unit = f" [{key.unit}]" if key.unit else ""
    cells = (
        f"`{key.name}`",
        _default(key, _value(path, key.name)),
        f"{short_range(key.allowed)}{unit}".strip(),
        key.text.removeprefix(f"{unit[1:]}; ").replace(unit, "", 1),
    )
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def short_range(allowed: str) -> str:
    """A range in symbols: ``> 0`` for ``a number above 0``; empty for a whole type."""
    if allowed in ("a number", "a text", "true or false", "a table"):
        return ""
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
