"""A short run folder of `tautscope demo`'s kind, for the tests of the examples.

``uv run python matlab/tests/write_run.py FOLDER``: the article's profile on the twin, 27 s with
and 27 s without compensation.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tautscope import Config, Twin, run_experiment
from tautscope.config import ExperimentConfig, Sine
from tautscope.references import SineSequence


def main() -> None:
    folder = Path(sys.argv[1])
    experiment = ExperimentConfig(
        periods=3,
        insertion=Sine(centre=25e-3, amplitude=10e-3, period=3.0),
        rotation=Sine(centre=0.0, amplitude=1.5, period=3.0),
        bending=Sine(centre=0.9, amplitude=0.6, period=3.0),
    )
    config = Config(profile="paper", experiment=experiment)
    for is_compensated, suffix in ((True, ""), (False, "_uncompensated")):
        twin = Twin(config)
        reference = SineSequence(experiment)
        recording = run_experiment(twin, reference, config, compensate=is_compensated)
        twin.close()
        folder.mkdir(parents=True, exist_ok=True)
        recording.write(folder, suffix)


if __name__ == "__main__":
    main()
