"""Image-based hysteresis reduction for flexible endoscopic instruments.

Reilink, Stramigioli, Misra, Mechatronics 23 (2013) 652-658. The names below are loaded
when first used: importing the package imports neither MuJoCo nor OpenCV nor matplotlib nor MCAP.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tautscope._core import __version__

if TYPE_CHECKING:
    from tautscope import metrics, replay
    from tautscope._core import Camera, Compensator, Estimator, Instrument, Play
    from tautscope.config import Config, axes, load_config
    from tautscope.dof import Dof
    from tautscope.errors import TautscopeError
    from tautscope.loop.measurement import Points, Pose, Tip
    from tautscope.loop.reduction import HysteresisReduction, Report
    from tautscope.loop.rig import Frame, Rig, Sample
    from tautscope.loop.vision import Detection, MarkerDetector
    from tautscope.runs.experiment import run_experiment
    from tautscope.runs.play_rig import PlayRig
    from tautscope.runs.recording import Recording
    from tautscope.twin import Twin

_LOCATIONS = {
    "Camera": "_core",
    "Compensator": "_core",
    "Config": "config",
    "Detection": "loop.vision",
    "Dof": "dof",
    "Estimator": "_core",
    "Frame": "loop.rig",
    "HysteresisReduction": "loop.reduction",
    "Instrument": "_core",
    "MarkerDetector": "loop.vision",
    "Play": "_core",
    "PlayRig": "runs.play_rig",
    "Points": "loop.measurement",
    "Pose": "loop.measurement",
    "Recording": "runs.recording",
    "Report": "loop.reduction",
    "Rig": "loop.rig",
    "Sample": "loop.rig",
    "TautscopeError": "errors",
    "Tip": "loop.measurement",
    "Twin": "twin",
    "axes": "config",
    "load_config": "config",
    "run_experiment": "runs.experiment",
}
_MODULES = ("metrics", "replay")

__all__ = [
    "Camera",
    "Compensator",
    "Config",
    "Detection",
    "Dof",
    "Estimator",
    "Frame",
    "HysteresisReduction",
    "Instrument",
    "MarkerDetector",
    "Play",
    "PlayRig",
    "Points",
    "Pose",
    "Recording",
    "Report",
    "Rig",
    "Sample",
    "TautscopeError",
    "Tip",
    "Twin",
    "__version__",
    "axes",
    "load_config",
    "metrics",
    "replay",
    "run_experiment",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"tautscope.{name}")
    if name not in _LOCATIONS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "Twin":
        from tautscope.extras import require_extras  # noqa: PLC0415

        require_extras("tautscope.Twin", ["twin"])
    value = getattr(import_module(f"tautscope.{_LOCATIONS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
