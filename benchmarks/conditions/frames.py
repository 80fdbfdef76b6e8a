"""Frames of the condition benchmark: rendering at random poses, and evaluation of the detector."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from conditions.backgrounds import KINDS, write_backgrounds
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector
from tautscope.twin.camera import FRAMES_PER_BACKGROUND, RenderedImage, TwinCamera

Floats = NDArray[np.float64]

WORKSPACE = np.array([[10e-3, -2.0, -0.2], [40e-3, 2.0, 1.8]])
"""Lowest and highest insertion [m], rotation [rad], bending [rad]."""
STATE_ERROR = np.array([2e-3, 0.1, 0.1])
"""Standard deviation of the predicted state [m, rad, rad]."""
MAX_ERROR = 3.0
"""Distance from the truth above which a feature is wrong [px]."""
MIN_VISIBLE = 0.5
"""Visible share of each band above which the markers should be found."""
TOUCHING_GAP = 7
"""Gap below which bands count as touching [px]."""


@dataclass(frozen=True)
class Condition:
    """Image condition.

    Attributes:
        disturb: Disturbances that are on.
        others: Number of further disturbances, chosen at random from `TRAPS` for each seed.
        poses: "any"; "outside": a band partly outside the image; "touching": a small gap.
    """

    disturb: tuple[str, ...] = ()
    others: int = 0
    poses: str = "any"


TRAPS = ("highlights", "debris", "smoke", "inset", "stool", "text", "exposure", "white_balance")

CONDITIONS = {
    "clean": Condition(),
    "highlights": Condition(("highlights",)),
    "debris": Condition(("debris",)),
    "smoke": Condition(("smoke",)),
    "inset": Condition(("inset",)),
    "stool": Condition(("stool",)),
    "text": Condition(("text",)),
    "exposure": Condition(("exposure",)),
    "white balance": Condition(("white_balance",)),
    "motion blur": Condition(("motion_blur",)),
    "outside the image": Condition(poses="outside"),
    "behind the field stop": Condition(("partial",)),
    "touching": Condition(poses="touching"),
    "touching, defocused": Condition(("touching",), poses="touching"),
    "highlights + debris + smoke + inset": Condition(("highlights", "debris", "smoke", "inset")),
    "three at random": Condition(others=3),
    "no instrument": Condition(("no_instrument",)),
    "no instrument, three at random": Condition(("no_instrument",), others=3),
}

MODES = ("with prediction", "without")


@dataclass(frozen=True)
class Job:
    """Number of frames of one condition, seed and kind of background, for tuning or for figures."""

    condition: str
    seed: int
    background: str
    frames: int
    is_tuning: bool = False


@dataclass(frozen=True)
class Evaluation:
    """Evaluation of one frame.

    Attributes:
        condition: Key of `CONDITIONS`.
        seed: ``twin.seed``.
        background: Kind of background.
        sequence: Sequence number of the frame.
        state: True state (3,) [m, rad, rad].
        visible: Smaller visible share of the two bands.
        valid: Whether the detection is valid, per mode.
        error: Error of each marker [px], per mode; infinite for a marker that is not in the image,
            NaN for one that was not reported.
        reasons: Why the detection is not valid, per mode.
    """

    condition: str
    seed: int
    background: str
    sequence: int
    state: Floats
    visible: float
    valid: tuple[bool, ...]
    error: tuple[Floats, ...]
    reasons: tuple[str, ...] = ()

    def is_wrong(self, mode: int) -> bool:
        """Return whether a valid detection has a wrong marker."""
        return self.valid[mode] and bool(np.nanmax(self.error[mode], initial=0) > MAX_ERROR)


def centreline(config: Config, state: Floats) -> tuple[Floats, Floats]:
    """Return points and tangents (n, 3) of shaft, arc and straight tip, in the guide frame."""
    insertion, rotation, bending = state
    instrument = config.instrument
    angle = bending * np.linspace(0, 1, 21)
    chord = instrument.bending_length * np.linspace(0, 1, 21) * np.sinc(angle / 2 / np.pi)
    across, along = np.sin(angle / 2) * chord, insertion + np.cos(angle / 2) * chord
    heading = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    points = np.stack([across, 0 * across, along], axis=1)
    points = np.vstack([np.zeros(3), points, points[-1] + instrument.tip_length * heading[-1]])
    heading = np.vstack([[0.0, 0.0, 1.0], heading, heading[-1]])
    cos, sin = np.cos(rotation), np.sin(rotation)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    return points @ turn, heading @ turn


@lru_cache(maxsize=4)
def camera_for(
    disturb: tuple[str, ...], seed: int, background: str, is_tuning: bool
) -> tuple[Config, TwinCamera]:
    folder = write_backgrounds(background, is_tuning)
    config = Config().replace(
        **{
            "twin.seed": seed,
            "twin.disturb": disturb,
            "twin.background": None if folder is None else folder.name,
        }
    )
    return config, TwinCamera(config)


def conditions_camera(job: Job) -> tuple[Config, TwinCamera, TwinCamera, np.random.Generator]:
    """Return configuration, cameras with and without the disturbances, and random numbers."""
    condition = CONDITIONS[job.condition]
    kind = KINDS.index(job.background)
    rng = np.random.default_rng([job.seed, kind, list(CONDITIONS).index(job.condition)])
    others = rng.choice(TRAPS, condition.others, replace=False).tolist()
    scene = (job.seed, job.background, job.is_tuning)
    config, camera = camera_for((*condition.disturb, *others), *scene)
    return config, camera, camera_for((), *scene)[1], rng


def render(job: Job) -> Iterator[tuple[Config, Floats, int, RenderedImage]]:
    """Yield configuration, state, sequence number and image of each frame of a job."""
    condition = CONDITIONS[job.condition]
    config, camera, plain, rng = conditions_camera(job)
    for _ in range(job.frames):
        # Far apart, so that every frame has another background and phase of a disturbance.
        sequence = int(rng.integers(0, 400 * FRAMES_PER_BACKGROUND))
        state = draw_state(config, plain, condition.poses, rng)
        yield config, state, sequence, camera.draw(*centreline(config, state), sequence)


def draw_state(config: Config, plain: TwinCamera, poses: str, rng: np.random.Generator) -> Floats:
    """Draw states of the workspace until one meets the condition."""
    model = build_feature_model(config)
    for _ in range(100_000):
        state = rng.uniform(*WORKSPACE)
        if poses == "any":
            return state
        # The model saves rendering of states that cannot meet the condition.
        prediction = model.predict(state)
        if prediction is None or not may_meet(config, poses, prediction[0]):
            continue
        image = plain.draw(*centreline(config, state), 0)
        share = image.true_visible.min()
        if poses == "outside" and MIN_VISIBLE <= share < 0.97:
            return state
        if poses == "touching" and share > 0.3 and bands_touch(image):
            return state
    raise RuntimeError(f"no state of the workspace has the poses {poses!r}")


def may_meet(config: Config, poses: str, features: Floats) -> bool:
    """Return whether the bands are within 40 px, or one is within 45 px of the border."""
    u, v = features.reshape(2, 2).T
    if poses == "touching":
        return bool(np.hypot(u[1] - u[0], v[1] - v[0]) < 40)
    camera = config.camera
    room = np.minimum.reduce([u, v, camera.width - 1 - u, camera.height - 1 - v])
    return bool(-45 < room.min() < 45)


def bands_touch(image: RenderedImage) -> bool:
    """Return whether the green regions of the bands are less than `TOUCHING_GAP` apart."""
    a, b = image.true_features.reshape(2, 2)
    left, top = np.maximum(0, np.rint((a + b) / 2).astype(int) - 60)
    blue, green, red = np.moveaxis(
        image.image[top : top + 120, left : left + 120].astype(np.int16), 2, 0
    )
    mask = ((green > 1.35 * red) & (green > 1.35 * blue) & (green > 40)).astype(np.uint8)
    separate = cv2.connectedComponentsWithStats(mask)[2][1:, cv2.CC_STAT_AREA]
    closed = cv2.morphologyEx(
        mask, cv2.MORPH_CLOSE, np.ones((TOUCHING_GAP, TOUCHING_GAP), np.uint8)
    )
    joined = cv2.connectedComponentsWithStats(closed)[2][1:, cv2.CC_STAT_AREA]
    return bool((separate > 40).sum() >= 2 and (joined > 40).sum() == 1)


def evaluate(job: Job) -> list[Evaluation]:
    """Render the frames of a job and evaluate the detector on them."""
    cv2.setNumThreads(1)
    evaluations: list[Evaluation] = []
    rng = np.random.default_rng([job.seed, KINDS.index(job.background), 1])
    detector = MarkerDetector(Config())
    model = build_feature_model(Config())
    for _, state, sequence, image in render(job):
        predicted_state = state + rng.normal(0, STATE_ERROR)
        prediction = model.predict(predicted_state)
        found = [
            detector.detect(
                image.image,
                None if prediction is None else prediction[0],
                StatePrediction(predicted_state, STATE_ERROR),
            ),
            detector.detect(image.image),
        ]
        truth = np.where(np.isfinite(image.true_features), image.true_features, np.inf)
        errors = [np.hypot(*(each.features - truth).reshape(2, 2).T) for each in found]
        evaluations.append(
            Evaluation(
                job.condition,
                job.seed,
                job.background,
                sequence,
                state,
                float(image.true_visible.min()),
                tuple(each.valid for each in found),
                tuple(errors),
                tuple(str(each.reason) for each in found),
            )
        )
    return evaluations
