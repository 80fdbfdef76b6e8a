"""The three degrees of freedom, in the order every (3,) array has."""

from collections.abc import Iterable
from enum import IntEnum
from typing import Protocol, Self


class Dof(IntEnum):
    """A degree of freedom of the instrument; its value is its index in every (3,) array."""

    INSERTION = 0
    ROTATION = 1
    BENDING = 2

    @property
    def label(self) -> str:
        """The name in configurations, columns and tables."""
        return self.name.lower()

    @property
    def display_unit(self) -> str:
        """The unit in tables and figures: mm for insertion, else rad. Arrays are in m and rad."""
        return "mm" if self is Dof.INSERTION else "rad"

    @property
    def display_scale(self) -> float:
        """Factor from m or rad to `display_unit`."""
        return 1e3 if self is Dof.INSERTION else 1.0

    @property
    def key(self) -> str:
        """The section of its motor in a configuration."""
        return f"drives.{self.label}"


class NamedDof(Protocol):
    """A degree of freedom by name and unit: `Dof`, or an entry of [[dof]]."""

    @property
    def label(self) -> str:
        """The name in columns and tables."""
        ...

    @property
    def display_unit(self) -> str:
        """The unit in tables and figures."""
        ...

    @property
    def display_scale(self) -> float:
        """Factor from m or rad to `display_unit`."""
        ...


class NamedMotor(int):
    """A motor of ``[drives.motors]``; its value is its index in every array of motors."""

    _label: str
    _unit: str

    def __new__(cls, index: int, label: str, unit: str) -> Self:
        """Make it of index, name, and unit of its positions."""
        self = super().__new__(cls, index)
        self._label, self._unit = label, unit
        return self

    @property
    def label(self) -> str:
        """The name in configurations, columns and tables."""
        return self._label

    @property
    def display_unit(self) -> str:
        """The unit in tables and figures: mm for m, else its own."""
        return "mm" if self._unit == "m" else self._unit

    @property
    def display_scale(self) -> float:
        """Factor from its unit to `display_unit`."""
        return 1e3 if self._unit == "m" else 1.0

    @property
    def key(self) -> str:
        """Its section in a configuration."""
        return f"drives.motors.{self._label}"


Motor = Dof | NamedMotor
"""A motor by index, name and unit."""


def unit(dof: NamedDof) -> str:
    """The unit of its values: m or rad."""
    return "m" if dof.display_unit == "mm" else dof.display_unit


def display_text(values: Iterable[float], dofs: Iterable[NamedDof] = Dof) -> str:
    """Values (n,) [m or rad] with their display units: ``9.81 mm, 1.76 rad, 1.02 rad``."""
    return ", ".join(
        f"{value * dof.display_scale:.3g} {dof.display_unit}"
        for dof, value in zip(dofs, values, strict=True)
    )
