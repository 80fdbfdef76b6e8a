"""How much faster than real time the twin runs, with images and without, on one core.

With images: physics, drawing, and the loop that looks at every frame. Without: physics alone.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time

os.environ["OMP_NUM_THREADS"] = "1"

import cv2
from tautscope import HysteresisReduction, Twin, load_config
from tautscope.loop.references import SineSequence


def seconds_per_second(*, images: bool, simulated: float) -> float:
    """Simulated seconds per second of processor time."""
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
        ("with images, drawn and looked at", True, 10.0, 8.0),
        ("without images", False, 30.0, 40.0),
    ):
        figures = [
            seconds_per_second(images=images, simulated=simulated) for _ in range(arguments.repeats)
        ]
        median = statistics.median(figures)
        rows.append(
            {
                "what": what,
                "dof": None,
                "profile": "paper",
                "unit": "x real time",
                "median": median,
                "worst": min(figures),
                "n": len(figures),
                "goal": goal,
                "sense": "min",
                "holds": bool(median >= goal),
            }
        )
    if arguments.json:
        print(json.dumps({"rows": rows, "frames_per_second": rows[0]["median"] * 25}))
        return
    for row in rows:
        print(
            f"{row['what']:34} {row['median']:6.1f} x real time (worst {row['worst']:.1f} of "
            f"{row['n']}; goal {row['goal']:.0f}: {'holds' if row['holds'] else 'MISSED'})"
        )
    print(f"frames per second, drawn and looked at: {rows[0]['median'] * 25:.0f}")


if __name__ == "__main__":
    main()
