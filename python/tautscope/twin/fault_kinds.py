"""What can be made to fail in the twin: the table of kinds, and what one fault is.

Every sensor, actuator and input can be off, stuck, garbage, wrong, slow, delayed or intermittent,
where that means something; ``ok`` does nothing and is there to be compared with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from tautscope.dof import Dof
from tautscope.errors import FieldError


class Target(StrEnum):
    """What fails."""

    NOTHING = "nothing"
    FEATURES = "features"
    """What the camera's image says."""
    FRAMES = "frames"
    """When images come, and the times they carry."""
    PHYSICS = "physics"
    """The instrument and what touches it."""
    REFERENCE = "reference"
    """The surgeon's hand and its device."""
    TICK = "tick"
    """The control tick and its clock."""
    DRIVE = "drive"
    """A motor with its drive and encoder."""
    START = "start"
    """What the loop is told of the slack at the start."""


class Mode(StrEnum):
    """How it fails."""

    OK = "ok"
    OFF = "off"
    STUCK = "stuck"
    GARBAGE = "garbage"
    WRONG = "wrong"
    SLOW = "slow"
    DELAYED = "delayed"
    INTERMITTENT = "intermittent"


@dataclass(frozen=True, slots=True)
class Kind:
    """A row of the table.

    Attributes:
        name: Unique; that of `Fault.kind`.
        target: What fails.
        mode: How.
        severity: Least and most that makes sense.
        unit: Of the severity; of a drive's mm, on rotation and bending the same number times
            `PER_MM` rad.
        hazard: Row of the hazard table.
        what: In words.
        lasts: Whether it has a duration; without, it happens at its start and stays.
        on_images: Whether it can be done to a picture too, not only to measured features.
    """

    name: str
    target: Target
    mode: Mode
    severity: tuple[float, float]
    unit: str
    hazard: str
    what: str
    lasts: bool = True
    on_images: bool = False


PER_MM = {Dof.INSERTION: 1e-3, Dof.ROTATION: 0.1, Dof.BENDING: 0.05}
"""What 1 mm of an insertion drive's fault is on each drive [m, rad, rad]."""

_F, _T, _P = Target.FEATURES, Target.FRAMES, Target.PHYSICS
_R, _K, _D = Target.REFERENCE, Target.TICK, Target.DRIVE
_M = Mode
_NONE = (1.0, 1.0)

