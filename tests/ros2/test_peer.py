"""The services of the node, called by `hiroz`, an implementation of ROS 2 in Rust.

`benchmarks/ros2` builds the client, which takes more than ten minutes, and measures the round trip.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from ros2.live import PEER
from ros2.peers import free_endpoint


@pytest.mark.skipif(not PEER.exists(), reason="tests/ros2/peer is not built: see benchmarks/ros2")
def test_the_parameters_are_read_and_set_by_another_implementation(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    command = [sys.executable, "-W", "error", "-m", "tautscope", "ros2", "--driver", "--json"]
    with subprocess.Popen(
        [*command, "--listen", endpoint, "--out", tmp_path / "out"],
        stdout=subprocess.PIPE,
        text=True,
    ) as node:
        assert node.stdout is not None
        assert "tautscope" in node.stdout.readline()
        found = subprocess.run(
            [PEER, endpoint, "parameters"], capture_output=True, text=True, timeout=60, check=False
        )
        node.terminate()
    names = '"compensation", "control.period", "profile", "safety.reference_age"'
    assert found.stdout.splitlines() == [
        f"list [{names}]",
        'get [Double(1.0), Double(0.005), String("best"), NotSet]',
        "read_only false range "
        "Some(FloatingPointRange { from_value: 0.0, to_value: 1.0, step: 0.0 })",
        'set [true, false] "compensation: got 2, expected 0 to 1"',
        'atomic false "profile: can only be read"',
        "after [Double(0.5)]",
    ], found.stderr
