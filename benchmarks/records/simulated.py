"""Records of known truth: slack, delay, gain, noise; tips without slack, or without relation.

The generators share no code with the package.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from records.families import slack
from tautscope.runs.records import Cleaning, Record

Floats = NDArray[np.float64]
N, INTERVAL = 2000, 0.02
"""Samples, and time between them [s]."""
NOISES = (0.005, 0.01, 0.02, 0.05)
"""Standard deviations of the tip's noise, as shares of the command's range."""
DELAYS = {"delay and play": 0.15, "delay only": 0.2}
"""[s]"""
WITH_SLACK = (
    "play",
    "rounded",
    "asymmetric",
    "delay and play",
    "drift",
    "frozen",
    "wrapped counter",
)
WITHOUT_SLACK = ("delay only", "linear")
UNDETERMINED = ("random walk", "one way", "small strokes", "two random walks", "white noise")


@dataclass(frozen=True, eq=False)
class Simulated:
    """A record and its truth.

    Attributes:
        record: Command, tip and time.
        width: Of the slack [tip's unit]; 0 without slack, NaN if nothing determines it.
        delay: Of the tip [s].
        gain: Tip travel per command travel in contact.
    """

    record: Record
    width: float
    delay: float
    gain: float


def to_record(time: Floats, command: Floats, tip: Floats) -> Record:
    """A record whose first sample is line 2 of its file."""
    return Record(command, tip, time, np.arange(len(time)) + 2, Cleaning())


def moves(rng: np.random.Generator, time: Floats) -> Floats:
    """A sine, two sines, or moves at constant speeds between random targets; range about 20."""
    kind = rng.integers(3)
    if kind == 0:
        return np.asarray(10 * np.sin(2 * np.pi * time / rng.uniform(3, 6)))
    if kind == 1:
        first, second = rng.uniform(6, 9), rng.uniform(2, 4)
        sines = 8 * np.sin(2 * np.pi * time / first) + 3 * np.sin(2 * np.pi * time / second)
        return np.asarray(sines)
    targets = rng.uniform(-10, 10, 24)
    return np.interp(time, np.linspace(0, time[-1], len(targets)), targets)


def simulate(kind: str, seed: int) -> Simulated:
    """A record of a kind, with a width of 8 to 30 % of the command's range if it has slack."""
    rng = np.random.default_rng([seed, sum(map(ord, kind))])
    time = np.arange(N) * INTERVAL
    command = moves(rng, time)
    width, delay = rng.uniform(0.08, 0.3) * np.ptp(command), DELAYS.get(kind, 0.0)
    gain = float(rng.choice([-1, 1]) * rng.uniform(0.5, 1.5))
    share = float(rng.choice(NOISES))
    noise = share * np.ptp(command) * rng.normal(size=N)
    if kind in ("random walk", "two random walks"):
        walks = np.cumsum(rng.normal(size=(kind.count("walks") + 1, N)), axis=1)
        noise, tip = 0 * noise, walks[-1]
        command = walks[0] if len(walks) == 2 else command
    else:
        command = np.linspace(0, 20, N) if kind == "one way" else command
        tip = _tip(kind, np.interp(time - delay, time, command), width)
    measured = gain * (tip + noise) + 5
    if kind == "frozen":  # for 10 to 60 % of the record
        begin = rng.integers(N // 2)
        measured[begin : begin + int(rng.uniform(0.1, 0.6) * N)] = measured[begin]
    elif kind == "wrapped counter":  # of 16 bits, which motor or tip passes once to three times
        is_tip, passes = bool(rng.integers(2)), rng.uniform(1, 3)
        counts = passes * 2**16 / np.ptp(measured if is_tip else command)
        if is_tip:
            measured, gain = _wrapped(counts * measured), counts * gain
        else:
            command, gain, width = _wrapped(counts * command), gain / counts, counts * width
    true = 0.0 if kind in WITHOUT_SLACK else np.nan if kind in UNDETERMINED else abs(gain) * width
    return Simulated(to_record(time, command, measured), true, delay, gain)


def _tip(kind: str, command: Floats, width: float) -> Floats:
    """Tip of gain 1 without noise, for a command that is as late as the tip."""
    half = width / 2
    if kind == "rounded":
        plays = [slack(command, -h, h) for h in half * np.linspace(0.2, 1.8, 9)]
        return np.asarray(np.mean(plays, axis=0))
    if kind in WITHOUT_SLACK:
        return command
    offsets = {
        "asymmetric": (-0.3 * width, 0.7 * width),
        "one way": (-2.0, 2.0),
        "small strokes": (-15.0, 15.0),
    }
    drift = np.linspace(0, 5, N) if kind == "drift" else 0.0
    moved = slack(command, *offsets.get(kind, (-half, half)))
    return (0.0 if kind == "white noise" else 1.0) * moved + drift


def _wrapped(counts: Floats) -> Floats:
    return np.asarray((np.round(counts) + 2**15) % 2**16 - 2**15)
