"""The simulated instrument in real time, with images rendered in the background."""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.console.paced_rig import Pace
from tautscope.hardware.realtime import OTHERS, realtime_executor
from tautscope.loop.rig import Frame, Sample
from tautscope.twin.camera import RenderedImage, TwinCamera
from tautscope.twin.plant import Plant
from tautscope.twin.rig import Twin


class LiveTwin(Twin):
    """The twin at the pace of the monotonic clock, with a second one to compare with.

    A tick that wakes late does not catch up: the rig's clock stands meanwhile. An image that is due
    while another is rendered is dropped.

    Args:
        config: The rig's geometry and `config.twin`.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._renderer = realtime_executor("rendering", OTHERS)
        self._rendering: tuple[Future[RenderedImage], int, float, float] | None = None
        self._pace = Pace(self.control_period)
        self.dropped_images = 0

    def reset(self) -> Sample:
        """As `Twin.reset`; its clock starts."""
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
        """Release the simulation and the renderer."""
        self._renderer.shutdown()
        super().close()

    def _capture(self, camera: TwinCamera, plant: Plant, time: float) -> None:
        twin, readout = self.config.twin, self.config.twin.sensor.readout
        if readout > 0:
            self._readout.add(time, plant.centreline())
        self._collect()
        if time + self.control_period / 2 < self._sequence / twin.frame_rate:
            return
        if self._rendering is None:
            strips = self._readout.strips() if readout > 0 else [plant.centreline()]
            image = self._renderer.submit(camera.draw_strips, strips, self._sequence)
            delay = twin.latency + twin.latency_jitter * self._timing.uniform(-1, 1)
            stamp = time - readout / 2 + twin.sensor.stamp_error
            self._rendering = image, self._sequence, stamp, time + delay
        else:
            self.dropped_images += 1
        self._sequence += 1

    def _collect(self) -> None:
        """Put the image that has been rendered in transit."""
        if self._rendering is None or not self._rendering[0].done():
            return
        (image, sequence, stamp, arrival), self._rendering = self._rendering, None
        rendered = image.result()
        truth = rendered.true_features, rendered.true_visible
        self._in_transit.append((arrival, Frame(rendered.image, stamp, sequence, *truth)))
