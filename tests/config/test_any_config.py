"""Arbitrary configurations either load, or raise an error that names the key."""

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
    """The paths of all sections and keys."""
    found = []
    for key, value in document.items():
        found.append((*above, key))
        if isinstance(value, dict):
            found += paths(value, (*above, key))
    return found


def assert_loads_or_names_the_key(document: dict[str, Any]) -> None:
    try:
        config = from_document(document)
    except ConfigError as error:
        assert error.field
    else:
        assert from_document(to_document(config)) == config


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.sampled_from(paths(GOOD)), ANYTHING)
def test_any_value_of_any_key(path: tuple[str, ...], value: Any) -> None:
    *sections, key = path
    change: dict[str, Any] = {key: value}
    for section in reversed(sections):
        change = {section: change}
    assert_loads_or_names_the_key(change)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.dictionaries(st.sampled_from([path[0] for path in paths(GOOD)]), ANYTHING, max_size=4))
def test_any_document(document: dict[str, Any]) -> None:
    assert_loads_or_names_the_key(document)


TEXT = dump_config(Config()).encode()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    start=st.integers(0, len(TEXT)),
    removed=st.integers(0, 40),
    added=st.binary(max_size=20) | st.text(st.characters(codec="utf-8")).map(str.encode),
)
def test_any_bytes_in_the_file(
    tmp_path_factory: pytest.TempPathFactory, start: int, removed: int, added: bytes
) -> None:
    file = tmp_path_factory.mktemp("config") / "config.toml"
    file.write_bytes(TEXT[:start] + added + TEXT[start + removed :])
    try:
        load_config(file)
    except ConfigError as error:
        assert error.field
