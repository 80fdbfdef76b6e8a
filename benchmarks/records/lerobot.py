"""A data set of LeRobot, of an endoscope with known slack, and the time to analyse it.

Three motors as action and, measured, in observation.state, with the pose of the tip beside them:
x follows the first motor, the turn about z the second, y the third.
"""

import contextlib
import io
import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from records.families import slack
from tautscope.cli import main

Floats = NDArray[np.float64]
FPS = 30
MOTORS = ("motor_1", "motor_2", "motor_3")
TIP = ("tip_x", "tip_y", "tip_z", "tip_qx", "tip_qy", "tip_qz", "tip_qw")
WIDTHS = (4.0, 0.2, 3.0)
"""Of tip_x, of the turn [rad], and of tip_y."""
RANGES = (20.0, 1.0, 15.0)
NOISE = 0.005
"""Standard deviation of the tip, as a share of the range."""
OF_FILE = {"v2.1": 1, "v3.0": 40}
"""Episodes in a file."""


def episode(seed: int, frames: int) -> tuple[Floats, Floats]:
    """Motors (n, 3) and the tip's pose (n, 7)."""
    rng = np.random.default_rng([2410, seed])
    targets = rng.uniform(-0.5, 0.5, (max(frames // 40, 2), 3))
    at = np.linspace(0, len(targets) - 1, frames)
    motors = np.stack(
        [r * np.interp(at, np.arange(len(targets)), each) for r, each in zip(RANGES, targets.T)],  # noqa: B905
        axis=1,
    )
    x, turn, y = (
        slack(motor, -w / 2, w / 2) + NOISE * r * rng.normal(size=frames)
        for motor, w, r in zip(motors.T, WIDTHS, RANGES, strict=True)
    )
    zero = np.zeros(frames)
    return motors, np.stack([x, y, zero, zero, zero, np.sin(turn / 2), np.cos(turn / 2)], axis=1)


def write(folder: Path, version: str, episodes: int, frames: int) -> Path:
    """Write a data set."""
    rows = []
    for number in range(episodes):
        motors, tip = episode(number, frames)
        state = np.hstack([motors, tip])
        rows.append(
            pl.DataFrame(
                {
                    "action": motors.astype(np.float32).tolist(),
                    "observation.state": state.astype(np.float32).tolist(),
                    "timestamp": (np.arange(frames) / FPS).astype(np.float32),
                    "frame_index": np.arange(frames),
                    "episode_index": np.full(frames, number),
                    "index": np.arange(frames) + number * frames,
                    "task_index": np.zeros(frames, np.int64),
                }
            )
        )
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    size = OF_FILE[version]
    for number, first in enumerate(range(0, episodes, size)):
        name = f"episode_{number:06d}" if version == "v2.1" else f"file-{number:03d}"
        pl.concat(rows[first : first + size]).write_parquet(data / f"{name}.parquet")
    single = {"dtype": "int64", "shape": [1], "names": None}
    info = {
        "codebase_version": version,
        "total_episodes": episodes,
        "fps": FPS,
        "features": {
            "action": {"dtype": "float32", "shape": [3], "names": {"motors": list(MOTORS)}},
            "observation.state": {"dtype": "float32", "shape": [10], "names": [*MOTORS, *TIP]},
            "observation.images.endoscope": {"dtype": "video", "shape": [480, 640, 3]},
            **dict.fromkeys(("timestamp", "frame_index", "episode_index", "index"), single),
        },
    }
    (folder / "meta").mkdir()
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    return folder


COLUMNS = ("--command", "action.motor_1", "--measured", "observation.state.tip_x")


def measure(episodes: int = 100, seconds: float = 60.0) -> str:
    """Markdown: wall time of ``tautscope analyze`` by version and number of workers."""
    lines = [
        "| version | episodes | workers | wall time [s] | processor time of the workers [s] |",
        "|---|--:|--:|--:|--:|",
    ]
    for version in OF_FILE:
        with tempfile.TemporaryDirectory() as place:
            folder = write(Path(place) / "set", version, episodes, round(seconds * FPS))
            for workers in (1, 2):
                out = ["--workers", str(workers), "--out", f"{place}/{workers}", "--json"]
                begin, used = time.perf_counter(), _used()
                with contextlib.redirect_stdout(io.StringIO()):
                    main(["analyze", str(folder), *COLUMNS, *out])
                taken = f"{time.perf_counter() - begin:.0f} | {_used() - used:.0f}"
                lines.append(f"| {version} | {episodes} | {workers} | {taken} |")
    return "\n".join(lines)


def _used() -> float:
    """Processor time of this process and of its workers that have ended [s]."""
    return sum(os.times()[:4])
