"""A node under test on a stepped clock, and another node."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from ros2.peers import Peers, peers
from service_client import Client
from tautscope.config import load_config


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
