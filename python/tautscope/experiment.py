"""Users import runs on a rig from here; the code is in `tautscope.runs.experiment`."""

from tautscope.runs.experiment import ImageUpdate, Log, Progress, run_experiment

__all__ = ["ImageUpdate", "Log", "Progress", "run_experiment"]
