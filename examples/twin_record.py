"""A record of the simulated instrument: motor and tip of one DOF, as CSV, without images.

``uv run python examples/twin_record.py insertion > record.csv``, then
``uv run tautscope analyze record.csv --command motor --measured tip --time time``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from tautscope import Dof, load_config
from tautscope.twin.plant import Plant

EVERY = 8
"""Control ticks between two lines: 25 lines a second, as many as the camera's images."""


def lines(dof: Dof, periods: int, seed: int = 0) -> Iterator[tuple[float, float, float]]:
    """Time [s], what the encoder reads and where the tip is [m or rad]: the article's sine."""
    config = load_config()
    plant = Plant(config, np.random.default_rng(seed))
    sine, tick = config.experiment[dof], config.control.period
    command = np.array([config.experiment[each].centre for each in Dof])
    at = list(Dof).index(dof)
    for count in range(round(periods * sine.period / tick)):
        time = count * tick
        command[at] = sine.centre + sine.amplitude * np.sin(2 * np.pi * time / sine.period)
        plant.step(command)
        if count % EVERY == 0:
            yield time, float(plant.applied[at]), float(plant.true_state[at])


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "insertion"
    dofs = {dof.label: dof for dof in Dof}
    if name not in dofs:
        sys.exit(f"got {name!r}, expected one of {', '.join(dofs)}")
    print("time,motor,tip")
    for time, motor, tip in lines(dofs[name], periods=5):
        print(f"{time:.3f},{motor:.9g},{tip:.9g}")


if __name__ == "__main__":
    main()
