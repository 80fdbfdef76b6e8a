"""Placeholders: values of a configuration that differ between rigs and are not yet replaced.

A key, table or entry of a TOML file is one if the comment beside it has the word REPLACE, as in
``tautscope/config/rigs/article_rig.toml``.
"""

from collections.abc import Iterator
from os import PathLike
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.items import AoT, Array, InlineTable, Table

from tautscope.config.load import config_file
from tautscope.errors import ConfigError

MARK = "REPLACE"


def placeholders(path: str | PathLike[str] | None) -> tuple[str, ...]:
    """The placeholders in a TOML file that `load_config` reads, by dotted path."""
    if path is None:
        return ()
    document = tomlkit.parse(config_file(path).read_text(encoding="utf-8"))
    return tuple(_in_body(document, ""))


def refuse_placeholders(path: str | PathLike[str] | None) -> None:
    """Refuse a configuration with placeholders, with a `ConfigError` that names them."""
    found = placeholders(path)
    if path is not None and found:
        allowed = f"your values, and lines without the word {MARK}"
        raise ConfigError(", ".join(found), f"placeholders of {config_file(path)}", allowed)


def _marked(item: Any, place: str) -> Iterator[str]:
    """The placeholders in an item of tomlkit."""
    if isinstance(item, AoT):
        for index, entry in enumerate(item):
            yield from _marked(entry, f"{place}[{index}]")
        return
    is_inside = isinstance(item, Array) and MARK in item.as_string()
    is_header = not (isinstance(item, Table) and item.is_super_table())  # else its first child's
    if is_inside or (MARK in item.trivia.comment and is_header):
        yield place
    if isinstance(item, Table | InlineTable):
        yield from _in_body(item.value, f"{place}.")


def _in_body(container: Container, path: str) -> Iterator[str]:
    # Not as a dictionary, which loses the headers of a table that is written in several parts.
    for key, item in container.body:
        if key is not None:
            yield from _marked(item, f"{path}{key.key}")
