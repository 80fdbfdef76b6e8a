"""The state of one injected fault during a run, common to all fault models."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tautscope.twin.fault_kinds import PER_MM, Fault

Floats = NDArray[np.float64]


@dataclass(slots=True)
class FaultState:
    """One injected fault with its state; the input of its fault model.

    Attributes:
        image_size: (width, height) [px].
        channel_jacobian: Returns (4,) [px/m], motion of the features per insertion.
        elapsed: Time since the start of the fault [s].
    """

    spec: Fault
    rng: np.random.Generator
    image_size: tuple[int, int] = (1, 1)
    channel_jacobian: Callable[[], Floats] = lambda: np.zeros(4)
    elapsed: float = 0.0
    memory: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def seeded(cls, spec: Fault, seed: int, index: int, **context: Any) -> Self:
        """The fault at place ``index`` of a list, with the random generator of a seed."""
        rng = np.random.default_rng([seed, index, zlib.crc32(spec.kind.encode())])
        return cls(spec, rng, **context)

    def update(self, time: float) -> bool:
        """Set the elapsed time; returns whether the fault is active at a time [s]."""
        is_active = self.spec.is_active(time)
        if is_active:
            self.elapsed = time - self.spec.start
        return is_active

    @property
    def size(self) -> float:
        """The severity."""
        return self.spec.size

    @property
    def signed_size(self) -> float:
        """The severity with a sign that is drawn once."""
        return float(self.hold("side", self.rng.choice((-1, 1)))) * self.size

    @property
    def amplitude(self) -> float:
        """The severity, given in mm, in the unit of the fault's DOF [m or rad]."""
        return self.size * PER_MM[self.spec.dof]

    @property
    def signed_amplitude(self) -> float:
        """As `amplitude`, with the sign of `signed_size`."""
        return self.signed_size * PER_MM[self.spec.dof]

    def count(self) -> int:
        """Number of earlier calls."""
        number: int = self.memory.get("count", 0)
        self.memory["count"] = number + 1
        return number

    def hold(self, key: str, value: Any) -> Any:
        """The value of the first call with this key."""
        return self.memory.setdefault(key, value)

    def channel_shift(self, millimetres: float) -> Floats:
        """Motion of the features (4,) [px] for an insertion by this distance [mm]."""
        return 1e-3 * millimetres * self.channel_jacobian()
