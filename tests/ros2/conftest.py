"""A node under test on a stepped clock, and another node."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tautscope.config import load_config

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from ros2.peers import Peers, peers
from service_client import Client


@pytest.fixture
def both(tmp_path: Path) -> Iterator[Peers]:
    """A node with a driver in ROS, unconfigured, and another one."""
    with peers(load_config(), tmp_path) as found:
        yield found


@pytest.fixture
def client(both: Peers) -> Iterator[Client]:
    """A client of the services of the node under test."""
    with Client(both) as found:
        yield found
