"""The first 40 s of loops of which nobody knows where in the slack they start."""

import numpy as np
from tautscope import PlayRig, Sample, axes, run_experiment
from tautscope.config import Sine
from tautscope.loop.references import OperatorMotion

PARTS = ((0.0, 10.0), (10.0, 20.0), (20.0, 40.0))
"""Begin and end of what counts [s]."""
ZEROS = (0.0, 0.3, 1.0)
"""Standard deviations of the sensor's zero, in expected half widths."""
DRAWS = 60
"""Number of seeds."""
PROFILES = ("paper", "best")
EXPECTED = 0.5
"""Expected width of the slack [rad]."""
Job = tuple[str, float, int]
"""Profile or "none", standard deviation of the sensor's zero, and seed."""


class Plant(PlayRig):
    """One degree of freedom, mostly at an end of its slack, which the seed draws as the rest.

    Slack, ideal or rounded, of 0.5 to 1.5 times the expected, gain 0.8 to 1.1, noise of up to 0.01
    rad of the sensor, 20 to 150 ms late, motion of 0.3 to 1.5 rad.
    """

    def __init__(self, job: Job) -> None:
        profile, zero, seed = job
        rng = np.random.default_rng(seed)
        width = EXPECTED * rng.uniform(0.5, 1.5)
        self._start = rng.choice([-1.0, -1.0, 1.0, 1.0, rng.uniform(-1, 1)])
        self.motion = OperatorMotion(
            [Sine(centre=0.0, amplitude=rng.choice([0.3, 0.75, 1.5]))], seed, PARTS[-1][1]
        )
        radii = [(1.0,), (0.5, 0.75, 1.0, 1.25, 1.5)][rng.integers(2)]
        config = axes(1, width_limit=1.0, expected_width=EXPECTED)
        super().__init__(
            config.replace(
                profile="best" if profile == "none" else profile,
                **{"measurement.tip_deviation": rng.uniform(0.001, 0.01)},
            ),
            np.outer([width], radii),
            gains=rng.uniform(0.8, 1.1),
            zeros=zero * rng.normal() * EXPECTED / 2,
            delay=rng.uniform(0.02, 0.15),
            seed=seed,
        )

    def reset(self) -> Sample:
        """At command 0, at the drawn place in the slack."""
        super().reset()
        self._plays = self._start * self._half
        return self.step([0.0])


def simulate(job: Job) -> list[float]:
    """Standard deviation of the tracking error in each part [rad]."""
    plant = Plant(job)
    run = run_experiment(plant, plant.motion, plant.config, job[0] != "none")
    name = plant.config.dof[0].name
    time = run.trace["time"] - run.trace["time"][0]
    error = run.trace[f"true_{name}"] - run.trace[f"reference_{name}"]
    return [float(np.std(error[(time >= begin) & (time < end)])) for begin, end in PARTS]


def table(found: dict[Job, list[float]]) -> str:
    """A Markdown table: a line per zero and profile, median and 10th percentile of reductions."""
    lines = ["| zero of the sensor | profile | 0 to 10 s | 10 to 20 s | 20 to 40 s |"]
    lines.append("|--:|---|--:|--:|--:|")
    for zero in ZEROS:
        seeds = [seed for what, own, seed in found if what == "none" and own == zero]
        free = np.array([found["none", zero, seed] for seed in seeds])
        for profile in PROFILES:
            left = np.array([found[profile, zero, seed] for seed in seeds])
            middle, low = np.percentile(1 - left / free, [50, 10], axis=0)
            parts = [f"{a:.0%}, {b:.0%}" for a, b in zip(middle, low, strict=True)]
            lines.append(f"| {zero:g} | `{profile}` | {' | '.join(parts)} |")
    return "\n".join(lines)