TABLE = (
    Kind("ok", Target.NOTHING, _M.OK, _NONE, "", "", "nothing", on_images=True),
    # What the image says.
    Kind("outlier", _F, _M.GARBAGE, (10, 40), "mm", "V4", "one frame off along the channel", False),
    Kind("outliers", _F, _M.GARBAGE, (2, 20), "mm", "V4", "each frame off by up to this"),
    Kind("outliers_some", _F, _M.INTERMITTENT, (2, 20), "mm", "V4", "every third frame off"),
    Kind("noisy", _F, _M.GARBAGE, (2, 20), "px", "V5", "noise of this deviation on top"),
    Kind("random", _F, _M.GARBAGE, _NONE, "", "V4", "anywhere in the image", on_images=True),
    Kind("swapped", _F, _M.WRONG, _NONE, "", "V2", "bands A and B exchanged"),
    Kind("swapped_some", _F, _M.INTERMITTENT, (2, 5), "frames", "V2", "in every k-th frame"),
    Kind("merged", _F, _M.WRONG, _NONE, "", "V3", "both bands at their middle"),
    Kind("band_elsewhere", _F, _M.STUCK, _NONE, "", "V4", "a fixed spot is taken for band B"),
    Kind("mirrored", _F, _M.WRONG, _NONE, "", "V14", "left and right exchanged", on_images=True),
    Kind("turned", _F, _M.WRONG, _NONE, "", "V14", "picture upside down", on_images=True),
    Kind("zoomed", _F, _M.WRONG, (0.5, 2), "times", "V13", "picture larger or smaller"),
    Kind("biased", _F, _M.WRONG, (1, 6), "mm", "V15", "off along the channel, always alike"),
    Kind("drifting", _F, _M.SLOW, (0.2, 3), "mm/s", "V5", "bias along the channel that grows"),
    Kind("frozen", _F, _M.STUCK, _NONE, "", "V7", "the same picture again", on_images=True),
    Kind("frozen_noisy", _F, _M.STUCK, _NONE, "", "V7", "the same picture, with fresh noise"),
    Kind("frozen_some", _F, _M.INTERMITTENT, (2, 8), "frames", "V7", "each picture k times"),
    Kind("band_a_lost", _F, _M.OFF, _NONE, "", "V1", "proximal band not found"),
    Kind("band_b_lost", _F, _M.OFF, _NONE, "", "V1", "distal band not found"),
    Kind("bands_lost", _F, _M.OFF, _NONE, "", "V6", "neither band found", on_images=True),
    Kind("bands_some", _F, _M.INTERMITTENT, (0.1, 0.5), "s", "V5", "lost every other time"),
    Kind("not_finite", _F, _M.GARBAGE, _NONE, "", "C3", "NaN or infinite coordinates"),
    # When images come.
    Kind("late", _T, _M.DELAYED, (0.05, 0.5), "s", "V8", "later, with their true time"),
    Kind("late_unknown", _T, _M.DELAYED, (0.033, 0.3), "s", "E4", "later, and stamped so"),
    Kind("jitter", _T, _M.DELAYED, (0.05, 0.4), "s", "V8", "later by anything up to this"),
    Kind("stamp_jitter", _T, _M.GARBAGE, (0.02, 0.1), "s", "V8", "times off by up to this"),
    Kind("duplicate", _T, _M.WRONG, _NONE, "", "V9", "every frame twice"),
    Kind("reordered", _T, _M.WRONG, _NONE, "", "V9", "every other frame after its successor"),
    Kind("dropped", _T, _M.INTERMITTENT, (0.3, 0.95), "share", "V10", "some never come"),
    Kind("camera_off", _T, _M.OFF, _NONE, "", "V12", "none comes"),
    Kind("slow_camera", _T, _M.SLOW, (1, 8), "Hz", "V10", "fewer per second"),
    Kind("stamp_hour", _T, _M.WRONG, (-3600, 3600), "s", "V11", "times off by an hour, or so"),
    Kind("stamp_nan", _T, _M.GARBAGE, _NONE, "", "V11", "times that are no numbers"),
    Kind("stamp_stuck", _T, _M.STUCK, _NONE, "", "V11", "the same time on all"),
    Kind("stamp_slow", _T, _M.SLOW, (0.5, 0.95), "times", "V11", "camera's clock too slow"),
    # The instrument and what touches it.
    Kind("straightens", _P, _M.WRONG, (0.2, 1.5), "bends", "E2", "slack shrinks in a second"),
    Kind("straightens_suddenly", _P, _M.WRONG, (0.2, 1.5), "bends", "E2", "slack shrinks at once"),
    Kind("winds", _P, _M.SLOW, (4.5, 6), "bends", "E2", "slack grows in five seconds"),
    Kind("tissue_pushes", _P, _M.WRONG, (-4, 4), "N", "V17", "a force on the tip"),
    Kind("tissue_jerks", _P, _M.INTERMITTENT, (2, 6), "N", "V17", "it comes and goes at 2 Hz"),
    Kind("section_stiff", _P, _M.WRONG, (1.5, 3), "times", "E6", "friction in the section grows"),
    Kind("section_loose", _P, _M.WRONG, (0.1, 0.6), "times", "E6", "friction in the section falls"),
    # The hand.
    Kind("hand_step", _R, _M.WRONG, (2, 20), "mm", "C9", "jumps, and back"),
    Kind("hand_spikes", _R, _M.INTERMITTENT, (2, 30), "mm", "C9", "a tick elsewhere, 5 a second"),
    Kind("hand_fast", _R, _M.WRONG, (50, 500), "mm/s", "C9", "runs away at this speed"),
    Kind("hand_noisy", _R, _M.GARBAGE, (0.1, 2), "mm", "C9", "noise at every tick"),
    Kind("hand_nan", _R, _M.GARBAGE, _NONE, "", "C3", "no numbers"),
    Kind(
        "hand_silent", _R, _M.STUCK, _NONE, "", "C8", "the last value again, then the present one"
    ),
    Kind("hand_late", _R, _M.DELAYED, (0.05, 0.5), "s", "C8", "what it was so long ago"),
    Kind("hand_slow", _R, _M.SLOW, (2, 10), "Hz", "C8", "new values so often only"),
    Kind("hand_tremor", _R, _M.GARBAGE, (0.1, 1), "mm", "C1", "6 to 12 Hz on top"),
    Kind("hand_displaced", _R, _M.WRONG, (2, 20), "mm", "C5", "engaged again elsewhere", False),
    # What is told of the slack before the first image; a configuration, so nothing of the rig.
    Kind("start_wide", Target.START, _M.WRONG, (1.1, 1.5), "times", "E2", "too wide", False),
    Kind("start_narrow", Target.START, _M.WRONG, (0, 0.9), "times", "E2", "too narrow", False),
    Kind("start_shifted", Target.START, _M.WRONG, (-5, 5), "mm", "E1", "beside it", False),
    Kind("start_negative", Target.START, _M.GARBAGE, _NONE, "", "E1", "upper below lower", False),
    Kind("start_nan", Target.START, _M.GARBAGE, _NONE, "", "E1", "no number", False),
    # The tick.
    Kind("stall", _K, _M.STUCK, (0.005, 2), "s", "C7", "no tick for so long", False),
    Kind("stalls", _K, _M.INTERMITTENT, (0.01, 0.1), "s", "C7", "5 a second, each so long"),
    Kind("clock_ahead", _K, _M.WRONG, (0.05, 3600), "s", "P5", "clock jumps ahead", False),
    Kind("clock_back", _K, _M.WRONG, (0.05, 3600), "s", "P5", "clock jumps back", False),
    Kind("clock_slow", _K, _M.SLOW, (0.2, 0.9), "times", "P5", "clock of the loop too slow"),
    # A drive.
    Kind("axis_off", _D, _M.OFF, _NONE, "", "D1", "fault: the motor holds, and says so"),
    Kind("axis_stuck", _D, _M.STUCK, _NONE, "", "D1", "the motor does not move"),
    Kind("axis_some", _D, _M.INTERMITTENT, (0.05, 0.3), "s", "D1", "does not move now and then"),
    Kind("axis_slow", _D, _M.SLOW, (0.5, 10), "mm/s", "C6", "moves at this speed at most"),
    Kind("axis_late", _D, _M.DELAYED, (0.05, 0.5), "s", "D2", "does what was asked so long ago"),
    Kind("axis_limited", _D, _M.WRONG, (0, 10), "mm", "C6", "goes no farther from where it is"),
    Kind("axis_reversed", _D, _M.WRONG, _NONE, "", "D5", "moves the other way"),
    Kind("axis_scaled", _D, _M.WRONG, (0.5, 2), "times", "D5", "counts are larger or smaller"),
    Kind("axis_shaking", _D, _M.GARBAGE, (0.2, 3), "mm", "D3", "noise on the command"),
    Kind("axis_runs", _D, _M.WRONG, (5, 100), "mm/s", "D3", "moves on by itself"),
    Kind("encoder_jump", _D, _M.WRONG, (1, 20), "mm", "D3", "is elsewhere than it reads", False),
    Kind("encoder_stuck", _D, _M.STUCK, _NONE, "", "D3", "reads the same always"),
    Kind("encoder_noisy", _D, _M.GARBAGE, (0.5, 10), "mm", "D3", "reads this much off"),
)

