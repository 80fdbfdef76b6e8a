"""Goals of the timeouts: how soon motion ends when the input device or a drive falls silent."""

import tempfile
import time
from pathlib import Path

import numpy as np
from common.paths import ROOT
from faults.scenarios import build_config
from guarantees.goals import Measurement
from tautscope import HysteresisReduction
from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drives import SimulatedDrives
from tautscope.config import DrivesConfig, load_config
from tautscope.dof import Dof
from tautscope.errors import DriveError, HeartbeatError
from tautscope.hardware.drives import open_drives
from tautscope.loop.safety import Reaction

INPUT_LIMIT, DRIVE_LIMIT = 0.05, 0.1
"""Goals [s]."""
BENCH = ROOT / "configs" / "bench.toml"
CYCLES = 20
"""Cycles of motion before a drive falls silent."""


def input_silent(count: int) -> Measurement:
    """Measure G10c: from the last new sample of the input device to the command at rest.

    The device repeats its last value and time stamp.
    """
    config = build_config(10, "best", ())
    period, rng = config.control.period, np.random.default_rng(10)
    waits = []
    for _ in range(count):
        loop, phase = HysteresisReduction(config), rng.uniform(0, 7.5)
        last, now = float(rng.uniform(0.2, 1.0)), 0.0
        while loop.supervision.reaction.rank < Reaction.HOLD_MOTION.rank:
            now += period
            made_at = min(now, last)
            motion = 15e-3 * np.sin(2 * np.pi * (phase + made_at) / 7.5)
            loop.step([0.025 + motion, 0.0, 0.9], now, made_at)
        waits.append(now - last)
    return Measurement.of_times(waits, INPUT_LIMIT + period, "10")


def heartbeat_lost(count: int) -> Measurement:
    """Measure G10d: from the end of a drive's heartbeat to the quick stop of all drives.

    The bus is that of the bench; times are of the wall clock.
    """
    rng = np.random.default_rng(10)
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "can")
        config = load_config(BENCH).replace(**{"drives.channel": path}).drives
        assert config is not None
        with Hub(path):
            waits = [_heartbeat(config, Dof(int(rng.integers(3)))) for _ in range(count)]
    return Measurement.of_times(waits, DRIVE_LIMIT + config.cycle, "10")


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
