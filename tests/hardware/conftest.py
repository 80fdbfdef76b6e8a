"""Fixtures: a CAN bus with simulated drives."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drives import SimulatedDrives
from tautscope.config import DrivesConfig


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[Hub]:
    with Hub(tmp_path / "can") as hub:
        yield hub


@pytest.fixture
def station(hub: Hub) -> Iterator[Callable[[], LocalBus]]:
    """Make stations on the bus; they are disconnected at the end."""
    with ExitStack() as stack:
        yield lambda: stack.enter_context(LocalBus(str(hub.path)))


@pytest.fixture
def bench(station: Callable[[], LocalBus]) -> Iterator[Callable[..., SimulatedDrives]]:
    """Make simulated drives on the bus; they are powered off at the end."""
    with ExitStack() as stack:

        def make(config: DrivesConfig, *arguments: Any, **options: Any) -> SimulatedDrives:
            return stack.enter_context(SimulatedDrives(station(), config, *arguments, **options))

        yield make
