"""One case of the soak: a run of hours, judged tenth by tenth."""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from common.features import NOISE, update_from_features
from common.small_images import full_size, with_small_images
from faults.rigs import FeatureTwin
from faults.scenarios import DURATION
from numpy.typing import NDArray
from plants.simulated import HALF, PlantRig
from soak.references import PARTS, Motion, make_reference
from tautscope.config import Config, load_config
from tautscope.errors import TautscopeError
from tautscope.loop.reduction import HysteresisEstimate, HysteresisReduction
from tautscope.loop.rig import Frame, Rig
from tautscope.loop.safety import Reaction
from tautscope.twin import Twin
from tautscope.twin.faults import KINDS, Fault, FaultyRig, FeatureFrame, Target

Floats = NDArray[np.float64]
PlantName = Literal["plays", "twin", "faults"]
PLANTS: tuple[PlantName, ...] = ("plays", "twin", "faults")
GAIN = 1.0
"""Gain of the ideal plays."""
SIGMAS = 3.0
"""Half of an interval, in standard deviations."""
SAMPLE_EVERY = 1.0
"""Time between two comparisons of the intervals with the truth [s]."""
LEAST_VISIBLE = 0.5
"""A band is measured if at least this share of it is visible."""
REPEATED, REPEATED_WAVE = 0.5, 30.0
"""Of a motion with rests: amplitude and length of an error of the images that is the same wherever
the bands are the same, as a detection's is [px]."""
FAULT_EVERY = 60.0
"""One fault of the images begins in each such time [s]."""
IMAGE_FAULTS = tuple(
    kind.name
    for kind in KINDS.values()
    if kind.target in {Target.FEATURES, Target.FRAMES} and kind.has_duration
)


@dataclass(frozen=True, slots=True)
class Case:
    """Complete description of a run.

    Attributes:
        plant: Independent ideal plays; the twin with its true features and noise; or the twin
            with a fault of the images in every minute.
        motion: ``sines``; ``hand``, an operator's motion; or ``rests``, the same with rests, and
            with an error of the images that is the same in all images of a rest.
        stroke: Longest stroke over the width of the slack.
        seed: Of noise and motion.
        seconds: Duration [s].
    """

    plant: PlantName
    motion: Motion
    stroke: float
    seed: int
    seconds: float

    @property
    def name(self) -> str:
        """Name without the seed."""
        return f"{self.plant}, {self.motion}, stroke {self.stroke:g}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Figures of a run.

    Attributes:
        errors: (10, 3) RMS of (true tip - reference) in each tenth [m, rad, rad].
        held: Share of the images that arrived while motion was held.
        coverage: By "width" and "gain": per DOF the share of the time from the second tenth on in
            which the 3-sigma interval contains the truth. Only of ideal plays.
    """

    errors: list[list[float]]
    held: float
    coverage: dict[str, list[float]]


def simulate(case: Case) -> Outcome:
    """Simulate a run."""
    config = load_config().replace(**{"twin.seed": case.seed})
    reference = make_reference(config, case.motion, case.stroke, case.seed, case.seconds)
    rig, loop = _make_rig(case, config), HysteresisReduction(config)
    look = _Look(case)
    squares, counts = np.zeros((PARTS, 3)), np.zeros(PARTS)
    images = held = 0
    coverage = _Coverage()
    sample = rig.reset()
    start = sample.time
    due = case.seconds / PARTS
    while (elapsed := sample.time - start) < case.seconds:
        desired = reference(elapsed)
        command = loop.step(desired, time=sample.time)
        assert sample.true_state is not None
        part = min(int(elapsed * PARTS / case.seconds), PARTS - 1)
        squares[part] += (sample.true_state - desired) ** 2
        counts[part] += 1
        if sample.frame is not None:
            look(loop, sample.frame)
            images += 1
            if _is_held(loop):
                held += 1
                loop.engage()
        if case.plant == "plays" and elapsed >= due:
            due += SAMPLE_EVERY
            assert loop.hysteresis is not None
            coverage.add(loop.hysteresis)
        sample = rig.step(command)
    rig.close()
    errors = np.sqrt(squares / counts[:, None])
    return Outcome(errors.tolist(), held / max(images, 1), coverage.shares())


def _make_rig(case: Case, config: Config) -> Rig:
    if case.plant == "plays":
        return PlantRig(config, "independent plays")
    if case.plant == "faults":
        return FaultyRig(FeatureTwin(config), draw_faults(case), case.seed)
    return Twin(with_small_images(config))


def draw_faults(case: Case) -> list[Fault]:
    """One transient fault of the images per `FAULT_EVERY`, of any kind and severity."""
    rng = np.random.default_rng([case.seed, 2])
    return [
        Fault(
            kind := str(rng.choice(IMAGE_FAULTS)),
            begin + float(rng.uniform(0, FAULT_EVERY - DURATION[1])),
            float(rng.uniform(*DURATION)),
            float(rng.uniform(*KINDS[kind].severity)),
        )
        for begin in np.arange(0, case.seconds, FAULT_EVERY).tolist()
    ]


class _Look:
    """The image update: features with noise, and with rests an error that repeats."""

    def __init__(self, case: Case) -> None:
        self._noise = np.random.default_rng([case.seed, 1])
        self._repeats = case.motion == "rests"

    def __call__(self, loop: HysteresisReduction, frame: Frame) -> None:
        if isinstance(frame, FeatureFrame):
            repeated = replace(frame, features=frame.features + self._repeated(frame.features))
            with suppress(TautscopeError):  # the supervision reports it as well
                update_from_features(loop, repeated)
            return
        assert frame.true_features is not None and frame.true_visible is not None
        is_visible = frame.true_visible >= LEAST_VISIBLE
        features = full_size(frame.true_features)
        features += self._repeated(features) + NOISE * self._noise.standard_normal(4)
        features[~np.repeat(is_visible, 2)] = np.nan
        loop.on_features(features if is_visible.any() else None, frame.captured_at)

    def _repeated(self, features: Floats) -> Floats:
        if not self._repeats:
            return np.zeros(4)
        return np.asarray(REPEATED * np.sin(features / REPEATED_WAVE + np.arange(4)))


def _is_held(loop: HysteresisReduction) -> bool:
    return loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank


class _Coverage:
    """Counts how often the intervals of the estimate contain the truth of the ideal plays."""

    def __init__(self) -> None:
        self._count = 0
        self._inside: dict[str, Floats] = {}

    def add(self, estimate: HysteresisEstimate) -> None:
        self._count += 1
        for name, value, truth in (("width", "half_width", HALF), ("gain", "gain", GAIN)):
            off = np.abs(getattr(estimate, value) - truth)
            is_inside = off <= SIGMAS * getattr(estimate, f"{name}_std")
            self._inside[name] = self._inside.get(name, np.zeros(3)) + is_inside

    def shares(self) -> dict[str, list[float]]:
        return {name: (inside / self._count).tolist() for name, inside in self._inside.items()}
