"""Jog one motor slowly out and back, while you watch the instrument.

``uv run python examples/jog.py rig.toml insertion 0.001`` moves 1 mm out and back [m, rad] in 4 s.
THE MOTOR MOVES; have the emergency stop within reach. Without arguments, simulated drives.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tautscope import load_config
from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drives import SimulatedDrives
from tautscope.config import AxisConfig, DrivesConfig
from tautscope.dof import Dof
from tautscope.hardware.drives import open_drives
from tautscope.hardware.signals import exit_on_signals

DURATION = 4.0
"""Duration of the motion out and back [s]."""
LARGEST = (2e-3, 0.2, 0.2)
"""Largest distance of a first test [m, rad, rad]."""


def jog(config: DrivesConfig, dof: Dof, distance: float) -> None:
    """Move along a raised cosine by `distance` [m or rad] and back."""
    steps = round(DURATION / config.cycle)
    with exit_on_signals(), open_drives(config) as drives:
        begin = drives.start()
        applied, due = [begin], time.monotonic()
        for step in range(steps + 1):
            command = begin.copy()
            command[dof] += distance * (1 - np.cos(2 * np.pi * step / steps)) / 2
            applied.append(drives.exchange(command))
            due += config.cycle
            time.sleep(max(0.0, due - time.monotonic()))
    moved = np.array(applied)[:, dof] - begin[dof]
    largest, end = moved[np.abs(moved).argmax()], moved[-1]
    scale, unit = dof.display_scale, dof.display_unit
    print(f"{dof.label}: moved {scale * largest:.4f} {unit}, ended at {scale * end:.4f} {unit}")


def simulated(folder: str) -> DrivesConfig:
    """Three equal axes, with long timeouts for a busy computer."""
    axes = {
        dof.label: AxisConfig(
            node=dof + 1,
            counts_per_unit=1e6,
            sign=1,
            travel=(-1.0, 1.0),
            speed_limit=1.0,
            following_error=0.1,
            following_window=0.05,
        )
        for dof in Dof
    }
    return DrivesConfig(
        **axes,
        interface="tautscope",
        channel=str(Path(folder) / "can"),
        cycle=0.02,
        reply_timeout=0.019,
        heartbeat_period=0.1,
        heartbeat_timeout=3.0,
        request_timeout=5.0,
    )


def main() -> None:
    if len(sys.argv) == 1:
        with tempfile.TemporaryDirectory() as folder:
            config = simulated(folder)
            with (
                Hub(config.channel),
                LocalBus(config.channel) as bus,
                SimulatedDrives(bus, config),
            ):
                jog(config, Dof.INSERTION, 1e-3)
        return
    file, label, text = sys.argv[1:]
    drives, dof, distance = load_config(file).drives, Dof[label.upper()], float(text)
    if drives is None or not abs(distance) <= LARGEST[dof]:
        raise SystemExit(f"[drives] is missing, or the distance exceeds {LARGEST[dof]:g} m or rad")
    input(
        f"The {label} motor will move by {distance:g} and back. Enter to start, Ctrl-C to abort: "
    )
    jog(drives, dof, distance)


if __name__ == "__main__":
    main()
