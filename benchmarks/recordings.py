"""Recordings: killed while written, replayed, and what lossy images would do to the vision.

``--kills 100``: a process that records at 100 Hz with 25 images per second, killed with SIGKILL at
random times; what was sent and is not in the log. ``--replays 50``: runs of the twin, replayed.
``--images 300``: formats of images; segmentation with and without.
"""

from __future__ import annotations

import argparse
import json
import mmap
import os
import struct
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import zstandard
from numpy.typing import NDArray
from tautscope import (
    Config,
    Frame,
    HysteresisReduction,
    MarkerDetector,
    Report,
    Sample,
    Twin,
    load_config,
)
from tautscope.dof import Dof
from tautscope.log.export import recover
from tautscope.log.reader import Tick, Update, read_log
from tautscope.log.replay import replay_same
from tautscope.log.writer import LogWriter
from tautscope.runs.experiment import run_experiment

PERIOD = 0.01
"""Of the killed process's ticks [s]."""
EVERY = 4
"""Ticks per image."""
_SENT = struct.Struct("<qd")
"""Ticks sent, and the time of the last [s]."""


@dataclass(frozen=True)
class Sway:
    """All three DOFs at once, in a fifth of the article's time."""

    config: Config
    duration: float
    segments: tuple[()] = ()

    def __call__(self, time: float) -> NDArray[np.float64]:
        """(3,) [m, rad, rad]."""
        sines = [self.config.experiment[dof] for dof in Dof]
        return np.array(
            [
                sine.centre + sine.amplitude * np.sin(2 * np.pi * time / period)
                for sine, period in zip(sines, (2.0, 3.1, 2.3), strict=True)
            ]
        )


@dataclass(frozen=True)
class Loss:
    """One killed recording.

    Attributes:
        lived: How long it was written [s].
        ticks: Lost at the end [s].
        images: From the last image in the log to the kill, less the 0.04 s between images [s].
        holes: Ticks or updates missing before the end.
        is_readable: Whether rosbags reads every message after `recover`.
    """

    lived: float
    ticks: float
    images: float
    holes: int
    is_readable: bool


@dataclass(frozen=True)
class Scene:
    """What the killed process sends again and again."""

    config: Config
    sample: Sample
    images: list[NDArray[np.uint8]]
    report: Report


def scene() -> Scene:
    """The first frame of the twin, with fresh noise each time, and the loop's report on it."""
    config = load_config()
    twin, loop = Twin(config), HysteresisReduction(config)
    sample = twin.reset()
    while sample.frame is None:
        loop.step(sample.applied, sample.time)
        sample = twin.step(sample.applied)
    loop.step(sample.applied, sample.time)
    report, image = loop.on_frame(sample.frame), sample.frame.image
    noise = np.random.default_rng(0)
    images = [np.clip(image + noise.normal(0, 2, image.shape), 0, 255) for _ in range(8)]
    sample = replace(sample, frame=None)
    return Scene(config, sample, [each.astype(np.uint8) for each in images], report)


