"""Share of losses after which the bands are found again within five images, without a prediction.

A sequence has five consecutive images of a moving instrument, from the first one in which at least
half of each band is visible. Its velocity is drawn uniformly up to the peak speed of the operator
motion, 1.2 amplitudes of the experiment per second; a disturbance goes on as in the loop. Nothing
is known of the posture in any of them.

    uv run python benchmarks/conditions/first_sight.py --sequences 2 --write
"""

import argparse
import os
import sys
from pathlib import Path
from time import thread_time

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
import numpy as np
from common.doc_pages import insert
from common.paths import ROOT
from common.processes import run_parallel
from conditions.backgrounds import KINDS, require_frames
from conditions.frames import (
    CONDITIONS,
    MAX_ERROR,
    MIN_VISIBLE,
    WORKSPACE,
    Job,
    centreline,
    conditions_camera,
    draw_state,
)
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.vision import MarkerDetector

IMAGES = 5
"""Number of images of a sequence."""
GOAL = 99.0
"""Share of the sequences that should be found [%]."""
PERIOD = 0.04
"""Time between images [s]."""
PEAK_SPEED = 1.2
"""Largest speed of a DOF [amplitudes of the experiment per second]."""


def evaluate(job: Job) -> list[tuple[bool, bool, float]]:
    """Return whether each sequence is found and found wrong, and its longest CPU time [s]."""
    cv2.setNumThreads(1)
    condition = CONDITIONS[job.condition]
    config, camera, plain, rng = conditions_camera(job)
    detector = MarkerDetector(Config())
    amplitudes = np.array([config.experiment[dof].amplitude for dof in Dof])
    results: list[tuple[bool, bool, float]] = []
    while len(results) < job.frames:
        sequence = int(rng.integers(0, 10_000))
        state = draw_state(config, plain, condition.poses, rng)
        step = PERIOD * PEAK_SPEED * amplitudes * rng.uniform(-1, 1, 3)
        is_found, is_wrong, longest = False, False, 0.0
        for index in range(IMAGES):
            now = np.clip(state + index * step, *WORKSPACE)
            image = camera.draw(*centreline(config, now), sequence + index)
            if index == 0 and image.true_visible.min() < MIN_VISIBLE:
                break
            start = thread_time()
            detection = detector.detect(image.image)
            longest = max(longest, thread_time() - start)
            if detection.valid:
                error = np.hypot(*(detection.features - image.true_features).reshape(2, 2).T)
                is_right = bool((error <= MAX_ERROR).all())
                is_found |= is_right
                is_wrong |= not is_right
        else:
            results.append((is_found, is_wrong, longest))
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sequences", type=int, default=4, help="per condition, seed, background")
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds [%(default)s]")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="[all cores]")
    parser.add_argument(
        "--write", action="store_true", help="update the table of docs/conditions.md"
    )
    options = parser.parse_args()
    require_frames(parser)
    names = [name for name in CONDITIONS if not name.startswith("no instrument")]
    work = [
        Job(name, seed, kind, options.sequences)
        for name in names
        for seed in range(options.seeds)
        for kind in KINDS
    ]
    found: dict[str, list[tuple[bool, bool, float]]] = {name: [] for name in names}
    for job, results in run_parallel(evaluate, work, options.workers):
        found[job.condition] += results
    lines = [
        f"{len(found[names[0]])} sequences of each condition.",
        "",
        "| condition | found within 5 images [%] | wrong | CPU: 95 %, longest [ms] |",
        "|---|--:|--:|--:|",
    ]
    for name in (*names, "all"):
        own = [each for key, values in found.items() if name in (key, "all") for each in values]
        is_found, is_wrong, longest = np.array(own, dtype=float).T
        if name != "all" and is_found.all() and not is_wrong.any():
            continue
        times = 1e3 * np.array([np.quantile(longest, 0.95), longest.max()])
        share = 100 * is_found.mean()
        cells = [name, f"{share:.1f}" + ("" if share >= GOAL else " (!)")]
        cells += [str(int(is_wrong.sum())), f"{times[0]:.1f}, {times[1]:.1f}"]
        lines.append("| " + " | ".join(cells) + " |")
    print(table := "\n".join(lines))
    if options.write:
        insert(ROOT / "docs" / "conditions.md", "first sight", table)


if __name__ == "__main__":
    main()
