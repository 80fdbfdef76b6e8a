"""A short run of the drawn rig, recorded once per session."""

from pathlib import Path

import pytest
from drawn import short_experiment
from matplotlib.figure import Figure
from recorded import record
from tautscope.config import Config
from tautscope.log.writer import LogSummary
from tautscope.runs.recording import Recording


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    savefig = Figure.savefig
    monkeypatch.setattr(
        Figure,
        "savefig",
        lambda figure, *file, **options: savefig(figure, *file, **options | {"dpi": 40}),
    )


@pytest.fixture(scope="session")
def config() -> Config:
    return short_experiment()


@pytest.fixture(scope="session")
def recorded(
    tmp_path_factory: pytest.TempPathFactory, config: Config
) -> tuple[Path, Recording, LogSummary]:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    return path, *record(path, config, 6.0)
