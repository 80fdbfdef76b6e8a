"""State estimation from one image: the article's unweighted step, and the estimate of `best`.

The truth is the twin's: states and features of its physics and renderer, which share no code with
the models of the loop. Each seed is another instrument that moves in all three DOFs at once without
compensation. A measurement is a true feature with noise, a prediction the true state with an error.
The estimate of `best` is that of a loop's first image; the first reference is the prediction.

`--images` adds the state error of both profiles in the whole loop with images (a minute per seed).
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from common.rows import goal_row
from state.cases import CASES, Errors, draw_poses, estimate
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.references import SineSequence
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import per_dof
from tautscope.twin.rig import Twin

GOALS = (0.5e-3, 0.05, 0.03)
"""Goals of the state error [m, rad, rad]."""


def measure(seeds: Sequence[int], count: int) -> list[dict[str, Any]]:
    """Return RMS error, mean squared normalised error, and share of images without an update."""
    errors: dict[tuple[str, str], list[Errors]] = {}
    for seed in seeds:
        config = load_config(profile="best").replace(**{"twin.seed": seed})
        poses = draw_poses(config, count)
        for case in CASES:
            for name, found in estimate(config, case, poses).items():
                errors.setdefault((case.name, name), []).append(found)
        print(f"seed {seed}: {len(poses.states)} poses", file=sys.stderr)
    rows = []
    for (case, name), found in errors.items():
        n = sum(len(each.absolute) for each in found)
        for dof in Dof:
            scale, unit = dof.display_scale, dof.display_unit
            rms = [scale * float(np.sqrt(np.mean(each.absolute[:, dof] ** 2))) for each in found]
            nees = [
                # An image that updated nothing has no standard deviation.
                float(np.nanmean(each.normalised[:, dof] ** 2))
                for each in found
                if each.normalised is not None
            ]
            held = [float(1 - each.observable[:, dof].mean()) for each in found]
            for what, unit_shown, values, goal in (
                ("state error", unit, rms, scale * GOALS[dof]),
                ("squared error over variance", "1", nees, 1.5),
                ("held", "share", held, 1.0),
            ):
                if values:
                    label = f"{what}, {case}"
                    rows.append(
                        goal_row(label, unit_shown, values, goal, dof=dof.label, profile=name, n=n)
                    )
    return rows


def with_images(seeds: Sequence[int]) -> list[dict[str, Any]]:
    """Return the state error of the whole loop in the article's experiment."""
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
            values = [float(dof.display_scale * error[dof]) for error in errors]
            goal = dof.display_scale * GOALS[dof]
            rows.append(
                goal_row(
                    "state error, images",
                    dof.display_unit,
                    values,
                    goal,
                    dof=dof.label,
                    profile=profile,
                )
            )
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a Markdown table: a line per case and estimator; median over seeds (worst)."""
    lines = [
        "| case | estimator | insertion [mm] | rotation [rad] | bending [rad] "
        "| squared error over variance | rotation held |",
        "|---|---|--:|--:|--:|--:|--:|",
    ]
    cells: dict[tuple[str, str], dict[tuple[str, str], dict[str, Any]]] = {}
    for row in rows:
        quantity, _, case = row["what"].partition(", ")
        cells.setdefault((case, row["profile"]), {})[quantity, row["dof"]] = row
    for (case, profile), found in cells.items():
        errors = [found["state error", dof.label] for dof in Dof]
        text = [f"{row['median']:.3f} ({row['worst']:.3f})" for row in errors]
        normalised = [found.get(("squared error over variance", dof.label)) for dof in Dof]
        text.append(" ".join("-" if row is None else f"{row['median']:.1f}" for row in normalised))
        held = found.get(("held", "rotation"))
        text.append("-" if held is None else f"{100 * held['median']:.0f} %")
        lines.append(f"| {case} | {profile} | " + " | ".join(text) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds [%(default)s]")
    parser.add_argument("--first", type=int, default=0, help="first seed [%(default)s]")
    parser.add_argument("--poses", type=int, default=400, help="poses per seed [%(default)s]")
    parser.add_argument("--images", action="store_true", help="also run the whole loop with images")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    rows = measure(seeds, options.poses)
    if options.images:
        rows += with_images(seeds)
    print(json.dumps({"rows": rows}, allow_nan=False) if options.json else table(rows))


if __name__ == "__main__":
    main()
