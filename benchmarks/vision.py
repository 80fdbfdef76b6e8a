"""How fast the markers are found, against OpenCV, scikit-image, ViSP and a plain read of the frame.

One thread, all peers in turn in one process, so that a busy machine slows all of them. Each finds
the centroids of the regions in a B, G, R frame ("recognised" also judges which are the bands, as
the loop asks, by windows first); ViSP gets a grey image that already shows the
blobs, and finds one. A plain read is the fastest of numpy's vectorised reductions over all bytes.

Every timed call follows an untimed one of the same kind, so that none pays for pages and code that
it has used before, and then, the same for all: four plain reads of the frame, which leave it in the
cache as far as it fits, as does a grabber that has just written it; or, where it says "cold", a
read of 96 MiB of other memory, after which no cache has any of it. The goals are for the first.
Where it says "repeated", nothing is between the two calls, as in ViSP's own loop.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope import Twin, load_config
from tautscope.config import Config
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector, Region
from vision_peers import (
    HAS_SCIKIT_IMAGE,
    Visp,
    opencv_components,
    opencv_contours,
    opencv_planes,
    opencv_textbook,
    scikit_image,
)

Image = NDArray[np.uint8]
SIZES = ((720, 576), (1920, 1080), (3840, 2160))
MARGIN = 20  # px at 1920x1080: how far a window reaches beyond its band
POSTURE = np.array([0.012, 0.0, 0.5])
COLD = 96 << 20  # bytes: more than the caches hold
EXPECTATION = StatePrediction(POSTURE, np.array([2e-3, 0.1, 0.1]))
ROOT = Path(__file__).resolve().parents[1]


def twins_picture() -> Image:
    """The instrument before procedural mucosa, near the camera."""
    twin = Twin(load_config())
    image, sample = None, twin.reset()
    while sample.time < 2.0:
        sample = twin.step(POSTURE)
        image = image if sample.frame is None else sample.frame.image
    assert image is not None
    return image


def colon_picture(drawn: Image) -> Image | None:
    """The same instrument before a real frame, if the shared data are there."""
    folder = Path(os.environ.get("TAUTSCOPE_DATA", ROOT.parent / "shared" / "data"))
    files = sorted((folder / "colon_frames").glob("*.jpg"))
    if not files:
        return None
    real = cv2.resize(cv2.imread(str(files[1])), (drawn.shape[1], drawn.shape[0]))
    green = drawn.astype(int) @ np.array([-1, 2, -1]) > 0
    band = cv2.dilate(green.astype(np.uint8), np.ones((5, 5))) > 0
    real[band] = drawn[band]
    return real


def detector_for(size: tuple[int, int], **changes: object) -> MarkerDetector:
    camera = {"camera.width": size[0], "camera.height": size[1]}
    return MarkerDetector(Config().replace(**camera, **changes))


def windows_of(regions: tuple[Region, ...], width: int) -> list[tuple[int, int, int, int]]:
    margin = MARGIN * width // 1920
    boxes = [region.box for region in regions[:2]]
    return [
        (max(u - margin, 0), max(v - margin, 0), u + w + margin, v + h + margin)
        for u, v, w, h in boxes
    ]


def measured(
    calls: dict[str, Callable[[], object]], repeats: int, prepare: Callable[[], object]
) -> dict[str, list[float]]:
    """Seconds per call, the calls in turn, each after an untimed one and `prepare`."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            call()
            prepare()
            start = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - start)
    return times


def warming(image: Image) -> Callable[[], object]:
    """Brings a frame into the cache; after OpenCV's images one read does not."""
    return lambda: [image.max() for _ in range(4)]


def compared(image: Image, repeats: int, visp: Visp) -> dict[str, float]:
    """Median milliseconds (windows and ViSP: microseconds) of each way to find the markers."""
    size = (image.shape[1], image.shape[0])
    config, detector = Config(), detector_for(size)
    whole = [(0, 0, *size)]
    regions = detector.regions_in(image, whole)
    windows = windows_of(regions, size[0])
    flat = image.reshape(-1)
    words = flat.view(np.uint64)
    calls: dict[str, Callable[[], object]] = {
        "full_ms": lambda: detector.regions_in(image, whole),
        "windows_us": lambda: detector.regions_in(image, windows),
        "read max": flat.max,
        "read sum": words.sum,
        "read xor": lambda: np.bitwise_xor.reduce(words),
        "opencv_textbook_ms": lambda: opencv_textbook(image, config),
        "contours": lambda: opencv_contours(image, config),
        "components": lambda: opencv_components(image, config),
        "planes": lambda: opencv_planes(image, config),
    }
    if HAS_SCIKIT_IMAGE:
        calls["scikit_image_ms"] = lambda: scikit_image(image, config)
    if size == SIZES[0]:
        # Only this is the size of the configured camera, of which the model knows the lens.
        calls["recognised_ms"] = lambda: detector.detect(image, expectation=EXPECTATION)
        assert detector.detect(image, expectation=EXPECTATION).valid
    times = measured(calls, repeats, warming(flat))
    cold = measured(calls, repeats, np.ones(COLD >> 3).max)
    repeated = measured({"windows": calls["windows_us"]}, repeats, lambda: None)["windows"]
    middle = {name: 1e3 * statistics.median(values) for name, values in times.items()}
    cold_middle = {name: 1e3 * statistics.median(values) for name, values in cold.items()}
    opencv = ("contours", "components", "planes")
    reads = ("read max", "read sum", "read xor")
    read = min(reads, key=middle.__getitem__)
    figures = {
        "full_ms": middle["full_ms"],
        "full_min_ms": 1e3 * min(times["full_ms"]),
        "read_ms": middle[read],
        "read_min_ms": 1e3 * min(times[read]),
        "opencv_textbook_ms": middle["opencv_textbook_ms"],
        "opencv_best_ms": min(middle[name] for name in opencv),
        "windows_us": 1e3 * middle["windows_us"],
        "windows_min_us": 1e6 * min(times["windows_us"]),
        "windows_repeated_us": 1e6 * statistics.median(repeated),
        "window_px": sum((r - lft) * (b - t) for lft, t, r, b in windows),
        "cold_full_ms": cold_middle["full_ms"],
        "cold_read_ms": min(cold_middle[name] for name in reads),
        "cold_opencv_textbook_ms": cold_middle["opencv_textbook_ms"],
        "cold_opencv_best_ms": min(cold_middle[name] for name in opencv),
        "cold_windows_us": 1e3 * cold_middle["windows_us"],
    }
    if "recognised_ms" in middle:
        figures["recognised_ms"] = middle["recognised_ms"]
    if HAS_SCIKIT_IMAGE:
        figures["scikit_image_ms"] = middle["scikit_image_ms"]
    one_blob = visp.microseconds(image, regions, repeats)
    if one_blob is not None:
        figures["visp_one_blob_us"] = one_blob
    return figures