def write_for_ever(log_file: Path, sent_file: Path, scene: Scene) -> None:
    """The process to be killed."""
    applied = scene.sample.applied
    with sent_file.open("r+b") as file, LogWriter(log_file, scene.config) as log:
        sent = mmap.mmap(file.fileno(), _SENT.size)
        begin, tick = time.monotonic(), 0
        while True:
            now = time.monotonic() - begin
            log.tick(Sample(now, applied), applied, applied)
            if tick % EVERY == 0:
                frame = Frame(scene.images[tick // EVERY % 8], now, tick // EVERY)
                log.frame(now, frame, scene.report)
            tick += 1
            sent[:] = _SENT.pack(tick, now)
            time.sleep(max(begin + tick * PERIOD - time.monotonic(), 0))


def kill_one(folder: Path, lifetime: float, scene: Scene) -> Loss:
    """Start a recording, kill it `lifetime` after its first tick, and see what is left."""
    log_file, sent_file, mended = (folder / name for name in ("run.mcap", "sent", "mended.mcap"))
    sent_file.write_bytes(bytes(_SENT.size))
    # A server that has all modules loaded: a process each would spend its time on imports.
    context = get_context("forkserver")
    modules = ["tautscope.twin", "tautscope.log.writer", "tautscope.loop.vision"]
    context.set_forkserver_preload(modules)
    child = context.Process(target=write_for_ever, args=(log_file, sent_file, scene))
    child.start()
    try:
        while _SENT.unpack(sent_file.read_bytes())[0] == 0:
            if not child.is_alive():
                raise RuntimeError(f"the recording process ended with {child.exitcode}")
            time.sleep(0.01)
        time.sleep(lifetime)
    finally:
        child.kill()
        child.join()
    ticks, last = _SENT.unpack(sent_file.read_bytes())
    recover(log_file, mended)
    log = read_log(mended)
    times = [event.sample.time for event in log.events.values() if isinstance(event, Tick)]
    seen = [
        float(event.row[0])  # type: ignore[arg-type]
        for index, event in log.events.items()
        if isinstance(event, Update) and log.has_image(index)
    ]
    assert ticks > 0
    return Loss(
        lived=last,
        ticks=last - max(times, default=0.0),
        images=max(last - max(seen, default=0.0) - EVERY * PERIOD, 0.0),
        holes=log.missing,
        is_readable=_rosbags_reads(mended),
    )


def _rosbags_reads(path: Path) -> bool:
    from rosbags.highlevel import AnyReader  # noqa: PLC0415

    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    return True


def kills(count: int) -> dict[str, object]:
    """Kill `count` recordings at random times."""
    rng = np.random.default_rng(0)
    losses, sent = [], scene()
    for number in range(count):
        with tempfile.TemporaryDirectory() as folder:
            losses.append(kill_one(Path(folder), float(rng.uniform(0.05, 3.0)), sent))
        if number % 10 == 9:
            print(f"{number + 1} of {count} killed", file=sys.stderr, flush=True)
    lost = np.array([loss.ticks for loss in losses])
    images = np.array([loss.images for loss in losses])
    return {
        "kills": count,
        "readable": sum(loss.is_readable for loss in losses),
        "with_holes": sum(loss.holes > 0 for loss in losses),
        "lost_median_s": round(float(np.median(lost)), 3),
        "lost_p99_s": round(float(np.quantile(lost, 0.99)), 3),
        "lost_max_s": round(float(lost.max()), 3),
        "lost_over_0.3_s": int(np.sum(lost > 0.3)),
        "images_lost_median_s": round(float(np.median(images)), 3),
        "images_lost_max_s": round(float(images.max()), 3),
        "images_lost_over_0.3_s": int(np.sum(images > 0.3)),
        "load_average": os.getloadavg()[0],
    }


def replays(count: int, seconds: float) -> dict[str, object]:
    """Record and replay `count` runs of the twin, a seed each, both profiles in turn."""
    same = ticks = updates = 0
    for seed in range(count):
        config = load_config(profile="best" if seed % 2 else "paper").replace(
            **{"twin.seed": seed, "twin.disturb": ["debris"] if seed % 3 == 0 else []}
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.mcap"
            with LogWriter(path, config, wait=True) as writer:
                run_experiment(Twin(config), Sway(config, seconds), config, log=writer)
            found, _ = replay_same(read_log(path))
        same += found.is_identical and not found.ended
        ticks, updates = ticks + found.ticks, updates + found.updates
        if seed % 10 == 9:
            print(f"{seed + 1} of {count} replayed", file=sys.stderr, flush=True)
    return {"replays": count, "identical": same, "ticks": ticks, "updates": updates}


def images(count: int) -> list[dict[str, object]]:
    """What each format makes of `count` frames of the twin."""
    config = load_config()
    twin, sway = Twin(config), Sway(config, 1e9)
    frames: list[Frame] = []
    sample = twin.reset()
    while len(frames) < count:
        sample = twin.step(sway(sample.time))
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
        # As the log's chunks are compressed; it costs little where there is nothing to gain.
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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=0, metavar="N")
    parser.add_argument("--replays", type=int, default=0, metavar="N")
    parser.add_argument("--images", type=int, default=0, metavar="N")
    parser.add_argument("--seconds", type=float, default=5.0, help="of a replayed run")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.images:
        for row in images(arguments.images):
            print(json.dumps(row), flush=True)
    if arguments.replays:
        print(json.dumps(replays(arguments.replays, arguments.seconds)), flush=True)
    if arguments.kills:
        print(json.dumps(kills(arguments.kills)), flush=True)


if __name__ == "__main__":
    main()
