"""A run of the drawn rig with its log."""

from pathlib import Path

from drawn import DrawnRig
from tautscope.config import Config
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.loop.references import SineSequence
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording


def record(path: Path, config: Config, seconds: float = 36.0) -> tuple[Recording, LogSummary]:
    reference = SineSequence(config.experiment)
    reference.duration = min(seconds, reference.duration)
    with LogWriter(path, config, segments=reference.segments, wait=True) as log:
        recording = run_experiment(DrawnRig(config), reference, config, log=log)
    return recording, log.close()
