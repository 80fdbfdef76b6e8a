"""Shared fixtures."""

import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import pytest
from common.paths import DATA
from drawn import DrawnRig, short_experiment
from matplotlib.figure import Figure
from tautscope.loop.references import SineSequence
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording
from tautscope.twin import camera, tissue

REAL_TIME = ("console", "hardware", "ros2")
"""Folders of tests with processes, buses and browsers in real time."""


def pytest_configure() -> None:
    """Set the environment of all processes that the tests start.

    Without bytecode each of hundreds compiles all that it imports; threads of the linear algebra
    wait for processors that are busy with other tests, and use them while they wait.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than processors: tests wait a fifth of the time, for processes and browsers."""
    return (os.cpu_count() or 1) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give tests in real time a second try: a busy computer may miss a deadline that they need.

    The summary lists the first failure as RERUN.
    """
    for item in items:
        if item.path.parent.name in REAL_TIME:
            item.add_marker(pytest.mark.flaky(reruns=1, reruns_delay=2))


def shared_data(*parts: str) -> Path:
    """A path in the shared data: TAUTSCOPE_DATA, or ../shared/data beside the repository.

    If it does not exist, the test is skipped, on CI it fails.
    """
    path = DATA.joinpath(*parts)
    if not path.exists():
        reason = f"no {path}: set TAUTSCOPE_DATA to the folder of the shared data"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return path


@pytest.fixture(scope="session", autouse=True)
def _mucosa_drawn_once() -> Iterator[None]:
    """Twins with the same seed and image size share one background image."""

    @lru_cache(maxsize=64)
    def draw(width: int, height: int, seed: int) -> tissue.Image:
        image = tissue.draw_mucosa(width, height, seed)
        image.flags.writeable = False
        return image

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(camera, "draw_mucosa", draw)
        yield


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are composed, but their files are empty."""

    def savefig(_: Figure, file: object, **_options: object) -> None:
        if isinstance(file, Path):
            file.touch()

    monkeypatch.setattr(Figure, "savefig", savefig)


@pytest.fixture(scope="session")
def colon_folder() -> Path:
    """The folder of the real colonoscopy frames."""
    return shared_data("colon_frames")


@pytest.fixture(scope="session")
def tool_folder() -> Path:
    """The folder of the records of real cable-driven tools."""
    return shared_data("davinci_tools")


@pytest.fixture(scope="session")
def uncompensated() -> Recording:
    """The article's experiment, shortened, on the drawn rig, without compensation."""
    return _run(compensate=False)


@pytest.fixture(scope="session")
def compensated() -> Recording:
    """The article's experiment, shortened, on the drawn rig, with compensation."""
    return _run(compensate=True)


@pytest.fixture(scope="session")
def runs(uncompensated: Recording, compensated: Recording) -> tuple[Recording, Recording]:
    """The experiment, without compensation first."""
    return uncompensated, compensated


def _run(compensate: bool) -> Recording:
    config = short_experiment()
    return run_experiment(DrawnRig(config), SineSequence(config.experiment), config, compensate)
