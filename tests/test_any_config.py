"""Configuration that is broken in any way: an error that names the key, or one that is whole."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tautscope.config import Config, dump_config, from_document, load_config, to_document
from tautscope.errors import ConfigError

GOOD = to_document(Config())
NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-(2**63), 2**63 - 1)
LEAVES = NUMBERS | st.booleans() | st.text(max_size=6)
ANYTHING = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner),
    max_leaves=6,
)


def paths(document: dict[str, Any], above: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key, sections and what is in them."""
    found = []
    for key, value in document.items():
        found.append((*above, key))
        if isinstance(value, dict):
            found += paths(value, (*above, key))
    return found


def loaded_or_refused(document: dict[str, Any]) -> None:
    try:
        config = from_document(document)
    except ConfigError as error:
        assert error.field
    else:
        assert from_document(to_document(config)) == config


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.sampled_from(paths(GOOD)), ANYTHING)
def test_any_value_anywhere_is_taken_or_named(path: tuple[str, ...], value: Any) -> None:
    *sections, key = path
    change: dict[str, Any] = {key: value}
    for section in reversed(sections):
        change = {section: change}
    loaded_or_refused(change)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.dictionaries(st.sampled_from([path[0] for path in paths(GOOD)]), ANYTHING, max_size=4))
def test_any_document_is_taken_or_named(document: dict[str, Any]) -> None:
    loaded_or_refused(document)


TEXT = dump_config(Config()).encode()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    start=st.integers(0, len(TEXT)),
    removed=st.integers(0, 40),
    added=st.binary(max_size=20) | st.text(st.characters(codec="utf-8")).map(str.encode),
)
def test_any_bytes_in_the_file_are_taken_or_named(
    tmp_path_factory: pytest.TempPathFactory, start: int, removed: int, added: bytes
) -> None:
    file = tmp_path_factory.mktemp("config") / "config.toml"
    file.write_bytes(TEXT[:start] + added + TEXT[start + removed :])
    try:
        load_config(file)
    except ConfigError as error:
        assert error.field
