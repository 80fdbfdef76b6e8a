"""Simulated instruments with other hystereses than the twin's, as rigs without images."""

from collections.abc import Callable

import numpy as np
from common.features import FeatureCamera
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.rig import Sample

Floats = NDArray[np.float64]
HALF = np.array([5e-3, 0.9, 0.55])
"""Half widths: those of the article's Table 1 [m, rad, rad]."""
GAIN = 0.8
SHARES = np.linspace(0.25, 1.5, 6)[:, None]
"""Half widths of the parallel plays of a rounded loop, over `HALF`."""
CHANGE, CHANGE_PERIOD = 0.5, 40.0
"""Largest change of the width, as a share of it, and its period [s]."""


class PlantRig:
    """A rig whose tip is a function of plays per DOF; its camera delivers noisy features.

    Offsets and tip are counted from the centres of the article's references.
    """

    def __init__(self, config: Config, plant: str) -> None:
        self.control_period = config.control.period
        self._make, self._config = PLANTS[plant], config
        self._centre = np.array([config.experiment[dof].centre for dof in Dof])
        self.reset()

    def reset(self) -> Sample:
        """Go to the centre of the references."""
        self._ticks, self._camera, self._plant = 0, FeatureCamera(self._config), self._make()
        return self._sample(self._centre)

    def step(self, command: ArrayLike) -> Sample:
        """Move, and let one control period pass."""
        self._ticks += 1
        return self._sample(np.asarray(command, dtype=np.float64))

    def close(self) -> None:
        """Do nothing: there are no resources to release."""

    def _sample(self, applied: Floats) -> Sample:
        time = self._ticks * self.control_period
        tip = self._centre + self._plant(applied - self._centre, time)
        sample = Sample(time, applied, None, tip)
        return Sample(time, applied, self._camera.capture(sample), tip)


Plant = Callable[[Floats, float], Floats]
"""Tip (3,) for a command (3,) and a time [s]."""


def plays(delta_minus: Floats, delta_plus: Floats) -> Plant:
    """Plays of Eq. (1) with offsets of any shape (..., 3), whose mean is the tip."""
    outputs = np.zeros(np.shape(delta_plus))

    def step(command: Floats, time: float) -> Floats:
        outputs[:] = np.clip(outputs, command - delta_plus, command - delta_minus)
        return np.asarray(outputs.reshape(-1, 3).mean(axis=0))

    return step


def independent() -> Plant:
    """A play per DOF."""
    return plays(-HALF, HALF)


def scaled() -> Plant:
    """A play per DOF, of whose motion the tip makes 80 %."""
    inner = plays(-HALF, HALF)
    return lambda command, time: GAIN * inner(command, time)


def asymmetric() -> Plant:
    """A play per DOF with offsets of -0.6 and 1.4 half widths."""
    return plays(-0.6 * HALF, 1.4 * HALF)


def rounded() -> Plant:
    """Mean of six parallel plays per DOF (Maxwell slip): the loop has no sharp corner."""
    return plays(-SHARES * HALF, SHARES * HALF)


def changing() -> Plant:
    """A play per DOF whose width changes by 50 % up and down within 40 s."""
    output = np.zeros(3)

    def step(command: Floats, time: float) -> Floats:
        half = HALF * (1 + CHANGE * np.sin(2 * np.pi * time / CHANGE_PERIOD))
        output[:] = np.clip(output, command - half, command + half)
        return output.copy()

    return step


PLANTS: dict[str, Callable[[], Plant]] = {
    "independent plays": independent,
    "gain 0.8": scaled,
    "asymmetric loops": asymmetric,
    "rounded loops": rounded,
    "width +-50 % in 40 s": changing,
}
