"""Shared fixtures."""

import pytest
from tautscope.analysis.comparison import analyze
from tautscope.analysis.models.registry import MODELS


@pytest.fixture
def three_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are fitted at once."""
    models = tuple(model for model in MODELS if model.name in {"none", "play", "paper"})
    monkeypatch.setattr(analyze, "__defaults__", (None, None, models))
