"""Recordings whose process is killed."""

import mmap
import os
import struct
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tautscope import Config, Frame, HysteresisReduction, Report, Sample, Twin, load_config
from tautscope.log.export import recover
from tautscope.log.reader import Tick, Update, read_log
from tautscope.log.writer import LogWriter

PERIOD = 0.01
"""Control period of the recording process [s]."""
IMAGE_TICKS = 4
"""Control periods per image."""
LOST_AT_MOST = 0.1
"""Goal of the ticks lost at the end [s]."""
_SENT = struct.Struct("<qd")
"""Number of recorded ticks, and the time of the last one [s]."""


@dataclass(frozen=True)
class Loss:
    """What a killed recording lost.

    Attributes:
        duration: How long it recorded [s].
        ticks: Time of the ticks that are lost at the end [s].
        images: Time from the last image in the log to the kill, minus the image period [s].
        holes: Number of ticks or updates that are missing before the end.
        is_readable: Whether rosbags reads every message after `recover`.
    """

    duration: float
    ticks: float
    images: float
    holes: int
    is_readable: bool

    @property
    def is_failure(self) -> bool:
        """Whether the goal is missed."""
        return not self.is_readable or self.holes > 0 or self.ticks > LOST_AT_MOST


@dataclass(frozen=True)
class Scene:
    """Data that the process records repeatedly."""

    config: Config
    sample: Sample
    images: list[NDArray[np.uint8]]
    report: Report


def make_scene() -> Scene:
    """Return the first frame of the twin with several noise patterns, and the loop's report."""
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


def record_forever(log_file: Path, sent_file: Path, scene: Scene) -> None:
    """Record until the process is killed."""
    applied = scene.sample.applied
    with sent_file.open("r+b") as file, LogWriter(log_file, scene.config) as log:
        sent = mmap.mmap(file.fileno(), _SENT.size)
        begin, tick = time.monotonic(), 0
        while True:
            now = time.monotonic() - begin
            log.tick(Sample(now, applied), applied, applied)
            if tick % IMAGE_TICKS == 0:
                frame = Frame(scene.images[tick // IMAGE_TICKS % 8], now, tick // IMAGE_TICKS)
                log.frame(now, frame, scene.report)
            tick += 1
            sent[:] = _SENT.pack(tick, now)
            time.sleep(max(begin + tick * PERIOD - time.monotonic(), 0))


def kill_one(folder: Path, lifetime: float, scene: Scene) -> Loss:
    """Start a recording, kill it `lifetime` after its first tick, and return what was lost."""
    log_file, sent_file = folder / "run.mcap", folder / "sent"
    sent_file.write_bytes(bytes(_SENT.size))
    # A fork server with all modules loaded saves the imports in every process.
    context = get_context("forkserver")
    modules = ["tautscope.twin", "tautscope.log.writer", "tautscope.loop.vision"]
    context.set_forkserver_preload(modules)
    child = context.Process(target=record_forever, args=(log_file, sent_file, scene))
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
    assert ticks > 0
    return loss_of(log_file, last)


def loss_of(log_file: Path, last: float) -> Loss:
    """Return what a log lost that recorded until `last` [s]: all if it cannot be read."""
    repaired = log_file.with_name("repaired.mcap")
    try:
        recover(log_file, repaired)
        log = read_log(repaired)
        _read_with_rosbags(repaired)
    except Exception as error:  # also of rosbags, which has no common one
        print(f"not readable: {error!r}", file=sys.stderr, flush=True)
        return Loss(last, ticks=last, images=last, holes=0, is_readable=False)
    times = [event.sample.time for event in log.events.values() if isinstance(event, Tick)]
    image_times = [
        float(event.row[0])  # type: ignore[arg-type]
        for index, event in log.events.items()
        if isinstance(event, Update) and log.has_image(index)
    ]
    return Loss(
        duration=last,
        ticks=last - max(times, default=0.0),
        images=max(last - max(image_times, default=0.0) - IMAGE_TICKS * PERIOD, 0.0),
        holes=log.missing,
        is_readable=True,
    )


def _read_with_rosbags(path: Path) -> None:
    from rosbags.highlevel import AnyReader  # noqa: PLC0415

    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def kills(count: int) -> dict[str, object]:
    """Kill recordings at random times, and summarise what was lost."""
    rng = np.random.default_rng(0)
    losses, scene = [], make_scene()
    for number in range(count):
        with tempfile.TemporaryDirectory() as folder:
            losses.append(kill_one(Path(folder), float(rng.uniform(0.05, 3.0)), scene))
        if number % 10 == 9:
            print(f"{number + 1} of {count} killed", file=sys.stderr, flush=True)
    lost = np.array([loss.ticks for loss in losses])
    images = np.array([loss.images for loss in losses])
    return {
        "kills": count,
        "readable": sum(loss.is_readable for loss in losses),
        "failed": sum(loss.is_failure for loss in losses),
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
