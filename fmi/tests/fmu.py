"""A unit in FMPy, its configuration, and a motion."""

from pathlib import Path

import fmpy
import numpy as np
import record
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray
from tautscope import Config

CONFIG = Config().replace(**{"twin.seed": 3})
PERIOD = CONFIG.control.period
DOFS = ("insertion", "rotation", "bending")


class Unit:
    """An initialized unit, its variables by name."""

    def __init__(self, path: Path, folder: Path, **parameters: float | str) -> None:
        description = fmpy.read_model_description(str(path))
        self._types = {v.name: (v.type, v.valueReference) for v in description.modelVariables}
        self.dofs = [name[8:] for name in self._types if name.startswith("command_")]
        self.messages: list[str] = []
        self._fmu = FMU3Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="unit",
        )
        self._fmu.instantiate(loggingOn=True, logMessage=self._log)
        self._parameters = parameters
        try:
            self.initialize()
        except FMICallException as error:
            self.close()
            raise RuntimeError(" ".join(self.messages)) from error

    def initialize(self) -> None:
        for name, value in self._parameters.items():
            self.set(name, value)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()

    def _log(self, environment: object, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())

    def set(self, name: str, value: float | str) -> None:
        kind, reference = self._types[name]
        getattr(self._fmu, f"set{kind}")([reference], [value])

    def get(self, *names: str) -> NDArray[np.float64]:
        values = []
        for name in names:
            kind, reference = self._types[name]
            values += getattr(self._fmu, f"get{kind}")([reference])
        return np.array(values, dtype=np.float64)

    def set_all(self, prefix: str, values: NDArray[np.float64]) -> None:
        for dof, value in zip(self.dofs, values, strict=True):
            self.set(f"{prefix}_{dof}", value)

    def get_all(self, prefix: str) -> NDArray[np.float64]:
        return self.get(*(f"{prefix}_{dof}" for dof in self.dofs))

    def step(self, at: float, size: float = PERIOD) -> None:
        self._fmu.doStep(at, size)

    def reset(self) -> None:
        self._fmu.reset()
        self.initialize()

    def terminate(self) -> None:
        self._fmu.terminate()

    def close(self) -> None:
        self._fmu.freeInstance()


def motion(time: float) -> NDArray[np.float64]:
    """A command."""
    return record.CENTRES + record.AMPLITUDES * np.sin(2 * np.pi * time / np.array([5, 7, 4]))
