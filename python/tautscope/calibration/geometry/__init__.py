"""Calibration of the geometry from the instrument's own motion, with hysteresis as a nuisance.

`sweep` moves a rig and records it, `fit` estimates pose, lengths, focal length and delay.
"""

from tautscope.calibration.geometry.fit import GeometryFit, fit
from tautscope.calibration.geometry.parameters import INTRINSICS, Intrinsics
from tautscope.calibration.geometry.recording import Patch, Recorder, Recording, sweep
from tautscope.calibration.geometry.values import Value

__all__ = [
    "INTRINSICS",
    "GeometryFit",
    "Intrinsics",
    "Patch",
    "Recorder",
    "Recording",
    "Value",
    "fit",
    "sweep",
]
