"""The simulated instrument in real time, with images rendered in the background."""

from concurrent.futures import Future

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.console.paced_rig import Pace
from tautscope.hardware.realtime import OTHERS, realtime_executor
from tautscope.loop.rig import Sample
from tautscope.twin.camera import RenderedImage, TwinCamera
from tautscope.twin.plant import Plant
from tautscope.twin.rig import Twin
from tautscope.twin.sensor import Centreline


class LiveTwin(Twin):
    """The twin at the pace of the monotonic clock, with a second one to compare with.

    A tick that wakes late does not catch up: the rig's clock stands meanwhile. An image that is due
    while another is rendered is dropped.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._renderer = realtime_executor("rendering", OTHERS)
        self._rendering: tuple[Future[RenderedImage], int, float, float] | None = None
        self._pace = Pace(self.control_period)

    def reset(self) -> Sample:
        """As `Twin.reset`; its clock starts."""
        self._rendering = None  # its time is of the clock before
        sample = super().reset()
        seed = np.random.SeedSequence(self.config.twin.seed).spawn(1)[0]
        self._uncompensated = Plant(self.config, np.random.default_rng(seed))
        self._pace = Pace(self.control_period)
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """As `Twin.step`, and wait for the end of the control period."""
        self._pace.wait()
        return super().step(command)

    def step_uncompensated(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Let a control period pass for the same instrument with the reference as command."""
        self._uncompensated.step(reference)
        return self._uncompensated.true_state

    def close(self) -> None:
        """Release the simulation and the renderer; `reset` starts new ones."""
        self._renderer.shutdown()
        self._renderer = realtime_executor("rendering", OTHERS)  # its thread starts with an image
        super().close()

    def _capture(self, camera: TwinCamera, plant: Plant, time: float) -> None:
        if self._rendering is not None and self._rendering[0].done():
            image, sequence, stamp, arrival = self._rendering
            self._rendering = None
            self._send(image.result(), sequence, stamp, arrival)
        super()._capture(camera, plant, time)

    def _draw(
        self, camera: TwinCamera, strips: list[Centreline], stamp: float, arrival: float
    ) -> None:
        if self._rendering is None:
            image = self._renderer.submit(camera.draw_strips, strips, self._sequence)
            self._rendering = image, self._sequence, stamp, arrival
