"""Changing values in a TOML file in place: comments and order stay."""

import os
import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import tomlkit
from tomlkit.items import InlineTable, Item, Table

from tautscope.config.load import RIGS
from tautscope.config.placeholders import MARK
from tautscope.config.root import from_document
from tautscope.config.section import without_numpy
from tautscope.errors import ConfigError, MissingPathError, OutputError

_PLACEHOLDER = re.compile(rf"\s*{MARK}\b[,:]?")


def write_values(path: str | PathLike[str], values: Mapping[str, Any]) -> None:
    """Change values in a TOML file; it is replaced in one step, or not at all.

    Args:
        path: The file; the word REPLACE beside a changed value is removed.
        values: Dotted path -> value, as for `Config.replace`.

    Raises:
        MissingPathError: The file does not exist.
        ConfigError: It is a shipped configuration, or the result would not be valid.
        OutputError: It cannot be written.
    """
    file = writable_file(path).resolve()  # a link stays one
    text = edited_text(file.read_text(encoding="utf-8"), values)
    from_document(tomllib.loads(text))
    try:
        with NamedTemporaryFile(
            "w", encoding="utf-8", dir=file.parent, prefix=f".{file.name}.", delete=False
        ) as partial:
            partial.write(text)
            partial.flush()
            os.fsync(partial.fileno())
        Path(partial.name).chmod(file.stat().st_mode)
        Path(partial.name).replace(file)
    except OSError as error:
        with suppress(OSError, UnboundLocalError):
            Path(partial.name).unlink()
        allowed = f"a file in a folder that can be written ({error.strerror})"
        raise OutputError("config", str(path), allowed) from None


def writable_file(path: str | PathLike[str]) -> Path:
    """The file of a configuration that may be changed; it exists, and is not a shipped one.

    Raises:
        MissingPathError: The file does not exist.
        ConfigError: It is a shipped configuration.
    """
    file = Path(path)
    if file.is_file():
        return file
    if str(path) in RIGS:
        remedy = f"a file of your own: tautscope config --config {path} > rig.toml"
        raise ConfigError("config", str(path), remedy)
    raise MissingPathError("config", str(file), "a TOML file")


def edited_text(text: str, values: Mapping[str, Any]) -> str:
    """The text of a TOML file with changed values, which may be a part of a configuration.

    Raises:
        ConfigError: The text is not TOML, or has no place for the values.
    """
    for inline_too in (False, True):  # a header among dotted keys would take the keys below it
        try:
            document = _edited(text, values, inline_too)
        except (tomlkit.exceptions.TOMLKitError, RecursionError) as error:
            raise ConfigError("config", text.partition("\n")[0], f"TOML ({error})") from None
        edited = tomlkit.dumps(document)
        with suppress(tomllib.TOMLDecodeError):
            if tomllib.loads(edited) == document.unwrap():
                return edited
    allowed = "tables such as [camera], into which the values can be written"
    raise ConfigError("config", ", ".join(values), allowed)


def _edited(text: str, values: Mapping[str, Any], is_inline: bool) -> tomlkit.TOMLDocument:
    """A changed document, with new sections in others as inline tables if `is_inline`."""
    document = tomlkit.parse(text)
    for path, value in values.items():
        *sections, key = path.split(".")
        place: Any = document
        for section in sections:
            if section not in place:
                # A table without values of its own has no header.
                is_super = isinstance(value, dict) or section != sections[-1]
                if isinstance(place, InlineTable) or (is_inline and place is not document):
                    place[section] = tomlkit.inline_table()
                else:
                    place[section] = tomlkit.table(is_super_table=is_super)
            place = place[section]
        _set(place, key, without_numpy(value), is_inline)
    return document


def _set(place: Any, key: str, value: Any, is_inline: bool) -> None:
    if isinstance(value, dict):
        has_header = isinstance(place, Table) and not is_inline
        table: Any = tomlkit.table() if has_header else tomlkit.inline_table()
        for name, item in value.items():
            table[name] = inline(item)
        place[key] = table
        return
    place[key] = inline(value)
    item = place.item(key) if hasattr(place, "item") else place[key]
    if isinstance(item, Item) and MARK in item.trivia.comment:
        comment = _PLACEHOLDER.sub("", item.trivia.comment)
        if not comment.strip("# "):
            comment = item.trivia.comment_ws = ""
        item.trivia.comment = comment


def inline(value: Any) -> Any:
    """A value as tomlkit writes it in one line."""
    if isinstance(value, dict):
        table = tomlkit.inline_table()
        table.update(value)
        return table
    return list(value) if isinstance(value, tuple) else value
