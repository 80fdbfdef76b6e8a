"""Shared fixtures: less to draw and to fit."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from tautscope.analysis.comparison import analyze
from tautscope.analysis.models.registry import MODELS


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are composed, but their files are empty."""

    def savefig(_: Figure, file: object, **_options: object) -> None:
        if isinstance(file, Path):
            file.touch()

    monkeypatch.setattr(Figure, "savefig", savefig)


@pytest.fixture
def three_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are fitted at once."""
    models = tuple(model for model in MODELS if model.name in {"none", "play", "paper"})
    monkeypatch.setattr(analyze, "__defaults__", (None, None, models))
