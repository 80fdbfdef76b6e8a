"""Records of known truth: slack, delay, gain, noise; tips without slack, or without relation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from play_model import play
from tautscope.runs.records import Cleaning, Record

Floats = NDArray[np.float64]
N, INTERVAL = 2000, 0.02


@dataclass(frozen=True, eq=False)
class Simulated:
    record: Record
    width: float  # 0 without slack, NaN without a relation
    delay: float
    gain: float


def to_record(time: Floats, command: Floats, tip: Floats) -> Record:
    return Record(command, tip, time, np.arange(len(time)) + 2, Cleaning())


def moves(rng: np.random.Generator, time: Floats) -> Floats:
    """A sine, two sines, or moves at constant speeds between random targets; range about 20."""
    kind = rng.integers(3)
    if kind == 0:
        return 10 * np.sin(2 * np.pi * time / rng.uniform(3, 6))
    if kind == 1:
        first, second = rng.uniform(6, 9), rng.uniform(2, 4)
        return 8 * np.sin(2 * np.pi * time / first) + 3 * np.sin(2 * np.pi * time / second)
    targets = rng.uniform(-10, 10, 24)
    return np.interp(time, np.linspace(0, time[-1], len(targets)), targets)


def simulate(kind: str, seed: int) -> Simulated:
    rng = np.random.default_rng([seed, sum(map(ord, kind))])
    time = np.arange(N) * INTERVAL
    command = moves(rng, time)
    width, delay = rng.uniform(0.08, 0.3) * np.ptp(command), 0.0
    gain = float(rng.choice([-1, 1]) * rng.uniform(0.5, 1.5))
    noise = rng.choice([0.005, 0.01, 0.02, 0.05]) * np.ptp(command) * rng.normal(size=N)
    half = width / 2
    if kind == "play":
        tip = play(command, -half, half)
    elif kind == "asymmetric":
        tip = play(command, -0.3 * width, 0.7 * width)
    elif kind == "rounded":
        tip = np.mean([play(command, -h, h) for h in half * np.linspace(0.2, 1.8, 9)], axis=0)
    elif kind == "delay and play":
        delay = 0.15
        tip = play(np.interp(time - delay, time, command), -half, half)
    elif kind == "drift":
        tip = play(command, -half, half) + np.linspace(0, 5, N)
    elif kind == "delay only":
        width, delay = 0.0, 0.2
        tip = np.interp(time - delay, time, command)
    elif kind == "linear":
        width, tip = 0.0, command
    elif kind == "random walk":
        width, tip = np.nan, np.cumsum(rng.normal(size=N))
        noise *= 0
    elif kind == "two random walks":
        width, (command, tip) = np.nan, np.cumsum(rng.normal(size=(2, N)), axis=1)
        noise *= 0
    elif kind == "white noise":
        width, tip = np.nan, noise
    elif kind == "one way":
        command = np.linspace(0, 20, N)
        width, tip = np.nan, play(command, -2, 2)
    else:
        assert kind == "small strokes"
        width, tip = np.nan, play(command, -15, 15)
    return Simulated(
        to_record(time, command, gain * (tip + noise) + 5), abs(gain) * width, delay, gain
    )
