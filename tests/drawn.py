"""The rig of examples/own_rig.py, for tests and for the worker processes they start."""

from dataclasses import replace

import own_rig
from common.paths import ROOT
from own_rig import BACKLASH, DrawnRig
from tautscope.config import Config
from tautscope.runs.trials import Trial

EXAMPLES = ROOT / "examples"

__all__ = [
    "BACKLASH",
    "EXAMPLES",
    "BadFrameRig",
    "DrawnRig",
    "StallingRig",
    "make_bad_frame_rig",
    "make_drawn_rig",
    "make_stalling_rig",
    "short_experiment",
    "with_half_images",
    "with_periods",
]


def short_experiment() -> Config:
    """That of the example in profile `paper`, whose reduction is that of the gain."""
    return own_rig.short_experiment().replace(profile="paper")


def with_half_images(config: Config) -> Config:
    """The same view in images of half the width and height."""
    camera = config.camera
    sides = {f"camera.{key}": getattr(camera, key) // 2 for key in ("width", "height")}
    lens = {f"camera.{key}": getattr(camera, key) / 2 for key in ("fx", "fy", "cx", "cy")}
    return config.replace(**sides, **lens)


def with_periods(config: Config, seconds: float) -> Config:
    """The same with sines of another period."""
    names = ("insertion", "rotation", "bending")
    return config.replace(**{f"experiment.{name}.period": seconds for name in names})


class BadFrameRig(DrawnRig):
    """A rig whose images have the wrong size."""

    def _draw(self):
        return super()._draw()[:-1]


def make_drawn_rig(trial: Trial) -> DrawnRig:
    """The rig of a trial, for worker processes."""
    return DrawnRig(trial.config)


def make_bad_frame_rig(trial: Trial) -> BadFrameRig:
    """The rig of a trial, with images of the wrong size."""
    return BadFrameRig(trial.config)


class StallingRig(DrawnRig):
    """A rig that calls nobody for half a second after its first second."""

    STALL, DURATION = 1.0, 0.5

    def step(self, command):
        sample = super().step(command)
        late = self.DURATION if sample.time > self.STALL else 0.0
        frame = sample.frame
        if frame is not None and frame.captured_at > self.STALL:
            frame = replace(frame, captured_at=frame.captured_at + late)
        return replace(sample, time=sample.time + late, frame=frame)


def make_stalling_rig(trial: Trial) -> StallingRig:
    """The rig of a trial that stalls."""
    return StallingRig(trial.config)
