"""Speed of the marker detection, compared with OpenCV, scikit-image, ViSP and a read of the frame.

One thread; all programs run in turn in one process, so that other load slows all of them. Each
finds the centroids of the regions in a B, G, R frame ("recognised" also assigns regions to bands,
in windows first, as in the loop). ViSP gets a grey image with the blobs, and finds one of them. A
plain read is the fastest of NumPy's vectorised reductions over all bytes.

Every timed call follows an untimed one of the same kind, so that code and pages are loaded. Before
it, the frame is read four times, which leaves it in the cache as far as it fits, as does a frame
grabber; or, in "cold" rows, 96 MiB of other memory are read, so that no cache holds the frame. The
goals are for the first state. In "repeated" rows nothing is between the calls, as in ViSP's own
loop.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import cv2
from common.rows import goal_row, print_rows
from vision.peers import HAS_SCIKIT_IMAGE, Visp
from vision.timing import SIZES, colon_image, time_all, time_worst_frames, twin_image


def rows_of(name: str, figures: dict[str, float], repeats: int) -> list[dict[str, Any]]:
    """Return the rows with goals, for an image of 1920x1080."""
    full = figures["full_ms"]
    goals = (
        ("full frame in plain reads", "reads", full / figures["read_ms"], 3.0, "max"),
        ("fastest OpenCV over ours", "x", figures["opencv_best_ms"] / full, 10.0, "min"),
        ("textbook OpenCV over ours", "x", figures["opencv_textbook_ms"] / full, 40.0, "min"),
        ("both windows", "us", figures["windows_us"], 20.0, "max"),
        ("both windows, repeated", "us", figures["windows_repeated_us"], 20.0, "max"),
    )
    return [
        goal_row(what, unit, [value], goal, sense, profile=name, n=repeats)
        for what, unit, value, goal, sense in goals
    ]


def print_figures(figures: dict[str, dict[str, float]]) -> None:
    names = list(dict.fromkeys(name for column in figures.values() for name in column))
    print(f"{'':24}" + "".join(f"{size:>20}" for size in figures))
    for name in names:
        values = (column.get(name) for column in figures.values())
        print(f"{name:24}" + "".join(f"{'' if v is None else f'{v:.3f}':>20}" for v in values))
    for state in ("", "cold_"):
        for name, over, under in (
            ("full / read", "full", "read"),
            ("best OpenCV / full", "opencv_best", "full"),
            ("textbook / full", "opencv_textbook", "full"),
        ):
            ratios = (
                column[f"{state}{over}_ms"] / column[f"{state}{under}_ms"]
                for column in figures.values()
            )
            shown = f"{name}, cold" if state else name
            print(f"{shown:24}" + "".join(f"{ratio:>20.1f}" for ratio in ratios))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=60)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    rendered = twin_image()
    colon = colon_image(rendered)
    figures: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        visp = Visp(Path(folder))
        for size in SIZES:
            name = f"{size[0]}x{size[1]}"
            figures[name] = time_all(cv2.resize(rendered, size), arguments.repeats, visp)
            if colon is not None:
                scaled = cv2.resize(colon, size)
                figures[f"{name} colon"] = time_all(scaled, arguments.repeats, visp)
    worst = time_worst_frames(arguments.repeats)
    rows = [
        row
        for name in figures
        if name.startswith("1920x1080")
        for row in rows_of(name, figures[name], arguments.repeats)
    ]
    hint = "not installed (uv run --with scikit-image python benchmarks/vision)"
    left_out = {"ViSP": visp.missing, "scikit-image": "" if HAS_SCIKIT_IMAGE else hint}
    left_out = {name: why for name, why in left_out.items() if why}
    if arguments.json:
        print(json.dumps({**figures, "worst_ms": worst, "left_out": left_out, "rows": rows}))
        return
    print_figures(figures)
    for name, milliseconds in worst.items():
        print(f"{name:26} {milliseconds:8.2f} ms at 1920x1080")
    for name, why in left_out.items():
        print(f"left out: {name}: {why}")
    print_rows(rows)


if __name__ == "__main__":
    main()
