"""How soon motion ends once the hand's device, or a drive, says nothing any more."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from fault_draws import configured
from guarantee_rows import Figure
from tautscope import HysteresisReduction
from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drives import SimulatedDrives
from tautscope.config import DrivesConfig, load_config
from tautscope.dof import Dof
from tautscope.errors import DriveError, HeartbeatError
from tautscope.hardware.drives import open_drives
from tautscope.loop.safety import Reaction

HAND, DRIVE = 0.05, 0.1
"""Goals [s]."""
BENCH = Path(__file__).parents[1] / "configs" / "bench.toml"
CYCLES = 20
"""Of motion before a drive falls silent."""


def hand_silent(count: int) -> Figure:
    """The hand's device repeats its last value and time; from that time to the command at rest."""
    config = configured(10, "best", ())
    period, chance = config.control.period, np.random.default_rng(10)
    waits = []
    for _ in range(count):
        loop, phase = HysteresisReduction(config), chance.uniform(0, 7.5)
        last, now = float(chance.uniform(0.2, 1.0)), 0.0
        while loop.supervision.reaction.rank < Reaction.HOLD_MOTION.rank:
            now += period
            made_at = min(now, last)
            swing = 15e-3 * np.sin(2 * np.pi * (phase + made_at) / 7.5)
            loop.step([0.025 + swing, 0.0, 0.9], now, made_at)
        waits.append(now - last)
    return _figure(waits, HAND + period, "10")


def heartbeat_lost(count: int) -> Figure:
    """A drive's heartbeat ends; by the wall clock, to the quick stop of all, on the bench's bus."""
    chance = np.random.default_rng(10)
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "can")
        config = load_config(BENCH).replace(**{"drives.channel": path}).drives
        assert config is not None
        with Hub(path):
            waits = [_heartbeat(config, Dof(int(chance.integers(3)))) for _ in range(count)]
    return _figure(waits, DRIVE + config.cycle, "10")


def _heartbeat(config: DrivesConfig, dof: Dof) -> float:
    with (
        LocalBus(config.channel) as bus,
        SimulatedDrives(bus, config) as rig,
        open_drives(config) as drives,
    ):
        command = drives.start()
        for cycle in range(1_000_000):
            if cycle == CYCLES:
                rig.inject("heartbeat", dof, 60.0)
                begin = time.perf_counter()
            command = command + np.array([1e-4, 0.01, 0.01])
            try:
                drives.exchange(command)
            except HeartbeatError:
                return time.perf_counter() - begin
            except DriveError:
                return float("inf")
            time.sleep(config.cycle / 2)
    return float("inf")


def _figure(waits: list[float], goal: float, seeds: str) -> Figure:
    missed = sum(wait > goal + 1e-9 for wait in waits)
    return Figure(f"{max(waits):.3f} s at most", str(len(waits)), missed, seeds)
