"""Placeholders: values of a configuration that differ between rigs and are not yet replaced.

A line of a TOML file has one if its comment has the word REPLACE, as in
``tautscope/config/rigs/article_rig.toml``.
"""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from typing import Any

import tomlkit
from tomlkit.items import Item

from tautscope.config.load import config_file
from tautscope.errors import ConfigError

MARK = "REPLACE"


def placeholders(path: str | PathLike[str] | None) -> tuple[str, ...]:
    """The keys with a placeholder in a TOML file that `load_config` reads, by dotted path."""
    if path is None:
        return ()
    document = tomlkit.parse(config_file(path).read_text(encoding="utf-8"))
    return tuple(_marked(document, ""))


def refuse_placeholders(path: str | PathLike[str]) -> None:
    """Refuse a configuration with placeholders.

    Raises:
        ConfigError: Names the keys.
    """
    found = placeholders(path)
    if found:
        allowed = f"your values, and lines without the word {MARK}"
        raise ConfigError(", ".join(found), f"placeholders of {config_file(path)}", allowed)


def _marked(table: Any, path: str) -> Iterator[str]:
    for key, item in table.items():
        place = f"{path}.{key}".lstrip(".")
        if isinstance(item, dict):
            yield from _marked(item, place)
        elif isinstance(item, Item) and MARK in item.trivia.comment:
            yield place
