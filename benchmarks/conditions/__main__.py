"""Detection of the markers under the image conditions of an operation, with exact truth.

Images of the twin at random poses of the workspace, before real colon frames, random crops of them
and procedural mucosa, one condition at a time. Each is evaluated twice: with a prediction as in the
loop, and without. `--write` updates the table of docs/conditions.md, which defines the quantities.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
import numpy as np
from common.doc_pages import insert
from common.paths import ROOT
from common.processes import run_parallel
from conditions.backgrounds import KINDS, require_frames
from conditions.frames import CONDITIONS, Evaluation, Job, evaluate, render
from conditions.rows import table, to_rows
from tautscope.commands.printing import progress_bar


def jobs(frames: int, seeds: Sequence[int], is_tuning: bool) -> list[Job]:
    """Divide the frames of each condition among all seeds and kinds of background."""
    each = max(1, round(frames / (len(KINDS) * len(seeds))))
    return [
        Job(name, seed, kind, each, is_tuning)
        for name in CONDITIONS
        for seed in seeds
        for kind in KINDS
    ]


def run(
    work: Sequence[Job], workers: int, show_progress: Callable[[float], None]
) -> list[Evaluation]:
    """Evaluate all jobs in parallel."""
    finished: dict[Job, list[Evaluation]] = {}
    for job, evaluations in run_parallel(evaluate, work, workers):
        finished[job] = evaluations
        show_progress(len(finished) / len(work))
    return [each for job in work for each in finished[job]]


def montage(path: Path, seed: int, columns: int = 6) -> None:
    """Draw a row of images per condition, with the true features marked."""
    strips = []
    for name in CONDITIONS:
        strip = []
        for kind in KINDS:
            for _, _, sequence, rendered in render(Job(name, seed, kind, columns // 3)):
                image = rendered.image.copy()
                for u, v in rendered.true_features.reshape(2, 2):
                    if np.isfinite(u + v):
                        at = (round(float(u)), round(float(v)))
                        cv2.drawMarker(image, at, (255, 0, 255), cv2.MARKER_CROSS, 7, 1)
                shares = " ".join(f"{share:.2f}" for share in rendered.true_visible)
                small = cv2.resize(image, (480, 384), interpolation=cv2.INTER_AREA)
                label = f"{name} #{sequence} visible {shares}"
                for shade, thick in (((0, 0, 0), 3), ((255, 255, 255), 1)):
                    cv2.putText(small, label, (6, 376), 0, 0.42, shade, thick, cv2.LINE_AA)
                strip.append(small)
        strips.append(np.hstack(strip))
    if not cv2.imwrite(str(path), np.vstack(strips)):
        raise OSError(f"cannot write {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--frames", type=int, default=250, help="frames per condition [%(default)s]"
    )
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds [%(default)s]")
    parser.add_argument(
        "--first-seed", type=int, default=0, help="first seed; use others for tuning [%(default)s]"
    )
    parser.add_argument(
        "--tuning",
        action="store_true",
        help="use the frames and crops for tuning; with other seeds",
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="[all cores]")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--write", action="store_true", help="update the table of docs/conditions.md"
    )
    parser.add_argument("--montage", type=Path, metavar="FILE", help="only draw examples, to FILE")
    options = parser.parse_args()
    require_frames(parser)
    if options.montage is not None:
        montage(options.montage, seed=0)
        return
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    work = jobs(options.frames, seeds, options.tuning)
    with progress_bar(f"{sum(job.frames for job in work)} frames") as show_progress:
        rows = to_rows(run(work, options.workers, show_progress))
    if options.write:
        frames = sum(job.frames for job in work) // len(CONDITIONS)
        named = f"Seeds {seeds[0]} to {seeds[-1]}, {frames} images of each condition."
        insert(ROOT / "docs" / "conditions.md", "conditions", f"{named}\n\n{table(rows)}")
    print(json.dumps({"rows": rows}, allow_nan=False) if options.json else table(rows))


if __name__ == "__main__":
    main()
