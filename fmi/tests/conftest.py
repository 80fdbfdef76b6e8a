"""Builds the units once, and the recordings of the loop in Python."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1] / "examples" / "cpp")]

import build  # noqa: E402
import record  # noqa: E402
from fmu import CONFIG, Unit  # noqa: E402
from tautscope import Config  # noqa: E402
from tautscope.config import Profile  # noqa: E402

Builder = Callable[[str, Config], Path]


@pytest.fixture(scope="session")
def recorded() -> Callable[[Profile], record.Record]:
    """60 s of the loop at 1 kHz with every kind of event."""
    made: dict[Profile, record.Record] = {}

    def recording(profile: Profile) -> record.Record:
        if profile not in made:
            made[profile] = record.record_features(profile)
        return made[profile]

    return recording


@pytest.fixture(scope="session")
def builder(tmp_path_factory: pytest.TempPathFactory) -> Builder:
    """The file of a unit, built without a warning."""
    folder = tmp_path_factory.mktemp("units")
    made: dict[str, Path] = {}

    def unit(kind: str, config: Config) -> Path:
        key = build.token(kind, config)
        if key not in made:
            made[key] = folder / f"{kind}_{key}.fmu"
            build.build(kind, made[key], config)
        return made[key]

    return unit


@pytest.fixture
def opened(builder: Builder, tmp_path: Path) -> Iterator[Callable[..., Unit]]:
    """Initialized units, released after the test."""
    units: list[Unit] = []

    def unit(kind: str, config: Config = CONFIG, **parameters: float | str) -> Unit:
        # A folder of its own: a library that is loaded must not be written again.
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        units.append(Unit(builder(kind, config), folder, **parameters))
        return units[-1]

    yield unit
    for unit_ in units:
        unit_.close()
