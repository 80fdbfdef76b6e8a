"""Images and what is drawn over them, from the control loop to the web server."""

import logging
import shutil
import threading
import time
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

import numpy as np

from tautscope.calibration.images import Image
from tautscope.config import Config
from tautscope.console.shared import ImageChannel, Overlay
from tautscope.console.state import LogState
from tautscope.hardware.realtime import OTHERS, set_realtime_priority
from tautscope.loop.construction import build_feature_model
from tautscope.loop.kinematics import Floats

_LOG = logging.getLogger(__name__)
_LOG_PERIOD = 1.0
"""Time between two looks at the size of the log and at the free disk [s]."""


@dataclass(frozen=True, eq=False)
class Bands:
    """States of an image of the bands, each (3,) [m, rad, rad].

    ``uncompensated`` is the tip without compensation; ``found`` says which bands were found.
    """

    estimate: Floats
    predicted: Floats
    reference: Floats
    uncompensated: Floats
    found: tuple[bool, bool]


class Publisher:
    """Copies images into shared memory in a thread of its own; only the newest is kept.

    Attributes:
        log: Size of the log and remaining time, renewed each second.
        log_path: The log; None before there is one.
        image: The newest image.
        failure: Why the newest image is not shown; empty if it is.
    """

    def __init__(self, config: Config, channel: ImageChannel) -> None:
        self._model = build_feature_model(config)
        self._size = config.camera.width, config.camera.height
        self._channel = channel
        self._next: tuple[Image, Overlay, Bands | None] | None = None
        self.image: Image | None = None
        self.failure = ""
        self._wake = threading.Event()
        self._is_closing = False
        self.log = LogState()
        self.log_path: Path | None = None
        self._watched: tuple[Path, float, int] | None = None
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._thread.start()

    def submit(
        self, sequence: int, image: Image, arrived_at: float, bands: Bands | None = None
    ) -> None:
        """Show an image, in place of one that still waits.

        Args:
            sequence: Of the image, as in `tautscope.console.lease.ImageTimes`.
            image: The image.
            arrived_at: When the control loop got it [s, monotonic clock].
            bands: What is drawn over it; None where nothing is.
        """
        self._next = image, Overlay(sequence, arrived_at, *self._size), bands
        self.image = image
        self._wake.set()

    def close(self) -> None:
        """End the thread."""
        self._is_closing = True
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        set_realtime_priority(OTHERS)
        checked = 0.0
        while not self._is_closing:
            self._wake.wait(_LOG_PERIOD)
            self._wake.clear()
            update, self._next = self._next, None
            if update is not None:
                self._show(*update)
            if time.monotonic() - checked >= _LOG_PERIOD:
                checked = time.monotonic()
                self._check_log(checked)

    def _show(self, image: Image, overlay: Overlay, bands: Bands | None) -> None:
        try:
            if bands is not None:
                self._add_bands(overlay, bands)
            self._channel.write(image, overlay)
        except Exception as error:  # the next one may be shown
            failure = f"No image is shown: {type(error).__name__}: {error}"
            if failure != self.failure:
                _LOG.warning("%s", failure)
            self.failure = failure
        else:
            self.failure = ""

    def _add_bands(self, overlay: Overlay, bands: Bands) -> None:
        overlay.measured = list(compress(self._outlines(bands.estimate), bands.found))
        overlay.predicted = self._outlines(bands.predicted)
        overlay.tip = self._tip(bands.estimate)
        overlay.target = self._tip(bands.reference)
        overlay.uncompensated = self._outlines(bands.uncompensated)
        overlay.uncompensated_tip = self._tip(bands.uncompensated)

    def _outlines(self, state: Floats) -> list[list[tuple[float, float]]]:
        bands = self._model.bands(state) if np.isfinite(state).all() else None
        if bands is None:
            return []
        return [[(round(u, 1), round(v, 1)) for u, v in band[3].tolist()] for band in bands]

    def _tip(self, state: Floats) -> tuple[float, float] | None:
        found = self._model.predict(state) if np.isfinite(state).all() else None
        if found is None:
            return None
        _, _, u, v = found[0].tolist()
        return round(u, 1), round(v, 1)

    def _check_log(self, now: float) -> None:
        if (path := self.log_path) is None:
            return
        try:
            size, free = path.stat().st_size, shutil.disk_usage(path).free
        except OSError:
            return
        if self._watched is None or self._watched[0] != path:
            self._watched = path, now, size
        _, since, before = self._watched
        grown = size - before
        remaining = free * (now - since) / grown if grown > 0 else None
        self.log = LogState(str(path), size, remaining)
