"""Users import runs on a rig from here; the code is in `tautscope.runs.experiment`."""

from tautscope.runs.experiment import (
    Log,
    Look,
    Progress,
    Seen,
    run_experiment,
)

__all__ = [
    "Log",
    "Look",
    "Progress",
    "Seen",
    "run_experiment",
]
