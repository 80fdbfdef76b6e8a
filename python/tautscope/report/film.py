"""A film of one motion without and with compensation, side by side, in the twin's camera."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import Image
from tautscope.loop.construction import build_feature_model
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.recording import Floats, Recording, per_dof
from tautscope.twin import Twin
from tautscope.twin.camera import TwinCamera

SECONDS, RATE = 10.0, 10.0
"""Length of the film [s], and its images per second."""
WIDTH = 360
"""Width of each side [px]."""
WHITE, SHADE = (255, 255, 255), (40, 20, 20)
FONT = cv2.FONT_HERSHEY_SIMPLEX


def write_film(place: Path, without: Recording, compensated: Recording) -> None:
    """Write an animated GIF: the tip without (left) and with compensation (right).

    Rings and the line between them are where the reference wants the two bands. The commands of the
    recordings move a new twin, which gives the same motion; its camera is without noise here.
    """
    # Pillow comes with Matplotlib.
    from PIL import Image as Pillow  # noqa: PLC0415

    sides = [
        _images(run, title)
        for run, title in ((without, "without"), (compensated, "with tautscope"))
    ]
    joined = [np.hstack(pair)[:, :, ::-1] for pair in zip(*sides, strict=True)]
    # One palette, so that what rests does not flicker; an octree keeps the few pixels of the bands.
    octree, plain = Pillow.Quantize.FASTOCTREE, Pillow.Dither.NONE
    palette = Pillow.fromarray(np.vstack(joined[::10])).quantize(method=octree)
    first, *others = (
        Pillow.fromarray(image).quantize(palette=palette, dither=plain) for image in joined
    )
    first.save(place, save_all=True, append_images=others, duration=1e3 / RATE, loop=0)


def replayed(run: Recording) -> Iterator[tuple[Twin, Floats]]:
    """Yield a twin that moves as in a run on the twin, and the reference (3,), after each tick."""
    commands, references = (per_dof(run.trace, name) for name in ("command", "reference"))
    rig = Twin(run.config, images=False)
    rig.reset()
    for command, reference in zip(commands, references, strict=True):
        rig.step(command)
        yield rig, reference
    rig.close()


def _images(run: Recording, title: str) -> list[Image]:
    period = run.config.control.period
    every, count = round(1 / RATE / period), round(SECONDS * RATE)
    ticks = len(run.trace)
    first = max(min(round(EVALUATED_AFTER / period), ticks - count * every), 0)
    last = min(first + count * every, ticks)
    model = build_feature_model(run.config)
    camera = TwinCamera(run.config.replace(**{"twin.image_noise": 0.0}))
    return [
        _frame(camera.draw(*rig.plant.centreline(), number).image, model.predict(reference), title)
        for number, (rig, reference) in enumerate(islice(replayed(run), first, last, every))
    ]


def _frame(image: Image, wanted: tuple[NDArray[np.float64], object] | None, title: str) -> Image:
    frame = image.copy()
    if wanted is not None:
        a, b = ((round(u), round(v)) for u, v in wanted[0].reshape(2, 2).tolist())
        for centre in (a, b):
            cv2.circle(frame, centre, 16, WHITE, 2, cv2.LINE_AA)
        cv2.line(frame, a, b, WHITE, 1, cv2.LINE_AA)
    (width, height), _ = cv2.getTextSize(title, FONT, 1.4, 2)
    cv2.rectangle(frame, (0, 0), (width + 40, height + 40), SHADE, cv2.FILLED)
    cv2.putText(frame, title, (20, height + 20), FONT, 1.4, WHITE, 2, cv2.LINE_AA)
    height = round(WIDTH * frame.shape[0] / frame.shape[1])
    small = cv2.resize(frame, (WIDTH, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)
