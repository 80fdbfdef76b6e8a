"""The article's instrument and experiment."""

from typing import Annotated

from msgspec import Meta

from tautscope.config.fields import NonNegative, Positive
from tautscope.config.section import Section, require
from tautscope.dof import Dof


class InstrumentConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Dimensions of the instrument, Fig. 4. All [geometry]."""

    diameter: Positive = 3.5e-3
    """Outer diameter of shaft, section and tip [m]."""
    bending_length: Positive = 18.5e-3
    """Length of the bending section [m]."""
    tip_length: Positive = 20e-3
    """Length of the rigid tip [m]."""
    marker_a: NonNegative = 4e-3
    """Centre of the proximal band A, from the distal end of the bending section [m]."""
    marker_b: NonNegative = 16e-3
    """Centre of the distal band B, from the distal end of the bending section [m]."""
    band_length: Positive = 4e-3
    """Length of each band along the axis [m]."""

    def _check(self) -> None:
        """Both bands are on the tip, one behind the other."""
        a, b, half = self.marker_a, self.marker_b, self.band_length / 2
        proximal = "a band on the tip, proximal of marker_b's band and not overlapping it"
        require(half <= a <= b - 2 * half, "marker_a", a, proximal)
        require(b + half <= self.tip_length, "marker_b", b, "a band within tip_length")


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
    insertion: Sine = Sine(centre=25e-3, amplitude=15e-3)
    rotation: Sine = Sine(centre=0.0, amplitude=2.0)
    bending: Sine = Sine(centre=0.9, amplitude=0.9)

    def __getitem__(self, dof: Dof) -> Sine:
        """The reference of one DOF."""
        sine: Sine = getattr(self, dof.label)
        return sine
