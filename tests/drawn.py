"""The rig of examples/own_rig.py, for tests and for the worker processes they start."""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"
sys.path.insert(0, str(EXAMPLES))  # spawned workers inherit the path

from own_rig import BACKLASH, DrawnRig, short_experiment  # noqa: E402
from tautscope.runs.trials import Trial  # noqa: E402

__all__ = [
    "BACKLASH",
    "EXAMPLES",
    "BadFrameRig",
    "DrawnRig",
    "make_bad_frame_rig",
    "make_drawn_rig",
    "short_experiment",
]


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
