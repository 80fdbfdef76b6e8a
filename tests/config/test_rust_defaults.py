"""The defaults of the Rust crates and of the C interface are those of Python."""

import os

from common.paths import ROOT
from tautscope import axes
from tautscope.config import dump_config

DEFAULTS = ROOT / "crates" / "config" / "src" / "defaults.toml"


def test_the_defaults_in_rust_are_these() -> None:
    text = dump_config(axes(1, width_limit=1.0))
    if "TAUTSCOPE_WRITE_DEFAULTS" in os.environ:
        DEFAULTS.write_text(text, encoding="utf-8")
    found = DEFAULTS.read_text(encoding="utf-8")
    assert found == text, f"write it: TAUTSCOPE_WRITE_DEFAULTS=1 uv run pytest {__file__}"