KINDS = {kind.name: kind for kind in TABLE}
"""By name."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong, once.

    Attributes:
        kind: A name of `KINDS`.
        start: When [s, the twin's own clock].
        duration: How long [s]; infinite is for good.
        severity: How much, within what the kind allows and in its unit.
        dof: Which drive, or which DOF of the hand.
    """

    kind: str
    start: float = 0.0
    duration: float = math.inf
    severity: float | None = None
    dof: Dof = Dof.INSERTION

    def __post_init__(self) -> None:
        """Refuse what is no fault.

        Raises:
            FieldError: An unknown kind, a time that is none, a severity out of range.
        """
        if self.kind not in KINDS:
            raise FieldError("fault.kind", self.kind, "one of " + ", ".join(KINDS))
        if not math.isfinite(self.start):
            raise FieldError("fault.start", self.start, "a finite time [s]")
        if not self.duration > 0:
            raise FieldError("fault.duration", self.duration, "above 0 [s]")
        low, high = self.row.severity
        if self.severity is not None and not low <= self.severity <= high:
            raise FieldError("fault.severity", self.severity, f"{low} to {high} {self.row.unit}")

    @property
    def row(self) -> Kind:
        """Its row of the table."""
        return KINDS[self.kind]

    @property
    def size(self) -> float:
        """The severity, or the largest."""
        return self.row.severity[1] if self.severity is None else self.severity

    def active(self, time: float) -> bool:
        """Whether it acts at a time [s]."""
        return self.start <= time < self.start + self.duration
