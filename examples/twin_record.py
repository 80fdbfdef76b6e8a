"""Write motor and tip positions of one DOF of the simulated instrument as CSV, without images.

``uv run python examples/twin_record.py insertion > record.csv``, then
``uv run tautscope analyze record.csv --command motor --measured tip --time time``.
"""

import sys
from collections.abc import Iterator

import numpy as np
from tautscope import Dof, load_config
from tautscope.twin.plant import Plant

TICKS_PER_LINE = 8
"""Control ticks per line: 25 lines per second, the frame rate of the camera."""


def samples(dof: Dof, periods: int, seed: int = 0) -> Iterator[tuple[float, float, float]]:
    """Time [s], encoder position and true tip position [m or rad] for the article's sine."""
    config = load_config()
    plant = Plant(config, np.random.default_rng(seed))
    sine, tick = config.experiment[dof], config.control.period
    command = np.array([config.experiment[each].centre for each in Dof])
    index = list(Dof).index(dof)
    for tick_number in range(round(periods * sine.period / tick)):
        time = tick_number * tick
        command[index] = sine.centre + sine.amplitude * np.sin(2 * np.pi * time / sine.period)
        plant.step(command)
        if tick_number % TICKS_PER_LINE == 0:
            yield time, float(plant.applied[index]), float(plant.true_state[index])


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else "insertion"
    dofs = {dof.label: dof for dof in Dof}
    if name not in dofs:
        sys.exit(f"got {name!r}, expected one of {', '.join(dofs)}")
    print("time,motor,tip")
    for time, motor, tip in samples(dofs[name], periods=5):
        print(f"{time:.3f},{motor:.9g},{tip:.9g}")


if __name__ == "__main__":
    main()
