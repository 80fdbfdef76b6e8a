"""Settings of the compensation law of profile ``best``."""

from __future__ import annotations

from tautscope.config.fields import Gain, NonNegative, PerDof, Positive
from tautscope.config.section import Section


class AdaptiveConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Vector law of profile ``best``, decision 0029. All [ours].

    Travels and half widths are in halves of the DOF's safety.width_limit, so that one set serves
    all three. free_gain, gain_limit, delta_minus and delta_plus are those of `DofConfig`.
    """

    tip_gain: Gain = 1.85
    """Largest speed of the predicted tip over that of the reference."""
    caution: NonNegative = 0.3
    """Standard deviations of the half width by which less of it is compensated than estimated: an
    overcompensated tip overtakes the reference."""
    tremor_time: NonNegative = 0.15
    """Time constant of the low-pass filter of the operator input that separates tremor from motion
    [s]."""
    direction_travel: Positive = 0.01
    """Travel of the reference over which its direction is averaged."""
    change_rate: PerDof = (0.07, 0.07, 100.0)
    """Rate limit of half width and centre in the compensation, per second of motion, for each DOF.
    That of bending bounds nothing: where one of its cables takes over from the other, offsets
    change within a stroke faster than by any motion of the endoscope."""
    known_travel: NonNegative = 10.0
    """Travel of the reference up to which nothing is limited."""
