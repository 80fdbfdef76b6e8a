"""Drives on the bus start, follow commands, and stop."""

from collections.abc import Callable

import numpy as np
import pytest
from drive_settings import drives_config
from tautscope.bench.can_bus import Hub
from tautscope.bench.drives import SimulatedDrives
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.drives import open_drives

START = np.array([0.01, -0.5, 0.2])


@pytest.mark.parametrize("mode", [8, 7])
def test_motors_follow_in_si_units(
    hub: Hub, bench: Callable[..., SimulatedDrives], mode: int
) -> None:
    """The plant receives the commands in SI units."""
    demands: list[np.ndarray] = []

    def plant(targets: np.ndarray) -> np.ndarray:
        demands.append(targets.copy())
        return targets

    config = drives_config(channel=str(hub.path))
    rig = bench(config, plant, start=START, modes=(mode, mode))
    with open_drives(config) as drives:
        assert {one.mode for one in drives.commissioned} == {Mode(mode)}
        position = drives.start()
        np.testing.assert_allclose(position, START, atol=1e-4)
        assert set(rig.states.values()) == {State.OPERATION_ENABLED}
        for step in range(1, 15):
            command = position + np.array([1e-4, 0.02, -0.01]) * step
            applied = drives.exchange(command)
        for _ in range(5):
            applied = drives.exchange(command)
        np.testing.assert_allclose(applied, command, atol=1e-4)
        np.testing.assert_allclose(demands[-1], command, atol=1e-4)
    assert set(rig.states.values()) == {State.QUICK_STOP_ACTIVE}
    assert all(state is not State.OPERATION_ENABLED for state in rig.states.values())
    assert [one.name for one in drives.commissioned] == [
        "insertion, node 1",
        "rotation, node 2",
        "bending, node 3",
    ]
