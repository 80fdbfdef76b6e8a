"""The simulated rig: plant and camera behind the `Rig` interface."""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config, check_config
from tautscope.errors import SignalError
from tautscope.loop.rig import Frame, Sample
from tautscope.twin.camera import RenderedImage, TwinCamera
from tautscope.twin.plant import Plant
from tautscope.twin.sensor import Centreline, Readout


class Twin:
    """A robotic endoscopic instrument simulated in MuJoCo, with rendered images; implements `Rig`.

    Friction and elasticity cause the hysteresis. The simulation uses no model of the loop (`Play`,
    `Compensator`, `Instrument`, `Camera`). The same seed gives the same bytes.

    Args:
        config: The rig's geometry and `config.twin`.
        images: Whether frames are rendered; without frames the twin is several times faster.

    Wrong when inertia matters (inertias are raised for the time step, see `twin/mjcf.py`), when
    scope or tissue move, or when the instrument touches tissue.
    """

    def __init__(self, config: Config, *, images: bool = True) -> None:
        self.config = check_config(config)
        self.control_period = config.control.period
        self.has_images = images
        self._camera = TwinCamera(config) if images else None
        self._plant: Plant | None = None
        self._ticks = 0

    def __repr__(self) -> str:
        clock = "closed" if self._plant is None else f"at {self.time:.3f} s"
        images = f"{self.config.twin.frame_rate:g} images/s" if self.has_images else "no images"
        return f"<Twin: seed {self.config.twin.seed}, {images}, {clock}>"

    @property
    def time(self) -> float:
        """Time of its clock [s]."""
        return self._ticks * self.control_period

    @property
    def plant(self) -> Plant:
        """The plant, for inspection and faults; a `SignalError` before `reset` or after `close`."""
        if self._plant is None:
            raise SignalError("rig", "closed", "a twin after reset() and before close()")
        return self._plant

    @property
    def bends(self) -> float:
        """Number of bends of the scope; may be set during a run.

        Raises:
            ConfigError: The value is outside the range of `twin.bends`.
        """
        return self.plant.bends

    @bends.setter
    def bends(self, value: float) -> None:
        self.plant.bends = self.config.replace(**{"twin.bends": value}).twin.bends

    def reset(self) -> Sample:
        """Start with a new instrument, settled in the start posture, at time 0."""
        seed = np.random.SeedSequence(self.config.twin.seed)
        physics, timing = (np.random.default_rng(child) for child in seed.spawn(2))
        self._plant = Plant(self.config, physics)
        self._timing = timing
        self._ticks = 0
        self._sequence = 0
        self._in_transit: deque[tuple[float, Frame]] = deque()
        self._readout = Readout(self.config.twin.sensor.readout)
        if self._camera is not None:
            self._camera.reset()
        return self._sample(self._plant)

    def step(self, command: ArrayLike) -> Sample:
        """Send command (3,) [m, rad, rad] and let one control period pass.

        Raises:
            SignalError: The command is not three finite numbers.
        """
        plant = self.plant
        target = np.asarray(command, dtype=np.float64)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise SignalError("command", command, "three finite numbers [m, rad, rad]")
        plant.step(target)
        self._ticks += 1
        return self._sample(plant)

    def close(self) -> None:
        """Release the simulation; `reset` starts a new one."""
        self._plant = None

    def _sample(self, plant: Plant) -> Sample:
        time, state = self.time, plant.true_state
        if self._camera is not None:
            self._capture(self._camera, plant, time)
        return Sample(time, plant.applied, self._newest_frame(time), state)

    def _capture(self, camera: TwinCamera, plant: Plant, time: float) -> None:
        twin, readout = self.config.twin, self.config.twin.sensor.readout
        if readout > 0:
            self._readout.add(time, plant.centreline())
        # Half a tick of tolerance: n / frame_rate and n * period differ in the last digits.
        if time + self.control_period / 2 < self._sequence / twin.frame_rate:
            return
        strips = self._readout.strips() if readout > 0 else [plant.centreline()]
        stamp = time - readout / 2 + twin.sensor.stamp_error - self.config.camera.source.delay
        delay = twin.latency + twin.latency_jitter * self._timing.uniform(-1, 1)
        self._draw(camera, strips, stamp, time + delay)
        self._sequence += 1

    def _draw(
        self, camera: TwinCamera, strips: list[Centreline], stamp: float, arrival: float
    ) -> None:
        self._send(camera.draw_strips(strips, self._sequence), self._sequence, stamp, arrival)

    def _send(self, drawn: RenderedImage, sequence: int, stamp: float, arrival: float) -> None:
        """Put a rendered image in transit."""
        frame = Frame(drawn.image, stamp, sequence, drawn.true_features, drawn.true_visible)
        self._in_transit.append((arrival, frame))

    def _newest_frame(self, time: float) -> Frame | None:
        newest = None
        while self._in_transit and self._in_transit[0][0] <= time:
            newest = self._in_transit.popleft()[1]
        return newest
