"""Configuration of the article's experiment."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, field

from tautscope.config.fields import Positive
from tautscope.config.section import Section
from tautscope.dof import Dof


class Sine(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Reference of one DOF: centre + amplitude sin(2 pi t / period)."""

    centre: float
    """Position of the DOF while the others move [m or rad]."""
    amplitude: Positive
    """Amplitude [m or rad]."""
    period: Positive = 10.0
    """Period [s]."""


class ExperimentConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Section 5: a sine on each DOF in succession.

    Amplitudes are [ours]: the article gives them only in a figure.
    """

    periods: Annotated[int, Meta(ge=3)] = 5
    """Number of periods per DOF [paper]."""
    insertion: Sine = field(default_factory=lambda: Sine(centre=25e-3, amplitude=15e-3))
    rotation: Sine = field(default_factory=lambda: Sine(centre=0.0, amplitude=2.0))
    bending: Sine = field(default_factory=lambda: Sine(centre=0.9, amplitude=0.9))

    def __getitem__(self, dof: Dof) -> Sine:
        """The reference of one DOF."""
        sine: Sine = getattr(self, dof.label)
        return sine
