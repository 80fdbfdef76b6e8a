"""Synthetic records of command and tip: families of hysteresis, drawn with a seed.

The generators share no code with the package. Command and tip have one unit; the command's range is
about 1.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SAMPLES = 3000
INTERVAL = 0.02
"""Time between samples [s]."""
NOISE = 2e-3
"""Standard deviation of the measured tip, as a share of the command's range."""
STOPS = 8
"""Parallel plays of a rounded loop."""
DOMAIN = 2400
"""First part of the seed of every record: no other benchmark draws from it."""

Family = Callable[[Floats, np.random.Generator], Floats]
"""Tip (n,) without noise for a command (n,)."""


def record(family: str, seed: int) -> tuple[Floats, Floats]:
    """Command and measured tip, (n,) each; the command is a sine for a third of the seeds."""
    rng = np.random.default_rng([DOMAIN, list(FAMILIES).index(family), seed])
    command = sines(rng) if seed % 3 == 0 else moves(rng)
    tip = FAMILIES[family](command, rng)
    return command, tip + rng.normal(0, NOISE, SAMPLES)


def sines(rng: np.random.Generator) -> Floats:
    """Sum of two sines of different periods."""
    time = np.arange(SAMPLES) * INTERVAL
    periods, phases = rng.uniform((8, 3), (12, 5)), rng.uniform(0, 2 * np.pi, 2)
    share = rng.uniform(0, 0.3)
    first, second = np.sin(2 * np.pi * time[:, None] / periods + phases).T
    return 0.5 * ((1 - share) * first + share * second)


def moves(rng: np.random.Generator) -> Floats:
    """Minimum-jerk moves between targets drawn from [-0.5, 0.5], with rests between them."""
    parts, last, count = [], 0.0, 0
    while count < SAMPLES:
        target = rng.uniform(-0.5, 0.5)
        steps = int(max(rng.uniform(1, 4), 4 * abs(target - last)) / INTERVAL)
        x = np.linspace(0, 1, steps)
        parts.append(last + (target - last) * x**3 * (10 - 15 * x + 6 * x**2))
        parts.append(np.full(int(rng.uniform(0, 1) / INTERVAL), target))
        count += len(parts[-1]) + len(parts[-2])
        last = target
    return np.concatenate(parts)[:SAMPLES]


def slack(command: Floats, minus: Floats | float, plus: Floats | float) -> Floats:
    """Tip of a backlash with contact offsets that may change over the samples."""
    lower, upper = (command - np.broadcast_to(each, command.shape) for each in (plus, minus))
    tip, now = np.empty_like(command), 0.0
    for k in range(len(command)):
        now = tip[k] = min(max(now, lower[k]), upper[k])
    return tip


def scaled(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash of 5 to 40 % of the range, and a gain from 0.5 to 1.2."""
    half = rng.uniform(0.025, 0.2)
    return rng.uniform(0.5, 1.2) * slack(command, -half, half)


def mid_stroke(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash, and a stretch in mid-stroke in which the tip rests whatever its direction."""
    half = rng.uniform(0.02, 0.1)
    inner = slack(command, -half, half) - rng.uniform(-0.15, 0.15)
    dead = rng.uniform(0.05, 0.15)
    return np.asarray(np.sign(inner) * np.maximum(np.abs(inner) - dead, 0))


def coupled(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash, and 10 to 40 % of the motion of another axis, of which the record shows nothing."""
    half = rng.uniform(0.025, 0.15)
    return slack(command, -half, half) + rng.uniform(0.1, 0.4) * moves(rng)


def drifting(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash, and an offset that drifts by 10 to 30 % of the range, in part at random."""
    half = rng.uniform(0.025, 0.15)
    ramp = np.linspace(0, rng.uniform(0.1, 0.3) * rng.choice([-1, 1]), SAMPLES)
    walk = np.cumsum(rng.normal(0, 0.1 / np.sqrt(SAMPLES), SAMPLES))
    return slack(command, -half, half) + ramp + walk


def rounded(command: Floats, rng: np.random.Generator) -> Floats:
    """Mean of parallel backlashes of 0 to 60 % of the range: the loop has no corners."""
    halves = rng.uniform(0.0, 0.3, STOPS)
    shares = rng.dirichlet(np.ones(STOPS))
    return np.asarray(sum(w * slack(command, -h, h) for w, h in zip(shares, halves, strict=True)))


def asymmetric(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash whose upper contact shifts with the position, and whose branches differ in slope."""
    half = rng.uniform(0.03, 0.15)
    slope = rng.uniform(0.1, 0.4)
    plus = half * (1 + rng.uniform(0.0, 0.8)) + slope * (command + 0.5) * half
    return slack(command, -half * rng.uniform(0.2, 1.0), plus)


def changing(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash whose width changes by half, up and down, once or twice; then jumps."""
    half = rng.uniform(0.03, 0.15)
    at = np.arange(SAMPLES) / SAMPLES
    factor = 1 + 0.5 * np.sin(2 * np.pi * rng.uniform(1, 2) * at)
    factor[int(rng.uniform(0.6, 0.8) * SAMPLES) :] *= rng.choice([0.5, 1.5])
    return slack(command, -half * factor, half * factor)


def bent(command: Floats, rng: np.random.Generator) -> Floats:
    """Backlash, and a gain that falls or rises by half from one end to the other."""
    half = rng.uniform(0.025, 0.15)
    inner = slack(command, -half, half)
    return inner + rng.uniform(0.2, 0.5) * rng.choice([-1, 1]) * inner * np.abs(inner)


FAMILIES: dict[str, Family] = {
    "gain 0.5 to 1.2": scaled,
    "slack in mid-stroke": mid_stroke,
    "coupled to an unseen axis": coupled,
    "drift": drifting,
    "rounded": rounded,
    "asymmetric": asymmetric,
    "changing width": changing,
    "curved": bent,
}
