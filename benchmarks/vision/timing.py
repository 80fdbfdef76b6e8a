"""Images of the vision benchmark, and the time that each detector takes on them."""

import statistics
import time
from collections.abc import Callable

import cv2
import numpy as np
from common.paths import DATA
from numpy.typing import NDArray
from tautscope import Twin, load_config
from tautscope.config import Config
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector, Region
from vision import peers

Image = NDArray[np.uint8]
SIZES = ((720, 576), (1920, 1080), (3840, 2160))
MARGIN = 20  # px at 1920x1080, of a window around its band
POSTURE = np.array([0.012, 0.0, 0.5])
COLD = 96 << 20  # bytes: more than the caches hold
EXPECTATION = StatePrediction(POSTURE, np.array([2e-3, 0.1, 0.1]))


def twin_image() -> Image:
    """Render the instrument near the camera, before procedural draw_mucosa."""
    twin = Twin(load_config())
    image, sample = None, twin.reset()
    while sample.time < 2.0:
        sample = twin.step(POSTURE)
        image = image if sample.frame is None else sample.frame.image
    assert image is not None
    return image


def colon_image(rendered: Image) -> Image | None:
    """Return the instrument before a real colon frame, if the shared data exist."""
    files = sorted((DATA / "colon_frames").glob("*.jpg"))
    if not files:
        return None
    real = cv2.resize(cv2.imread(str(files[1])), (rendered.shape[1], rendered.shape[0]))
    green = rendered.astype(int) @ np.array([-1, 2, -1]) > 0
    band = cv2.dilate(green.astype(np.uint8), np.ones((5, 5))) > 0
    real[band] = rendered[band]
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


def time_calls(
    calls: dict[str, Callable[[], object]], repeats: int, prepare: Callable[[], object]
) -> dict[str, list[float]]:
    """Return the seconds of each call, in turn, each after an untimed call and `prepare`."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            call()
            prepare()
            start = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - start)
    return times


def cache_warmer(image: Image) -> Callable[[], object]:
    """Return a function that reads a frame into the cache; after OpenCV, one read is not enough."""
    return lambda: [image.max() for _ in range(4)]


def time_all(image: Image, repeats: int, visp: peers.Visp) -> dict[str, float]:
    """Return the median time of each detector [ms; windows and ViSP: us]."""
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
        "opencv_textbook_ms": lambda: peers.opencv_textbook(image, config),
        "contours": lambda: peers.opencv_contours(image, config),
        "components": lambda: peers.opencv_components(image, config),
        "planes": lambda: peers.opencv_planes(image, config),
    }
    if peers.HAS_SCIKIT_IMAGE:
        calls["scikit_image_ms"] = lambda: peers.scikit_image(image, config)
    if size == SIZES[0]:
        # Only this is the image size of the configured camera.
        calls["recognised_ms"] = lambda: detector.detect(image, expectation=EXPECTATION)
        assert detector.detect(image, expectation=EXPECTATION).valid
    times = time_calls(calls, repeats, cache_warmer(flat))
    cold = time_calls(calls, repeats, np.ones(COLD >> 3).max)
    repeated = time_calls({"windows": calls["windows_us"]}, repeats, lambda: None)["windows"]
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
    if peers.HAS_SCIKIT_IMAGE:
        figures["scikit_image_ms"] = middle["scikit_image_ms"]
    one_blob = visp.microseconds(image, regions, repeats)
    if one_blob is not None:
        figures["visp_one_blob_us"] = one_blob
    return figures


def time_worst_frames(repeats: int) -> dict[str, float]:
    """Return the time at 1920x1080 of frames without parts that the scan can skip [ms]."""
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
            times = time_calls(call, max(5, repeats // 5), cache_warmer(frame))
            worst[f"{name}, {smoothing} passes"] = 1e3 * statistics.median(times[name])
    return worst