def worst_frames(repeats: int) -> dict[str, float]:
    """Milliseconds at 1920x1080 of frames that hold nothing that can be skipped."""
    rng = np.random.default_rng(0)
    height, width = 1080, 1920
    checks = (np.indices((height, width)).sum(axis=0) % 2).astype(np.uint8)
    frames = {
        "noise": rng.integers(0, 256, (height, width, 3), dtype=np.uint8),
        "all marker": np.full((height, width, 3), (70, 190, 60), np.uint8),
        "checkerboard": checks[..., None] * np.array([0, 255, 0], np.uint8),
        "black": np.zeros((height, width, 3), np.uint8),
    }
    worst = {}
    for smoothing in (0, 1):
        detector = detector_for((width, height), **{"vision.smoothing": smoothing})
        for name, frame in frames.items():
            call = {name: lambda d=detector, f=frame: d.regions_in(f, [(0, 0, width, height)])}
            times = measured(call, max(5, repeats // 5), warming(frame))
            worst[f"{name}, {smoothing} passes"] = 1e3 * statistics.median(times[name])
    return worst


def rows_of(name: str, figures: dict[str, float], repeats: int) -> list[dict[str, object]]:
    """The goals, at 1920x1080."""
    full = figures["full_ms"]
    goals = (
        ("full frame in plain reads", "reads", full / figures["read_ms"], 3.0, "max"),
        ("fastest OpenCV over ours", "x", figures["opencv_best_ms"] / full, 10.0, "min"),
        ("textbook OpenCV over ours", "x", figures["opencv_textbook_ms"] / full, 40.0, "min"),
        ("both windows", "us", figures["windows_us"], 20.0, "max"),
        ("both windows, repeated", "us", figures["windows_repeated_us"], 20.0, "max"),
    )
    return [
        {
            "what": what,
            "dof": None,
            "profile": name,
            "unit": unit,
            "median": value,
            "worst": value,
            "n": repeats,
            "goal": goal,
            "sense": sense,
            "holds": bool(value <= goal if sense == "max" else value >= goal),
        }
        for what, unit, value, goal, sense in goals
    ]


def printed(figures: dict[str, dict[str, float]]) -> None:
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
    drawn = twins_picture()
    colon = colon_picture(drawn)
    figures: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        visp = Visp(Path(folder))
        for size in SIZES:
            name = f"{size[0]}x{size[1]}"
            figures[name] = compared(cv2.resize(drawn, size), arguments.repeats, visp)
            if colon is not None:
                scaled = cv2.resize(colon, size)
                figures[f"{name} colon"] = compared(scaled, arguments.repeats, visp)
    worst = worst_frames(arguments.repeats)
    rows = [
        row
        for name in figures
        if name.startswith("1920x1080")
        for row in rows_of(name, figures[name], arguments.repeats)
    ]
    hint = "not installed (uv run --with scikit-image python benchmarks/vision.py)"
    left_out = {"ViSP": visp.missing, "scikit-image": "" if HAS_SCIKIT_IMAGE else hint}
    left_out = {name: why for name, why in left_out.items() if why}
    if arguments.json:
        print(json.dumps({**figures, "worst_ms": worst, "left_out": left_out, "rows": rows}))
        return
    printed(figures)
    for name, milliseconds in worst.items():
        print(f"{name:26} {milliseconds:8.2f} ms at 1920x1080")
    for name, why in left_out.items():
        print(f"left out: {name}: {why}")
    for row in rows:
        verdict = "holds" if row["holds"] else "MISSED"
        print(
            f"{row['what']:28} {row['profile']:18} {row['median']:7.2f} {row['unit']:6} "
            f"(goal {row['goal']:.0f}: {verdict})"
        )


if __name__ == "__main__":
    main()
