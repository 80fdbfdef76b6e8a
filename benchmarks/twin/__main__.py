"""Speed of the twin relative to real time, with images and without, on one core.

With images: physics, rendering, and the loop with its detector. Without: physics alone.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
from common.rows import goal_row, print_rows
from tautscope import HysteresisReduction, Twin, load_config
from tautscope.loop.references import SineSequence


def seconds_per_second(*, images: bool, simulated: float) -> float:
    """Return the simulated seconds per second of processor time."""
    config = load_config()
    reference = SineSequence(config.experiment)
    twin = Twin(config, images=images)
    loop = HysteresisReduction(config)
    sample = twin.reset()
    ticks = round(simulated / twin.control_period)
    start = time.process_time()
    for _ in range(ticks):
        target = reference(sample.time)
        if images:
            sample = twin.step(loop.step(target, sample.time))
            if sample.frame is not None:
                loop.on_frame(sample.frame)
        else:
            sample = twin.step(target)
    return simulated / (time.process_time() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for what, images, simulated, goal in (
        ("with images", True, 10.0, 8.0),
        ("without images", False, 30.0, 40.0),
    ):
        speeds = [
            seconds_per_second(images=images, simulated=simulated) for _ in range(arguments.repeats)
        ]
        rows.append(goal_row(what, "x real time", speeds, goal, "min", profile="paper"))
    if arguments.json:
        print(json.dumps({"rows": rows, "frames_per_second": rows[0]["median"] * 25}))
        return
    print_rows(rows)
    print(f"frames per second, rendered and processed: {rows[0]['median'] * 25:.0f}")


if __name__ == "__main__":
    main()
