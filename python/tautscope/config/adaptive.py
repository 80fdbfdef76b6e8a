"""Compensation and learning of profile ``best``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import Fraction, Gain, NonNegative, PerDof, Positive


class AdaptiveConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Profile ``best``: lead law, contact and offsets over position. All [ours].

    Lengths are in units of the DOF's update_distance, so that one set serves all three.
    free_gain, gain_limit, delta_minus and delta_plus are those of `DofConfig`.
    """

    contact_gain: Gain = 2.05
    """Largest speed of the tip over that of the reference in contact, until the lead is what it
    should be."""
    cautious_gain: Gain = 1.4
    """The same for a stroke that begins with an offset hardly known."""
    cautious_deviation: Positive = 12.0
    """Standard deviation of an offset from which on it counts as hardly known. The free zone ends
    deviation^2 / cautious_deviation before the contact."""
    taper: Positive = 4.0
    """End of the gap over which free_gain falls to contact_gain."""
    settling: Positive = 1.5
    """Lead yet missing below which the gain in contact falls to 1; an offset's standard deviation
    comes on top."""
    tremor_time: NonNegative = 0.15
    """Time constant of the smoothing that tells tremor from intention [s]."""
    node_spacing: Positive = 6.0
    """Distance of two of the 33 positions at which an offset is held."""
    level_deviation: Positive = 20.0
    """Standard deviation of an offset at the start, the same error at all positions."""
    gain_deviation: NonNegative = 0.0
    """Standard deviation of the command's travel over the tip's in contact, about 1; 0 takes them
    to be equal. 0.3 finds gains from 0.5 to 1 of an instrument whose scale is not known."""
    local_deviation: NonNegative = 0.7
    """Standard deviation of an offset's variation with position."""
    correlation: Positive = 40.0
    """Distance over which that variation is alike."""
    level_drift: NonNegative = 0.2
    """Standard deviation of the offset's change while the command travels 1."""
    gain_drift: NonNegative = 0.0003
    """The same of the command's travel over the tip's."""
    local_drift: NonNegative = 0.03
    """The same of its variation with position."""
    symmetry: Annotated[float, Meta(ge=0, lt=1)] = 0.8
    """Minus the correlation of the two offsets: friction moves both contacts outwards alike."""
    change_rate: PerDof = (1.4, 1.4, 1000.0)
    """Most that a known contact offset changes in a second of motion, as it is acted on, of each
    DOF. Of bending it bounds nothing: where one of its cables hands over to the other, offsets
    change within a stroke by more than any scope changes them."""
    change_spare: NonNegative = 0.6
    """What it changes by at once all the same: noise, and what it differs from place to place."""
    known_travel: NonNegative = 50.0
    """Travel of the command in contact, on either side, after which the offsets are known."""
    contact_distance: Positive = 3.0
    """Travel of the command over which it is seen whether the tip follows."""
    contact_moved: NonNegative = 3.0
    """How far the tip must have come in a stroke before contact counts."""
    slope_tolerance: Fraction = 0.25
    """Largest deviation from 1 of tip over command travel in contact."""
    model_deviation: Positive = 0.5
    """Standard deviation of a measured offset beyond the markers' noise."""
    state_correction: Annotated[float, Meta(ge=0, le=1)] = 1.0
    """Share of what an image says of the play state that is taken over; 0 leaves it to the
    model."""
    one_friction: bool = True
    """Whether insertion and rotation share the friction of a shaft that slides and turns in its
    channel: what slides along it turns freely. False takes their slacks to be independent."""
    friction_memory: Positive = 0.5
    """Travel of the shaft's surface over which the way it is to slide is averaged [in
    update_distance of insertion]."""
    friction_deviation: NonNegative = 0.25
    """Standard deviation of a slack of which the other motion leaves nothing [in half its
    width]."""
