"""Recorded runs that are replayed, and image formats for recordings."""

import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import zstandard
from hysteresis.simulation import Sines
from tautscope import Frame, MarkerDetector, Twin, load_config
from tautscope.dof import Dof
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.log.writer import LogWriter
from tautscope.runs.experiment import run_experiment

PERIODS = tuple(zip(Dof, (2.0, 3.1, 2.3), strict=True))
"""Periods of the reference, a fifth of those in the article [s]."""


def replays(count: int, seconds: float) -> dict[str, object]:
    """Record and replay runs of the twin, one seed each, alternating between the profiles."""
    identical = ticks = updates = 0
    for seed in range(count):
        config = load_config(profile="best" if seed % 2 else "paper").replace(
            **{"twin.seed": seed, "twin.disturb": ["debris"] if seed % 3 == 0 else []}
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.mcap"
            with LogWriter(path, config, wait=True) as writer:
                run_experiment(
                    Twin(config), Sines(config.experiment, PERIODS, seconds), config, log=writer
                )
            found, _ = replay_same(read_log(path))
        identical += found.is_identical and not found.ended
        ticks, updates = ticks + found.ticks, updates + found.updates
        if seed % 10 == 9:
            print(f"{seed + 1} of {count} replayed", file=sys.stderr, flush=True)
    return {"replays": count, "identical": identical, "ticks": ticks, "updates": updates}


def images(count: int) -> list[dict[str, object]]:
    """Compare image formats on frames of the twin: size, time, and change of the detection."""
    config = load_config()
    twin, motion = Twin(config), Sines(config.experiment, PERIODS, np.inf)
    frames: list[Frame] = []
    sample = twin.reset()
    while len(frames) < count:
        sample = twin.step(motion(sample.time))
        if sample.frame is not None:
            frames.append(sample.frame)
    detector = MarkerDetector(config)
    plain = [detector.detect(frame.image, frame.true_features) for frame in frames]
    up = (cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP)
    huffman = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY)
    stored = (cv2.IMWRITE_PNG_COMPRESSION, 0, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB)
    full = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
    formats: list[tuple[str, str, tuple[int, ...]]] = [
        ("png, OpenCV's default", ".png", ()),
        ("png, filter up, Huffman only", ".png", (cv2.IMWRITE_PNG_COMPRESSION, 1, *up, *huffman)),
        ("png, filter sub, stored; zstd 1", ".png", stored),
        *((f"jpeg {q}", ".jpg", (cv2.IMWRITE_JPEG_QUALITY, q)) for q in (80, 90, 95, 98, 100)),
        *((f"jpeg {q}, 4:4:4", ".jpg", (cv2.IMWRITE_JPEG_QUALITY, q, *full)) for q in (95, 100)),
    ]
    rows: list[dict[str, object]] = []
    compressor = zstandard.ZstdCompressor(level=1)
    for name, suffix, options in formats:
        begin = time.thread_time()
        coded = [cv2.imencode(suffix, frame.image, options)[1] for frame in frames]
        # The chunks of a log are compressed too; this costs little where nothing is gained.
        packed = [compressor.compress(data.tobytes()) for data in coded]
        spent = (time.thread_time() - begin) / count
        changed, shifts = 0, []
        for frame, data, before in zip(frames, coded, plain, strict=True):
            after = detector.detect(cv2.imdecode(data, cv2.IMREAD_COLOR), frame.true_features)
            changed += after.found != before.found
            if after.valid and before.valid:
                shifts.append(after.features - before.features)
        shift = np.array(shifts)
        rows.append(
            {
                "format": name,
                "kilobytes": round(float(np.mean([len(data) for data in packed])) / 1e3),
                "milliseconds": round(1e3 * spent, 1),
                "changed_verdicts": changed,
                "shift_rms_px": round(float(np.sqrt(np.mean(shift**2))), 3),
                "shift_max_px": round(float(np.abs(shift).max()), 3),
            }
        )
    return rows
