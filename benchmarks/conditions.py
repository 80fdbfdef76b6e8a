"""How well the markers are found under the conditions of an operation, with exact truth.

Pictures of the twin: poses drawn from the workspace, real colon frames and procedural mucosa, one
condition at a time. Each is looked at twice, with a prediction as the loop makes it and without.
Definitions in `DEFINITIONS`; `--write` makes docs/conditions.md from them and the table.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.progress import progress_bar
from tautscope.reduction import build_feature_model
from tautscope.twin.camera import FRAMES_PER_BACKGROUND, Picture, TwinCamera
from tautscope.vision import MarkerDetector

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("TAUTSCOPE_DATA", ROOT.parent / "shared" / "data"))

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
        poses: Which poses count: any, those with a band partly outside the picture, or those with
            bands that touch in it.
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


@dataclass
class Look:
    """One frame as it was judged.

    Attributes:
        visible: Smaller of the two bands' visible shares.
        valid: Per mode.
        error: Per mode, of each marker [px]; infinite for a marker that is not there, NaN for one
            that was not reported.
    """

    condition: str
    seed: int
    real: bool
    sequence: int
    state: Floats
    visible: float
    valid: tuple[bool, ...]
    error: tuple[Floats, ...]
    reasons: tuple[str, ...] = field(default=())

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


def shots(job: Job) -> Iterator[tuple[Config, Floats, int, Picture]]:
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


def bands_touch(picture: Picture) -> bool:
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
        prediction = model.predict(state + rng.normal(0, STATE_ERROR))
        found = [
            detector.detect(picture.image, None if prediction is None else prediction[0]),
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


def jobs(frames: int, seeds: Sequence[int]) -> list[Job]:
    """So many frames of each condition, over all seeds and both kinds of background."""
    each = max(1, round(frames / (2 * len(seeds))))
    return [
        Job(name, seed, real, each)
        for name in CONDITIONS
        for seed in seeds
        for real in (True, False)
    ]


def run(work: Sequence[Job], workers: int, tell: Callable[[float], None]) -> list[Look]:
    """Judge all jobs, in parallel."""
    looks: list[Look] = []
    with ProcessPoolExecutor(workers) as pool:
        for done, part in enumerate(pool.map(judge, work), 1):
            looks += part
            tell(done / len(work))
    return looks


@dataclass(frozen=True)
class Figure:
    """One number about some frames: its name, unit, goal, and which side of it is good."""

    what: str
    unit: str
    goal: float
    sense: str
    of: Callable[[Sequence[Look], int], float | None]

    def holds(self, value: float) -> bool:
        """Whether the value reaches the goal."""
        return value <= self.goal if self.sense == "max" else value >= self.goal


def valid_share(looks: Sequence[Look], mode: int) -> float | None:
    """Of the frames with at least half of each band visible, per cent; None where there is none."""
    shown = [look.valid[mode] for look in looks if look.visible >= HALF]
    return 100 * float(np.mean(shown)) if shown else None


def wrong_accepted(looks: Sequence[Look], mode: int) -> float | None:
    """Of all frames, per cent."""
    return 100 * float(np.mean([look.wrong(mode) for look in looks]))


def marker_error(looks: Sequence[Look], mode: int) -> float | None:
    """RMS over the markers of all valid frames [px], wrong ones included."""
    errors = [look.error[mode] for look in looks if look.valid[mode]]
    values = np.concatenate(errors) if errors else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def figures(profile: str) -> tuple[Figure, ...]:
    """The figures of one condition with their goals."""
    nobody = profile.startswith("no instrument")
    return (
        Figure("valid", "%", 99.0, "min", valid_share),
        Figure("wrong accepted", "%", 0.0 if nobody else 0.1, "max", wrong_accepted),
        Figure("marker error", "px", 0.15 if profile == "clean" else 0.5, "max", marker_error),
    )


def to_rows(looks: Sequence[Look]) -> list[dict[str, Any]]:
    """One row per condition, mode and figure.

    `median` and `worst` are over seeds, `pooled` over all frames; `holds` asks it of the pooled.
    """
    rows: list[dict[str, Any]] = []
    for profile in (*CONDITIONS, "all"):
        mine = [look for look in looks if profile in (look.condition, "all")]
        seeds = sorted({look.seed for look in mine})
        if not mine:
            continue
        for mode, label in enumerate(MODES):
            for figure in figures(profile):
                pooled = figure.of(mine, mode)
                if pooled is None:
                    continue
                parts = [figure.of([k for k in mine if k.seed == seed], mode) for seed in seeds]
                values = [part for part in parts if part is not None]
                worst = max(values) if figure.sense == "max" else min(values)
                rows.append(
                    {
                        "what": f"{figure.what}, {label}",
                        "dof": None,
                        "profile": profile,
                        "unit": figure.unit,
                        "median": float(np.median(values)),
                        "worst": worst,
                        "pooled": pooled,
                        "n": len(mine),
                        "n_visible": sum(look.visible >= HALF for look in mine),
                        "seeds": len(seeds),
                        "goal": figure.goal,
                        "sense": figure.sense,
                        "holds": figure.holds(pooled),
                    }
                )
    return rows


DEFINITIONS = f"""\
Each frame is a picture of the twin at a pose of its own, drawn uniformly: insertion
{WORKSPACE[0, 0] * 1e3:.0f} to {WORKSPACE[1, 0] * 1e3:.0f} mm, rotation {WORKSPACE[0, 1]:g} to \
{WORKSPACE[1, 1]:g} rad, bending {WORKSPACE[0, 2]:g} to {WORKSPACE[1, 2]:g} rad, constant curvature.
Half of the frames have real colon frames behind the instrument, half procedural mucosa. The
sequence number, which decides the moment of a disturbance and the background, is drawn at random.

