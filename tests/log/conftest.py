"""A short run of the drawn rig, recorded once per session."""

from pathlib import Path

import pytest
from drawn import short_experiment
from recorded import record
from tautscope.config import Config
from tautscope.log.writer import LogSummary
from tautscope.runs.recording import Recording


@pytest.fixture(scope="session")
def config() -> Config:
    return short_experiment()


@pytest.fixture(scope="session")
def recorded(
    tmp_path_factory: pytest.TempPathFactory, config: Config
) -> tuple[Path, Recording, LogSummary]:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    return path, *record(path, config, 6.0)
