"""Settings of compensation and offset estimation of profile ``best``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import Fraction, Gain, NonNegative, PerDof, Positive


class AdaptiveConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Lead law, contact test and offsets over position of profile ``best``. All [ours].

    Lengths are in units of the DOF's update_distance, so that one set serves all three.
    free_gain, gain_limit, delta_minus and delta_plus are those of `DofConfig`.
    """

    contact_gain: Gain = 2.05
    """Largest speed of the tip over that of the reference in contact, until the compensation offset
    is reached."""
    cautious_gain: Gain = 1.4
    """contact_gain of a stroke that begins with an uncertain offset."""
    cautious_deviation: Positive = 12.0
    """Standard deviation (std) above which an offset is uncertain. The free zone ends std^2 /
    cautious_deviation before the contact."""
    taper: Positive = 4.0
    """Last part of the gap, over which free_gain falls to contact_gain."""
    settling: Positive = 1.5
    """Missing compensation offset below which the gain in contact falls to 1; the std of the offset
    is added."""
    tremor_time: NonNegative = 0.15
    """Time constant of the low-pass filter of the operator input that separates tremor from motion
    [s]."""
    node_spacing: Positive = 6.0
    """Distance of the 33 positions at which an offset is estimated."""
    level_deviation: Positive = 20.0
    """Standard deviation of the initial error of an offset that is equal at all positions."""
    gain_deviation: NonNegative = 0.0
    """Standard deviation of the command's travel over the tip's in contact, about 1; 0 assumes that
    both are equal. 0.3 finds gains from 0.5 to 1 of an instrument of unknown scale."""
    local_deviation: NonNegative = 0.7
    """Standard deviation of the variation of an offset with position."""
    correlation: Positive = 40.0
    """Correlation length of that variation."""
    level_drift: NonNegative = 0.2
    """Standard deviation of the change of an offset over a command travel of 1."""
    gain_drift: NonNegative = 0.0003
    """Standard deviation of the change of the command's travel over the tip's, over a command
    travel of 1."""
    local_drift: NonNegative = 0.03
    """Standard deviation of the change of the variation with position, over a command travel of
    1."""
    symmetry: Annotated[float, Meta(ge=0, lt=1)] = 0.8
    """Minus the correlation of the two offsets: friction moves both contacts outwards equally."""
    change_rate: PerDof = (1.4, 1.4, 1000.0)
    """Rate limit of a known contact offset in the compensation, per second of motion, for each DOF.
    That of bending bounds nothing: where one of its cables takes over from the other, offsets
    change within a stroke faster than by any motion of the endoscope."""
    change_spare: NonNegative = 0.6
    """Deadband of the rate limiter for noise and variation with position."""
    known_travel: NonNegative = 50.0
    """Travel of the command in contact, per side, after which the offsets are known."""
    contact_distance: Positive = 3.0
    """Travel of the command over which the contact test compares it with the tip."""
    contact_moved: NonNegative = 3.0
    """Travel of the tip in a stroke from which on contact is possible."""
    slope_tolerance: Fraction = 0.25
    """Largest difference of tip travel over command travel in contact from 1."""
    model_deviation: Positive = 0.5
    """Standard deviation of a measured offset beyond the marker noise."""
    state_correction: Annotated[float, Meta(ge=0, le=1)] = 1.0
    """Share of the measured correction of the predicted state that is applied, 0 to 1."""
    one_friction: bool = True
    """Whether insertion and rotation share the friction of a shaft that slides and turns in its
    channel: what slides along it turns freely. False assumes independent slacks."""
    friction_memory: Positive = 0.5
    """Travel of the shaft's surface over which the slip direction is averaged [in update_distance
    of insertion]."""
    friction_deviation: NonNegative = 0.25
    """Standard deviation of a slack that the motion of the other DOF reduces to 0 [in half its
    width]."""
