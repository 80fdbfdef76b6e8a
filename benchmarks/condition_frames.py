"""Frames of the condition benchmark: what is drawn, at which poses, and how each is judged."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import Expectation
from tautscope.loop.vision import MarkerDetector
from tautscope.twin.camera import FRAMES_PER_BACKGROUND, RenderedImage, TwinCamera

Floats = NDArray[np.float64]

DATA = Path(
    os.environ.get("TAUTSCOPE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)

WORKSPACE = np.array([[10e-3, -2.0, -0.2], [40e-3, 2.0, 1.8]])
"""Lowest and highest insertion [m], rotation [rad], bending [rad]."""
STATE_ERROR = np.array([2e-3, 0.1, 0.1])
"""Standard deviation of the loop's state before the frame [m, rad, rad]."""
WRONG = 3.0
"""A feature farther from the truth is wrong [px]."""
HALF = 0.5
TOUCH = 7
"""Bands with less than this between them count as touching [px]."""


@dataclass(frozen=True)
class Condition:
    """What is drawn.

    Attributes:
        disturb: Switched on together.
        others: So many more are drawn at random from `TRAPS`, anew for each seed.
        poses: "any"; "outside": a band partly outside the picture; "touching": bands with little
            between them.
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
    "outside the picture": Condition(poses="outside"),
    "behind the field stop": Condition(("partial",)),
    "touching": Condition(poses="touching"),
    "touching, defocused": Condition(("touching",), poses="touching"),
    "highlights, debris, smoke, inset": Condition(("highlights", "debris", "smoke", "inset")),
    "three at random": Condition(others=3),
    "no instrument": Condition(("no_instrument",)),
    "no instrument, three at random": Condition(("no_instrument",), others=3),
}

MODES = ("with prediction", "without")


@dataclass(frozen=True)
class Job:
    """Some frames of one condition, one seed, one kind of background."""

    condition: str
    seed: int
    real: bool
    frames: int


@dataclass(frozen=True)
class Look:
    """One frame as it was judged.

    Attributes:
        condition: Key of `CONDITIONS`.
        seed: ``twin.seed``.
        real: Whether a real colon frame is the background.
        sequence: Number of the picture.
        state: (3,) [m, rad, rad].
        visible: Smaller of the two bands' visible shares.
        valid: Per mode.
        error: Per mode, of each marker [px]; infinite for a marker that is not there, NaN for one
            that was not reported.
        reasons: Per mode, why it is not valid.
    """

    condition: str
    seed: int
    real: bool
    sequence: int
    state: Floats
    visible: float
    valid: tuple[bool, ...]
    error: tuple[Floats, ...]
    reasons: tuple[str, ...] = ()

    def wrong(self, mode: int) -> bool:
        """Trusted, and somewhere else."""
        return self.valid[mode] and bool(np.nanmax(self.error[mode], initial=0) > WRONG)


def centreline(config: Config, state: Floats) -> tuple[Floats, Floats]:
    """Points and tangents (n, 3) of a straight shaft, an arc and a straight tip, guide's frame."""
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
def camera_for(disturb: tuple[str, ...], seed: int, real: bool) -> tuple[Config, TwinCamera]:
    config = Config().replace(
        **{
            "twin.seed": seed,
            "twin.disturb": disturb,
            "twin.background": str(DATA / "colon_frames") if real else None,
        }
    )
    return config, TwinCamera(config)


def shots(job: Job) -> Iterator[tuple[Config, Floats, int, RenderedImage]]:
    """State, sequence number and picture of each frame of a job."""
    condition = CONDITIONS[job.condition]
    rng = np.random.default_rng([job.seed, job.real, list(CONDITIONS).index(job.condition)])
    others = rng.choice(TRAPS, condition.others, replace=False).tolist()
    config, camera = camera_for((*condition.disturb, *others), job.seed, job.real)
    plain = camera_for((), job.seed, job.real)[1]
    for _ in range(job.frames):
        # Far apart: every frame has its own background, and a disturbance its own moment.
        sequence = int(rng.integers(0, 400 * FRAMES_PER_BACKGROUND))
        state = suitable(config, plain, condition.poses, rng)
        yield config, state, sequence, camera.draw(*centreline(config, state), sequence)


def suitable(config: Config, plain: TwinCamera, poses: str, rng: np.random.Generator) -> Floats:
    """A state of the workspace, drawn until it is what the condition asks for."""
    model = build_feature_model(config)
    for _ in range(100_000):
        state = rng.uniform(*WORKSPACE)
        if poses == "any":
            return state
        # The model only saves drawing what will not do.
        guess = model.predict(state)
        if guess is None or not promising(config, poses, guess[0]):
            continue
        picture = plain.draw(*centreline(config, state), 0)
        share = picture.true_visible.min()
        if poses == "outside" and HALF <= share < 0.97:
            return state
        if poses == "touching" and share > 0.3 and bands_touch(picture):
            return state
    raise RuntimeError(f"no pose is {poses}")


def promising(config: Config, poses: str, features: Floats) -> bool:
    """Whether a band's centre is within 45 px of the picture's border; or the bands' centres are
    within 40 px of each other.
    """  # noqa: D205
    u, v = features.reshape(2, 2).T
    if poses == "touching":
        return bool(np.hypot(u[1] - u[0], v[1] - v[0]) < 40)
    camera = config.camera
    room = np.minimum.reduce([u, v, camera.width - 1 - u, camera.height - 1 - v])
    return bool(-45 < room.min() < 45)


def bands_touch(picture: RenderedImage) -> bool:
    """Whether less than `TOUCH` lies between the green of one band and that of the other."""
    a, b = picture.true_features.reshape(2, 2)
    left, top = np.maximum(0, np.rint((a + b) / 2).astype(int) - 60)
    blue, green, red = np.moveaxis(
        picture.image[top : top + 120, left : left + 120].astype(np.int16), 2, 0
    )
    mask = ((green > 1.35 * red) & (green > 1.35 * blue) & (green > 40)).astype(np.uint8)
    apart = cv2.connectedComponentsWithStats(mask)[2][1:, cv2.CC_STAT_AREA]
    joined = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((TOUCH, TOUCH), np.uint8))
    together = cv2.connectedComponentsWithStats(joined)[2][1:, cv2.CC_STAT_AREA]
    return bool((apart > 40).sum() >= 2 and (together > 40).sum() == 1)


def judge(job: Job) -> list[Look]:
    """Draw and look at the frames of a job."""
    cv2.setNumThreads(1)
    looks: list[Look] = []
    rng = np.random.default_rng([job.seed, job.real, 1])
    detector = MarkerDetector(Config())
    model = build_feature_model(Config())
    for _, state, sequence, picture in shots(job):
        believed = state + rng.normal(0, STATE_ERROR)
        prediction = model.predict(believed)
        found = [
            detector.detect(
                picture.image,
                None if prediction is None else prediction[0],
                Expectation(believed, STATE_ERROR),
            ),
            detector.detect(picture.image),
        ]
        truth = np.where(np.isfinite(picture.true_features), picture.true_features, np.inf)
        errors = [np.hypot(*(each.features - truth).reshape(2, 2).T) for each in found]
        looks.append(
            Look(
                job.condition,
                job.seed,
                job.real,
                sequence,
                state,
                float(picture.true_visible.min()),
                tuple(each.valid for each in found),
                tuple(errors),
                tuple(str(each.reason) for each in found),
            )
        )
    return looks
