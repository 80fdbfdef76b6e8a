"""Friction with presliding: Dahl's model, for one axis and for two axes that share a surface."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_LEAST = 1e-300
"""Displacement below which a direction is not computed."""


class DahlFriction:
    """Friction forces of elements that slide, which depend on displacement and not on speed.

    Dahl's model (P. R. Dahl, A Solid Friction Model, Aerospace Corp. TOR-0158(3107-18)-1, 1968)
    with exponent 1 and presliding distance z, so that the stiffness at rest is C/z:

        dF/dx = C/z (1 - F/C sign(dx/dt)),

    with the Coulomb friction C. Solved for a step of displacement dx with constant C, and written
    for vectors, with the direction d = dx/|dx|:

        F <- F + (1 - exp(-|dx|/z)) (C d - F)

    |F| never exceeds C while C is constant. An element of two axes thus has less friction across
    the direction in which it slides.

    Args:
        presliding: (n,) z of each element [m or rad].
        scalars: Number of elements of one axis; the elements after them are pairs, the two axes of
            one surface.

    Attributes:
        force: (n,) friction, in the direction of the motion that it opposes [N or N m].

    Wrong when static friction is higher than sliding friction (Stribeck), and when a small
    oscillating force acts beside a constant one (Dahl's model then creeps).
    """

    def __init__(self, presliding: Floats, scalars: int) -> None:
        self._presliding = -presliding
        self._scalars = scalars
        self.force = np.zeros_like(presliding)

    def step(self, displacement: Floats, coulomb: Floats) -> Floats:
        """Force (n,) after a displacement (n,) with Coulomb friction (n,)."""
        distance = np.abs(displacement)
        pairs = distance[self._scalars :].reshape(-1, 2)
        pairs[:] = np.hypot(pairs[:, :1], pairs[:, 1:])
        minus_share = np.expm1(distance / self._presliding)
        direction = displacement / np.maximum(distance, _LEAST)
        self.force -= minus_share * (coulomb * direction - self.force)
        return self.force