- **n**: frames; **visible**: those with at least half of each band visible.
- **valid**: share of the visible frames in which the detection says it can be trusted.
- **wrong accepted**: share of all frames in which it says so and a marker is more than
  {WRONG:g} px from the truth, or there is no such marker in the picture.
- **error**: RMS distance of measured and true features over all valid frames, wrong ones
  included. Markers that are not there have no distance and count as wrong accepted only.
- **with prediction**: the features, by `FeatureModel`, of the true state plus a normal error of
  standard deviation {STATE_ERROR[0] * 1e3:g} mm, {STATE_ERROR[1]:g} rad, {STATE_ERROR[2]:g} rad. \
**without**: the image alone.

The true feature is the centroid of the *whole* near side of a band, also where debris, a
highlight, text, the field stop, the picture's border or the instrument hides a part of it: that is
what the loop's model predicts. The centroid of the piece that is left counts as error. The visible
share is that of the same side, by area in the picture, that is inside it and not hidden; a
saturated highlight hides; smoke, blur and exposure do not.

The disturbances are those of `python/tautscope/twin/disturbances.py`. They come and go over
frames, so their strength varies here, from nothing to the limits: debris up to 40 % of a band,
smoke up to 65 % of the light, exposure 0.25 to 4 times the grey levels, white balance 0.8 to 1.25
per channel, motion blur up to 8 px, defocus up to 5 px, the black field stop over up to 45 % of a
band. Exposure is harder here than in a camera, whose grey levels are a compressed measure of light.
"Outside the picture" and "touching" are chosen by pose: a band cut by the border with at least half
of it left; less than {TOUCH} px between the bands.
"""


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a line per condition, both modes side by side."""
    lines = [
        "| condition | n | visible | valid [%] | wrong accepted [%] | error [px] "
        "| without prediction: valid | wrong accepted | error |",
        "|---|" + "--:|" * 8,
    ]
    for profile in (*CONDITIONS, "all"):
        mine = {row["what"]: row for row in rows if row["profile"] == profile}
        if not mine:
            continue
        some = next(iter(mine.values()))
        cells = [profile, str(some["n"]), str(some["n_visible"])]
        for label in MODES:
            for what, form in (
                ("valid", ".1f"),
                ("wrong accepted", ".2f"),
                ("marker error", ".2f"),
            ):
                row = mine.get(f"{what}, {label}")
                mark = "" if row is None or row["holds"] else " (!)"
                cells.append("-" if row is None else f"{row['pooled']:{form}}{mark}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def montage(path: Path, seed: int, columns: int = 6) -> None:
    """A row of pictures per condition, with the true features marked."""
    strips = []
    for name in CONDITIONS:
        strip = []
        for real in (True, False):
            for _, _, sequence, picture in shots(Job(name, seed, real, columns // 2)):
                image = picture.image.copy()
                for u, v in picture.true_features.reshape(2, 2):
                    if np.isfinite(u + v):
                        at = (round(float(u)), round(float(v)))
                        cv2.drawMarker(image, at, (255, 0, 255), cv2.MARKER_CROSS, 7, 1)
                seen = " ".join(f"{share:.2f}" for share in picture.true_visible)
                small = cv2.resize(image, (480, 384), interpolation=cv2.INTER_AREA)
                label = f"{name} #{sequence} visible {seen}"
                for shade, thick in (((0, 0, 0), 3), ((255, 255, 255), 1)):
                    cv2.putText(small, label, (6, 376), 0, 0.42, shade, thick, cv2.LINE_AA)
                strip.append(small)
        strips.append(np.hstack(strip))
    if not cv2.imwrite(str(path), np.vstack(strips)):
        raise OSError(f"cannot write {path}")


def write(rows: Sequence[dict[str, Any]], command: str) -> Path:
    """Make docs/conditions.md."""
    path = ROOT / "docs" / "conditions.md"
    seeds = max(row["seeds"] for row in rows)
    text = (
        "# Conditions\n\nHow well the markers are found, condition by condition. Made by\n\n"
        f"    {command}\n\n(seeds 0 to {seeds - 1}). (!) marks what misses its goal: valid at "
        "least 99 %, wrong accepted\nat most 0.1 % (none without an instrument), error at most "
        f"0.15 px clean\nand 0.5 px elsewhere.\n\n{table(rows)}\n\n"
        f"## What is counted\n\n{DEFINITIONS}"
    )
    path.write_text(text, encoding="utf-8")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=250, help="per condition [%(default)s]")
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds [%(default)s]")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="[all cores]")
    parser.add_argument("--json", action="store_true", help="print one JSON object and no more")
    parser.add_argument("--write", action="store_true", help="make docs/conditions.md")
    parser.add_argument("--montage", type=Path, metavar="FILE", help="only draw examples into FILE")
    options = parser.parse_args()
    if options.montage is not None:
        montage(options.montage, seed=0)
        return
    work = jobs(options.frames, range(options.seeds))
    with progress_bar(f"{sum(job.frames for job in work)} frames") as tell:
        rows = to_rows(run(work, options.workers, tell))
    if options.write:
        path = write(
            rows, f"uv run python benchmarks/conditions.py --frames {options.frames} --write"
        )
        print(f"wrote {path}", file=sys.stderr)
    print(json.dumps({"rows": rows}, allow_nan=False) if options.json else table(rows))


if __name__ == "__main__":
    main()
