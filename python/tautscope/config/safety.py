"""What is watched, where the limits are, and how long a reaction lasts."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import NonNegative, PerDof, Positive, Vector3

Range = tuple[float, float]
Count = Annotated[int, Meta(ge=1, le=1_000_000)]


class SafetyConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Supervision of the loop; reactions: crates/core/src/supervision/reactions.rs. All [ours].

    Per degree of freedom: [m, rad, rad], or those per second. Nothing of it changes a run in which
    nothing goes wrong.
    """

    off: tuple[str, ...] = ()
    """Detectors that are switched off, by the names of `tautscope.loop.safety.DETECTORS`; every
    report names them."""
    width_limit: PerDof = (12e-3, 2.6, 1.5)
    """Largest width of the slack that is believed; the article's are 10 mm, 1.8 rad, 1.1 rad. Also
    how far a command may lead its reference, and the unit of the travels below."""
    offset_limit: PerDof = (8e-3, 1.6, 0.9)
    """Largest contact offset either way that is believed."""
    reference_speed: PerDof = (0.04, 4.0, 2.0)
    """A reference that is faster than this over `reference_time` stops motion until the operator
    re-engages: three times the fastest hand of docs/faults.md."""
    reference_time: Positive = 0.04
    """Over which a speed counts: a tremor of 1 mm passes, a jump of 2 mm does not [s]."""
    command_speed: PerDof = (0.4, 27.0, 16.0)
    """A command that would change faster does not move, and motion stops until the operator
    re-engages: six times that of a hand at 12.6 mm/s, which crosses the slack K_b times as fast."""
    command_travel: tuple[Range, Range, Range] = ((-0.1, 0.3), (-12.6, 12.6), (-4.0, 4.0))
    """Least and largest command [m, rad, rad]."""
    reference_count: PerDof = (50e-6, 5e-3, 2.5e-3)
    """What the hand's device counts in, or its largest step of rest: so much more than
    `reference_speed` allows may its value change from one to the next, beyond the speed it had
    before [m, rad, rad]."""
    reference_age: Positive = 0.05
    """A reference made longer ago moves nothing, where that is known [s]. A device that repeats its
    value to the bit for longer is at rest, or silent: it may go on only as a hand at rest does."""
    late_tick: Annotated[float, Meta(gt=1)] = 3.0
    """Control periods from one tick to the next beyond which that motion is thrown away."""
    stall: Positive = 0.1
    """Time from one tick to the next beyond which motion stops until the operator re-engages
    [s]."""
    frame_age: Positive = 0.3
    """An older frame is refused when it comes [s]."""
    frame_gap: Positive = 0.18
    """So long without a frame, and the camera counts as lost [s]."""
    frozen_travel: Positive = 0.01
    """Travel of the command after which no picture repeats itself [in update_distance]: any, even
    where a hand turns. Sensor noise makes every picture different, of a tip at rest too; a source
    without noise needs more than the slack."""
    innovation_limit: Positive = 8.0
    """An image further from what is expected is refused [in standard deviations]."""
    innovation_floor: Positive = 0.08
    """Least standard deviation of what is expected [in start_deviation]."""
    jump: PerDof = (0.2e-3, 0.2, 0.05)
    """How much farther than its command a tip may come from one image to the next, besides two of
    the image's own standard deviations [m, rad, rad]."""
    slip: PerDof = (0.4e-3, 2.6, 0.04)
    """How far a tip in contact may be off where its command should have taken it, besides 15 % of
    the way and the image's own standard deviation [m, rad, rad]. Rotation, whose shaft winds up
    while insertion moves, has no contact that lasts."""
    grip_distance: Positive = 15.0
    """Travel of the command over which a tip that goes with it is in contact [in
    update_distance]."""
    blind_growth: NonNegative = 0.1
    """What both grow by, per travel of the command, while no marker is seen."""
    state_noise: Vector3 = (0.03e-3, 1.5e-3, 1.5e-3)
    """Standard deviation of the state estimate in a still scene [m, rad, rad], twin; three of it
    must be below contact_tolerance times update_distance, or noise passes for contact."""
    tremor_swing: Positive = 0.5
    """Least swing of the reference that is a tremor, one way [in update_distance]."""
    tremor_rate: Positive = 4.0
    """Reversals of the reference, swings within width_limit, that are a tremor [1/s]."""
    ahead_limit: Positive = 0.1
    """How much farther than the reference the tip may come in a stroke; beyond it less slack is
    there than is made up for [in width_limit]."""
    cycle_swings: Count = 4
    """So many swings of reference and tip, each 1.1 times the one before it, and the loop with the
    operator in it builds up an oscillation."""
    cycle_time: Positive = 2.0
    """Longest swing of such an oscillation, one way [s]."""
    change_limit: PerDof = (0.8e-3, 0.9, 0.08)
    """Change of a contact offset that was learnt, and is worth saying; rotation's differs that much
    from place to place."""
    change_travel: Positive = 1.5
    """Travel of the command over which changes count together [in width_limit]."""
    hold_time: NonNegative = 4.0
    """How long a reaction lasts before the next takes its place [s]."""
    hold_travel: NonNegative = 4.0
    """The same as travel of the reference, all degrees of freedom together [in width_limit]."""
    fade_travel: Positive = 2.0
    """Travel over which compensation fades to nothing [in width_limit]."""
    restore_travel: Positive = 2.0
    """Travel over which it comes back, once warnings have been acknowledged [in width_limit]."""
    good_frames: Count = 5
    """Frames in a row with nothing wrong after which learning goes on."""
    good_ticks: Count = 200
    """The same for what is seen at the control tick."""
    clock_jump: Positive = 1.0
    innovation_growth: Positive = 0.3
    innovation_decay: Positive = 0.05
    ahead_ratio: Positive = 1.5
    offset_decrease: Positive = 2.0
    cycle_growth: Positive = 1.1
