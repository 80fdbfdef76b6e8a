"""Configuration of the instrument's geometry."""

from __future__ import annotations

from tautscope.config.fields import NonNegative, Positive
from tautscope.config.section import Section


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
