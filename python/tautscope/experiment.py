"""Users import runs on a rig from here; the code is in `tautscope.runs`."""

from tautscope.runs.control_loop import ImageUpdate, Log
from tautscope.runs.experiment import Progress, run_experiment

__all__ = ["ImageUpdate", "Log", "Progress", "run_experiment"]
