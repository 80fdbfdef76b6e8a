"""The simulated rig of `tautscope bench`: the twin behind a bus and a camera, in real time.

    with Bench(config) as bench: bench.request("freeze rotation")

Another process drives it through a CAN bus or a serial line, and a socket of images.
"""

import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tautscope.bench.any_motors import make_motors
from tautscope.bench.camera import CameraStream, Centreline
from tautscope.bench.events import Event
from tautscope.bench.ground_truth import GroundTruthWriter
from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.hardware.motor_rig import require_drives
from tautscope.twin.plant import Plant

CAMERA = "camera"


class Bench:
    """Three simulated motors on a bus or line that move the twin's plant, and the twin's camera.

    A ``twin.seed`` gives the same instrument as in `tautscope.twin.Twin`. The plant advances by one
    ``control.period`` with every SYNC; motors on a serial line also advance it when nobody commands
    them.

    Args:
        config: ``camera.source.url`` is ``unix:PATH``, the socket of the images.
        truth: CSV file for the true tip state at every step of the plant, for evaluation only.
        modes: Supported modes of operation of CiA 402 drives.

    Raises:
        ConfigError: The configuration does not describe a bench, or a socket cannot be made.
        OutputError: `truth` cannot be written.
    """

    def __init__(
        self, config: Config, truth: Path | None = None, *, modes: tuple[int, ...] = (7, 8)
    ) -> None:
        drives = require_drives(config)
        url = config.camera.source.url
        if not url.startswith("unix:"):
            raise ConfigError("camera.source.url", url, "unix:PATH, on the bench")
        seed = np.random.SeedSequence(config.twin.seed)
        physics, timing = (np.random.default_rng(child) for child in seed.spawn(2))
        self._plant = Plant(config, physics)
        self._lock = threading.Lock()
        self._camera = CameraStream(config, url.removeprefix("unix:"), self._centreline, timing)
        self._resources = ExitStack()
        self._truth: GroundTruthWriter | None = None
        try:
            if truth is not None:
                self._truth = self._resources.enter_context(GroundTruthWriter(truth))
            self.drives = make_motors(
                drives, self._resources, self._on_sync, start=self._plant.applied, modes=modes
            )
        except BaseException:
            self._resources.close()
            raise

    def request(self, line: str) -> None:
        """Inject a fault: ``freeze rotation``, ``drop camera``, ``clear camera``.

        Raises:
            ConfigError: There is no such fault or part.
        """
        kind, _, part = line.partition(" ")
        if part == CAMERA:
            self._camera.inject(kind)
            self.drives.log_event(CAMERA, f"fault: {kind}")
        else:
            self.drives.request(line, others=(CAMERA,))

    @property
    def events(self) -> list[Event]:
        """Events of drives and camera, in order."""
        return self.drives.events

    def __enter__(self) -> Self:
        try:
            self._resources.enter_context(self._camera)
            self._resources.enter_context(self.drives)
        except BaseException:
            self._resources.close()
            raise
        return self

    def __exit__(self, *failure: object) -> None:
        self._resources.close()

    def _centreline(self) -> Centreline:
        with self._lock:
            return self._plant.centreline()

    def _on_sync(self, demand: NDArray[np.float64]) -> NDArray[np.float64]:
        now = time.monotonic()
        with self._lock:
            plant = self._plant
            if self._truth is not None:
                self._truth.add(now, plant.true_state)
            if self._camera.is_due:
                self._camera.capture(now, plant.centreline())
            plant.step(demand)
            return plant.applied
