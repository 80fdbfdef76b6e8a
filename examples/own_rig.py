"""The loop on your own rig: any object with these methods.

This one simulates drives and camera by three plays and a drawn image.
Run it with ``uv run python examples/own_rig.py``.
"""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from tautscope import Config, Frame, Sample, run_experiment
from tautscope.config import ControlConfig, ExperimentConfig, SafetyConfig, Sine
from tautscope.loop.construction import build_feature_model
from tautscope.references import SineSequence
from tautscope.report.results import evaluate

BACKLASH = np.array([10e-3, 1.0, 0.5])
"""Width of each DOF's play [m, rad, rad]."""


class DrawnRig:
    """The tip is a play of the command; the image shows the two bands in green."""

    control_period = 0.01

    def __init__(self, config: Config) -> None:
        experiment = config.experiment
        self._model = build_feature_model(config)
        shape = (config.camera.height, config.camera.width, 3)
        self._tissue = np.full(shape, (60, 60, 150), np.uint8)
        self._home = np.array(
            [experiment.insertion.centre, experiment.rotation.centre, experiment.bending.centre]
        )
        self.reset()

    def reset(self) -> Sample:
        """Go to the centre of the references."""
        self._ticks = 0
        self._tip = self._home.copy()
        return self._sample(self._home)

    def step(self, command: ArrayLike) -> Sample:
        """Move; every eighth sample has an image."""
        applied = np.asarray(command, dtype=np.float64)
        self._tip = np.clip(self._tip, applied - BACKLASH / 2, applied + BACKLASH / 2)
        self._ticks += 1
        return self._sample(applied)

    def close(self) -> None:
        """Do nothing: there are no resources to release."""

    def _sample(self, applied: NDArray[np.float64]) -> Sample:
        time = self._ticks * self.control_period
        frame = Frame(self._draw(), time, self._ticks) if self._ticks % 8 == 0 else None
        return Sample(time, applied, frame, self._tip.copy())

    def _draw(self) -> NDArray[np.uint8]:
        image = self._tissue.copy()
        for *_, outline in self._model.bands(self._tip) or ():
            corners = np.round(16 * outline).astype(np.int32)
            cv2.fillPoly(image, [corners], (60, 190, 60), cv2.LINE_AA, 4)
        return image


def short_experiment() -> Config:
    """The article's protocol, three periods of 4 s."""
    return Config(
        control=ControlConfig(period=DrawnRig.control_period),
        experiment=ExperimentConfig(
            periods=3,
            insertion=Sine(centre=25e-3, amplitude=15e-3, period=4.0),
            rotation=Sine(centre=0.0, amplitude=1.5, period=4.0),
            bending=Sine(centre=1.2, amplitude=0.6, period=4.0),
        ),
        # Drawn images have no noise: they repeat exactly while the tip rests in the backlash.
        safety=SafetyConfig(frozen_travel=1e6),
    )


def main() -> None:
    config = short_experiment()
    runs = []
    for compensate in (False, True):
        rig = DrawnRig(config)
        try:
            reference = SineSequence(config.experiment)
            runs.append(run_experiment(rig, reference, config, compensate))
        finally:
            rig.close()
    for dof, result in evaluate(*runs).items():
        print(f"{dof.label}: hysteresis reduced by {result.reduction:.0%}")


if __name__ == "__main__":
    main()
