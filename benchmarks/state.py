"""State estimation: the article's single unweighted step beside ours, idea by idea.

The truth is the twin's: states and features of its physics and renderer, which share nothing with
the loop's models. Each seed is an instrument of its own, moved in all three DOFs at once without
compensation. A measurement is a true feature with noise, a belief the true state with an error.

`--images` adds the state error of both profiles with the whole loop and its vision (a minute per
seed).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope import _core
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.loop.construction import (
    build_feature_model,
    build_state_estimator,
    build_weighted_estimator,
)
from tautscope.loop.references import SineSequence
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import per_dof
from tautscope.twin.camera import TwinCamera
from tautscope.twin.plant import Plant
from tautscope.twin.rig import Twin

Floats = NDArray[np.float64]
TRACKING = (0.5e-3, 0.05, 0.03)
"""How wrong the belief is while the loop runs [m, rad, rad]."""
GOALS = (0.5e-3, 0.05, 0.03)
PERIODS = (10.0, 7.3, 8.9)
EVERY = 23
"""Control periods between two poses."""
LATE = 4
"""Control periods by which a capture time is wrong: 20 ms."""
ARTICLE = "article: one step"
OURS = "left out if wrong (best)"
VARIANTS: dict[str, dict[str, float | int]] = {
    "weighted, one step": {"outlier_distance": 1e9, "sideways_deviation": 0.0, "steps": 1},
    "iterated": {"outlier_distance": 1e9, "sideways_deviation": 0.0},
    "uneven bend": {"outlier_distance": 1e9},
    OURS: {},
}


@dataclass(frozen=True)
class Case:
    """What is wrong with the images and the belief."""

    name: str
    noise: tuple[float, float] = (0.2, 0.2)
    """Of the markers A and B: standard deviations [px]."""
    belief: tuple[float, float, float] = TRACKING
    """Error of the belief: standard deviations [m, rad, rad]."""
    outliers: float = 0.0
    """Share of the images with one marker wrong by 5 to 40 px."""
    lost: int | None = None
    """Marker that is never seen."""
    late: bool = False
    """The belief is that of 20 ms before."""


CASES = (
    Case("clean", noise=(1e-3, 1e-3)),
    Case("noise 0.2 px"),
    Case("noise 0.5 px", noise=(0.5, 0.5)),
    Case("noise 1 px", noise=(1.0, 1.0)),
    Case("noise 0.2 px in A, 1.5 px in B", noise=(0.2, 1.5)),
    Case("belief off by 2 mm, 0.3, 0.3 rad", belief=(2e-3, 0.3, 0.3)),
    Case("belief off by 5 mm, 0.5, 0.5 rad", belief=(5e-3, 0.5, 0.5)),
    Case("belief off by 10 mm, 0.8, 0.8 rad", belief=(10e-3, 0.8, 0.8)),
    Case("outliers in 5 %", outliers=0.05),
    Case("outliers in 10 %", outliers=0.1),
    Case("B not seen", lost=1),
    Case("time wrong by 20 ms", late=True),
)


@dataclass(frozen=True)
class Poses:
    """Of one instrument: states (n, 3), those of 20 ms before, and features (n, 4)."""

    states: Floats
    earlier: Floats
    features: Floats


def poses(config: Config, count: int) -> Poses:
    """What the twin was like and looked like."""
    plant = Plant(config, np.random.default_rng(config.twin.seed))
    camera = TwinCamera(config)
    sines = [config.experiment[dof] for dof in Dof]
    states, found = [plant.true_state], []
    for tick in range(1, count * EVERY + 1):
        time = tick * config.control.period
        command = [
            sine.centre + sine.amplitude * np.sin(2 * np.pi * time / period)
            for sine, period in zip(sines, PERIODS, strict=True)
        ]
        plant.step(np.array(command))
        states.append(plant.true_state)
        if tick % EVERY == 0:
            picture = camera.draw(*plant.centreline(), tick)
            found.append((states[-1], states[-1 - LATE], picture.true_features))
    kept = [row for row in found if np.isfinite(row[2]).all()]
    return Poses(*(np.array(column) for column in zip(*kept, strict=True)))


@dataclass(frozen=True)
class Look:
    """Errors (n, 3), in standard deviations where there is one, and observable (n, 3)."""

    errors: Floats
    normalised: Floats | None
    observable: NDArray[np.bool_]


def looks(config: Config, case: Case, seen: Poses) -> dict[str, Look]:
    """Every variant on the same measurements and beliefs."""
    rng = np.random.default_rng([config.twin.seed, CASES.index(case)])
    count = len(seen.states)
    sigma = np.repeat(case.noise, 2)
    measured = seen.features + sigma * rng.standard_normal((count, 4))
    wrong = np.flatnonzero(rng.random(count) < case.outliers)
    angle, far = rng.uniform(0, 2 * np.pi, wrong.size), rng.uniform(5, 40, wrong.size)
    marker = 2 * rng.integers(0, 2, wrong.size)
    measured[wrong, marker] += far * np.cos(angle)
    measured[wrong, marker + 1] += far * np.sin(angle)
    if case.lost is not None:
        measured[:, 2 * case.lost : 2 * case.lost + 2] = np.nan
    beliefs = seen.states + np.array(case.belief) * rng.standard_normal((count, 3))
    if case.late:
        beliefs = seen.earlier
    model = build_feature_model(config)
    found = {}
    states, observable = build_state_estimator(config).run(model, beliefs, measured)
    found[ARTICLE] = Look(states - seen.states, None, observable)
    for name, changes in VARIANTS.items():
        estimator: _core.WeightedEstimator = build_weighted_estimator(
            config.replace(**{f"state_estimation.{key}": value for key, value in changes.items()})
        )
        states, deviation, observable = estimator.run(
            model, beliefs, np.array(case.belief), measured, np.diag(sigma**2)
        )
        errors = states - seen.states
        found[name] = Look(errors, errors / deviation, observable)
    return found


def row(
    what: str, dof: Dof, profile: str, *, unit: str, values: Sequence[float], goal: float, n: int
) -> dict[str, Any]:
    return {
        "what": what,
        "dof": dof.label,
        "profile": profile,
        "unit": unit,
        "median": median(values),
        "worst": max(values),
        "n": n,
        "goal": goal,
        "sense": "max",
        "holds": median(values) <= goal,
    }


def measure(seeds: Sequence[int], count: int) -> list[dict[str, Any]]:
    """RMS error, mean squared normalised error, and share of the images with the DOF held."""
    each: dict[tuple[str, str], list[Look]] = {}
    for seed in seeds:
        config = load_config(profile="best").replace(**{"twin.seed": seed})
        seen = poses(config, count)
        for case in CASES:
            for name, look in looks(config, case, seen).items():
                each.setdefault((case.name, name), []).append(look)
        print(f"seed {seed}: {len(seen.states)} poses", file=sys.stderr)
    rows = []
    for (case_name, name), found in each.items():
        n = sum(len(look.errors) for look in found)
        for dof in Dof:
            unit, scale = ("mm", 1e3) if dof is Dof.INSERTION else ("rad", 1.0)
            rms = [scale * float(np.sqrt(np.mean(look.errors[:, dof] ** 2))) for look in found]
            goal = scale * GOALS[dof]
            rows.append(
                row(f"state error, {case_name}", dof, name, unit=unit, values=rms, goal=goal, n=n)
            )
            sure = [look.normalised for look in found if look.normalised is not None]
            if sure:
                nees = [float(np.mean(values[:, dof] ** 2)) for values in sure]
                rows.append(
                    row(
                        f"squared error over variance, {case_name}",
                        dof,
                        name,
                        unit="1",
                        values=nees,
                        goal=1.5,
                        n=n,
                    )
                )
            held = [float(1 - look.observable[:, dof].mean()) for look in found]
            rows.append(
                row(f"held, {case_name}", dof, name, unit="share", values=held, goal=1.0, n=n)
            )
    return rows


def with_images(seeds: Sequence[int]) -> list[dict[str, Any]]:
    """State error of the whole loop in the article's experiment."""
    rows = []
    for profile in ("paper", "best"):
        errors = []
        for seed in seeds:
            config = load_config(profile=profile).replace(**{"twin.seed": seed})
            rig = Twin(config)
            frames = run_experiment(rig, SineSequence(config.experiment), config).frames
            rig.close()
            error = per_dof(frames, "estimate") - per_dof(frames, "true")
            errors.append(np.sqrt(np.nanmean(error**2, axis=0)))
        for dof in Dof:
            unit, scale = ("mm", 1e3) if dof is Dof.INSERTION else ("rad", 1.0)
            values = [float(scale * error[dof]) for error in errors]
            rows.append(
                row(
                    "state error, images",
                    dof,
                    profile,
                    unit=unit,
                    values=values,
                    goal=scale * GOALS[dof],
                    n=len(seeds),
                )
            )
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a line per case and variant; median over seeds, the worst in brackets."""
    lines = [
        "| case | estimator | insertion [mm] | rotation [rad] | bending [rad] "
        "| squared error over variance | rotation held |",
        "|---|---|--:|--:|--:|--:|--:|",
    ]
    cells: dict[tuple[str, str], dict[tuple[str, str], dict[str, Any]]] = {}
    for one in rows:
        quantity, _, case = one["what"].partition(", ")
        cells.setdefault((case, one["profile"]), {})[quantity, one["dof"]] = one
    for (case, profile), found in cells.items():
        errors = [found["state error", dof.label] for dof in Dof]
        text = [f"{one['median']:.3f} ({one['worst']:.3f})" for one in errors]
        sure = [found.get(("squared error over variance", dof.label)) for dof in Dof]
        text.append(" ".join("-" if one is None else f"{one['median']:.1f}" for one in sure))
        held = found.get(("held", "rotation"))
        text.append("-" if held is None else f"{100 * held['median']:.0f} %")
        lines.append(f"| {case} | {profile} | " + " | ".join(text) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds [%(default)s]")
    parser.add_argument("--first", type=int, default=0, help="the first of them [%(default)s]")
    parser.add_argument("--poses", type=int, default=400, help="per seed [%(default)s]")
    parser.add_argument(
        "--images", action="store_true", help="also the whole loop, with its vision"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    rows = measure(seeds, options.poses)
    if options.images:
        rows += with_images(seeds)
    print(json.dumps({"rows": rows}, allow_nan=False) if options.json else table(rows))


if __name__ == "__main__":
    main()
