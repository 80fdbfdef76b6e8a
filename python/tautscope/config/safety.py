"""Limits of the monitors, and the duration of the supervisor's reactions."""

from typing import Annotated

from msgspec import Meta

from tautscope._core import DETECTORS
from tautscope.config.fields import LIMITS, MOST_RATIO, NonNegative, PerDof, Positive, Vector3
from tautscope.config.section import Section, require, require_names

Range = tuple[float, float]
Count = Annotated[int, Meta(ge=1)]
USUAL_TRAVEL: tuple[Range, Range, Range] = ((-0.1, 0.3), (-12.6, 12.6), (-4.0, 4.0))


class SafetyConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Supervision of the loop [ours]; docs/safety.md lists the reaction to each flag.

    Three values are those of insertion, rotation and bending, in [m, rad, rad] or those per second.
    "Stops": until the operator re-engages. In a run without a fault only `width_limit`,
    `command_speed` and `reference_age` matter, which bound the law as well.
    """

    off: tuple[str, ...] = ()
    """Detectors that are switched off, as in docs/safety.md; every report names them."""
    unusual: tuple[str, ...] = ()
    """Keys by dotted path, as "safety.stall", that may have unusual values; every report names
    them."""
    width_limit: PerDof = (12e-3, 2.6, 1.5)
    """Largest estimated width of the slack, and difference between command and reference; unit of
    the travels below."""
    offset_limit: PerDof = (8e-3, 1.6, 0.9)
    """Largest absolute value of an estimated contact offset."""
    reference_speed: PerDof = (0.04, 4.0, 2.0)
    """Largest speed of the reference over `reference_time`. A faster one is followed at this speed;
    what it lags is caught up in further motion."""
    reference_time: Positive = 0.04
    """Time over which the speed is averaged: a tremor of 1 mm passes, a jump of 2 mm does not
    [s]."""
    command_speed: PerDof = (0.4, 27.0, 16.0)
    """Largest speed of the command: a faster one stops. The reference is followed at no more than
    this, by profile ``paper`` over `gain_limit`."""
    command_travel: tuple[Range, Range, Range] = USUAL_TRAVEL
    """Least and largest command [m, rad, rad]."""
    reference_count: PerDof = (50e-6, 5e-3, 2.5e-3)
    """Resolution of the input device, or its largest step from rest [m, rad, rad]: motion stops
    where the reference changes by this more than its speed before and `reference_speed` allow."""
    reference_age: Positive = 0.05
    """Largest age of a reference, where its time is known; an older one moves nothing [s]. After
    identical values for longer, the next change must be one that starts from rest."""
    late_tick: Annotated[float, Meta(gt=1)] = 3.0
    """Longest time between two control ticks; motion after a longer one is discarded [control
    periods]."""
    stall: Positive = 0.1
    """Time between two control ticks above which motion stops [s]."""
    frame_age: Positive = 0.3
    """Largest age of a frame on arrival; an older one is refused [s]."""
    frame_gap: Positive = 0.18
    """Time without a frame after which the camera counts as lost [s]."""
    clock_jump: Positive = 1.0
    """A frame captured this much before the last one shows that the camera's clock was set back;
    less, a frame out of order [s]."""
    frozen_travel: Annotated[float, Meta(gt=0, le=1_000_000)] = 0.01
    """Travel of the command after which an identical image counts as frozen [in update_distance]. A
    source without sensor noise needs more than the slack."""
    innovation_limit: Positive = 8.0
    """Largest innovation of a frame that is used [in standard deviations]."""
    state_noise: Vector3 = (0.03e-3, 1.5e-3, 1.5e-3)
    """Standard deviation of the state estimate in a still scene [m, rad, rad]. Three times this
    must be below contact_tolerance times update_distance, or noise is taken for contact."""
    tremor_swing: Positive = 0.5
    """Least one-way motion of the reference, without its slow part, that is a tremor
    [in update_distance]."""
    tremor_rate: Positive = 4.0
    """Reversals of the reference, without its slow part, within width_limit, that are a tremor
    [1/s]."""
    ahead_limit: Positive = 0.2
    """How much farther than the reference the tip may move in a stroke; beyond it there is less
    slack than is compensated [in width_limit]."""
    ahead_ratio: Positive = 1.5
    """Travel of the tip over that of the reference in a stroke, above which `ahead_limit`
    applies."""
    offset_decrease: Positive = 2.0
    """Largest decrease of an estimated contact offset within a stroke; beyond it there was less
    slack than was compensated [in ahead_limit]."""
    cycle_swings: Count = 4
    """Growing half periods in a row, of reference and tip, that are a limit cycle."""
    cycle_growth: Positive = 1.1
    """Ratio of a swing to the last one, from which it grows."""
    cycle_time: Positive = 2.0
    """Longest swing of a limit cycle, one way [s]."""
    hold_time: NonNegative = 8.0
    """Time after which a flag that is still raised goes to its next reaction [s]."""
    hold_travel: NonNegative = 8.0
    """Travel of the reference, summed over all DOFs, after which it does so too [in
    width_limit]."""
    fade_travel: Positive = 2.0
    """Travel over which compensation fades [in width_limit]."""
    restore_travel: Positive = 2.0
    """Travel over which compensation returns after a fade [in width_limit]."""
    good_frames: Count = 5
    """Good frames in a row that clear a flag of frames."""
    good_ticks: Count = 200
    """Good control ticks in a row that clear a flag of ticks."""

    def _check(self) -> None:
        require_names("off", self.off, DETECTORS)
        for index, limits in enumerate(self.command_travel):
            path, most = f"command_travel[{index}]", MOST_RATIO * max(map(abs, USUAL_TRAVEL[index]))
            require(limits[0] < limits[1], path, limits, LIMITS)
            is_usual = max(map(abs, limits)) <= most or "safety.command_travel" in self.unusual
            require(is_usual, path, limits, f"within -{most:.3g} to {most:.3g}")
