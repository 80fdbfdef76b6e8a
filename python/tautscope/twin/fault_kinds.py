"""The kinds of faults that can be injected into the simulated rig, and the data of one fault.

For every sensor, actuator and input there are the failure modes that apply to it: off, stuck,
garbage, wrong, slow, delayed, intermittent. ``ok`` is the run without a fault, for comparison.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from tautscope.dof import Dof
from tautscope.errors import FieldError


class Target(StrEnum):
    """The item that fails."""

    NOTHING = "nothing"
    FEATURES = "features"
    """Content of the images: the measured features."""
    FRAMES = "frames"
    """Arrival and time stamps of the frames."""
    PHYSICS = "physics"
    """The instrument, the scope and the tissue."""
    REFERENCE = "reference"
    """The operator input and its device."""
    TICK = "tick"
    """The control tick and its clock."""
    DRIVE = "drive"
    """A motor with its drive and encoder."""
    START = "start"
    """The initial backlash offsets in the configuration."""


class Mode(StrEnum):
    """The failure mode."""

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
    """A kind of fault: a row of the table.

    Attributes:
        severity: Smallest and largest severity.
        unit: Unit of the severity; mm become `PER_MM` times as many rad on rotation and bending.
        hazard: Row of the hazard table in docs/safety.md.
        has_duration: Whether it ends; otherwise it happens at its start and stays.
        on_images: Whether it has a model for images, besides the one for features.
    """

    name: str
    target: Target
    mode: Mode
    severity: tuple[float, float]
    unit: str
    hazard: str
    what: str
    has_duration: bool = True
    on_images: bool = False


PER_MM = {Dof.INSERTION: 1e-3, Dof.ROTATION: 0.1, Dof.BENDING: 0.05}
"""Severity of 1 mm on each DOF [m, rad, rad]."""

_F, _T, _P = Target.FEATURES, Target.FRAMES, Target.PHYSICS
_R, _K, _D, _S = Target.REFERENCE, Target.TICK, Target.DRIVE, Target.START
_M = Mode
_NONE = (1.0, 1.0)

TABLE = (
    Kind("ok", Target.NOTHING, _M.OK, _NONE, "", "", "no fault", on_images=True),
    # Content of the images.
    Kind("outlier", _F, _M.GARBAGE, (10, 40), "mm", "V4", "shift of one frame", False),
    Kind("outliers", _F, _M.GARBAGE, (2, 20), "mm", "V4", "random shift along the channel"),
    Kind("outliers_some", _F, _M.INTERMITTENT, (2, 20), "mm", "V4", "shift of every third frame"),
    Kind("noisy", _F, _M.GARBAGE, (2, 20), "px", "V5", "added Gaussian noise"),
    Kind("random", _F, _M.GARBAGE, _NONE, "", "V4", "random positions", on_images=True),
    Kind("swapped", _F, _M.WRONG, _NONE, "", "V2", "bands A and B exchanged"),
    Kind("swapped_some", _F, _M.INTERMITTENT, (2, 5), "frames", "V2", "exchanged every k-th frame"),
    Kind("merged", _F, _M.WRONG, _NONE, "", "V3", "both bands at their midpoint"),
    Kind("band_elsewhere", _F, _M.STUCK, _NONE, "", "V4", "fixed spot taken for band B"),
    Kind("mirrored", _F, _M.WRONG, _NONE, "", "V14", "mirrored left to right", on_images=True),
    Kind("turned", _F, _M.WRONG, _NONE, "", "V14", "rotated by 180 degrees", on_images=True),
    Kind("zoomed", _F, _M.WRONG, (0.5, 2), "times", "V13", "image scaled"),
    Kind("biased", _F, _M.WRONG, (1, 6), "mm", "V15", "constant shift"),
    Kind("drifting", _F, _M.SLOW, (0.2, 3), "mm/s", "V5", "growing shift"),
    Kind("frozen", _F, _M.STUCK, _NONE, "", "V7", "last image repeated", on_images=True),
    Kind("frozen_noisy", _F, _M.STUCK, _NONE, "", "V7", "last features with new noise"),
    Kind("frozen_some", _F, _M.INTERMITTENT, (2, 8), "frames", "V7", "each image repeated k times"),
    Kind("band_a_lost", _F, _M.OFF, _NONE, "", "V1", "proximal band not found"),
    Kind("band_b_lost", _F, _M.OFF, _NONE, "", "V1", "distal band not found"),
    Kind("bands_lost", _F, _M.OFF, _NONE, "", "V6", "neither band found", on_images=True),
    Kind("bands_some", _F, _M.INTERMITTENT, (0.1, 0.5), "s", "V5", "bands lost and found in turn"),
    Kind("not_finite", _F, _M.GARBAGE, _NONE, "", "C3", "NaN or infinite coordinates"),
    # Arrival and time stamps.
    Kind("late", _T, _M.DELAYED, (0.05, 0.5), "s", "V8", "delayed, with correct stamps"),
    Kind("late_unknown", _T, _M.DELAYED, (0.033, 0.3), "s", "E4", "delayed, with delayed stamps"),
    Kind("jitter", _T, _M.DELAYED, (0.05, 0.4), "s", "V8", "random delay up to this"),
    Kind("stamp_jitter", _T, _M.GARBAGE, (0.02, 0.1), "s", "V8", "random error of the stamps"),
    Kind("duplicate", _T, _M.WRONG, _NONE, "", "V9", "every frame twice"),
    Kind("reordered", _T, _M.WRONG, _NONE, "", "V9", "pairs of frames in reverse order"),
    Kind("dropped", _T, _M.INTERMITTENT, (0.3, 0.95), "share", "V10", "random loss of frames"),
    Kind("camera_off", _T, _M.OFF, _NONE, "", "V12", "no frames"),
    Kind("slow_camera", _T, _M.SLOW, (1, 8), "Hz", "V10", "lower frame rate"),
    Kind("stamp_hour", _T, _M.WRONG, (-3600, 3600), "s", "V11", "stamps with a constant error"),
    Kind("stamp_nan", _T, _M.GARBAGE, _NONE, "", "V11", "stamps that are NaN"),
    Kind("stamp_stuck", _T, _M.STUCK, _NONE, "", "V11", "same stamp on all frames"),
    Kind("stamp_slow", _T, _M.SLOW, (0.5, 0.95), "times", "V11", "slow clock of the camera"),
    # Instrument, scope and tissue.
    Kind("straightens", _P, _M.WRONG, (0.2, 1.5), "bends", "E2", "fewer bends within 1 s"),
    Kind("straightens_suddenly", _P, _M.WRONG, (0.2, 1.5), "bends", "E2", "fewer bends at once"),
    Kind("winds", _P, _M.SLOW, (4.5, 6), "bends", "E2", "more bends within 5 s"),
    Kind("tissue_pushes", _P, _M.WRONG, (-4, 4), "N", "V17", "constant force on the tip"),
    Kind("tissue_jerks", _P, _M.INTERMITTENT, (2, 6), "N", "V17", "force on and off at 2 Hz"),
    Kind("section_stiff", _P, _M.WRONG, (1.5, 3), "times", "E6", "more friction in the section"),
    Kind("section_loose", _P, _M.WRONG, (0.1, 0.6), "times", "E6", "less friction in the section"),
    # Operator input.
    Kind("hand_step", _R, _M.WRONG, (2, 20), "mm", "C9", "constant offset"),
    Kind("hand_spikes", _R, _M.INTERMITTENT, (2, 30), "mm", "C9", "one-tick offsets, 5/s"),
    Kind("hand_fast", _R, _M.WRONG, (50, 500), "mm/s", "C9", "ramp at this speed"),
    Kind("hand_noisy", _R, _M.GARBAGE, (0.1, 2), "mm", "C9", "noise at every tick"),
    Kind("hand_nan", _R, _M.GARBAGE, _NONE, "", "C3", "NaN or infinite values"),
    Kind("hand_silent", _R, _M.STUCK, _NONE, "", "C8", "last value held"),
    Kind("hand_late", _R, _M.DELAYED, (0.05, 0.5), "s", "C8", "delayed values"),
    Kind("hand_slow", _R, _M.SLOW, (2, 10), "Hz", "C8", "lower sampling rate"),
    Kind("hand_tremor", _R, _M.GARBAGE, (0.1, 1), "mm", "C1", "tremor of 6 to 12 Hz"),
    Kind("hand_displaced", _R, _M.WRONG, (2, 20), "mm", "C5", "offset after engaging again", False),
    # Initial backlash offsets: changes of the configuration, not of the rig.
    Kind("start_wide", _S, _M.WRONG, (1.1, 1.5), "times", "E2", "width too large", False),
    Kind("start_narrow", _S, _M.WRONG, (0, 0.9), "times", "E2", "width too small", False),
    Kind("start_shifted", _S, _M.WRONG, (-5, 5), "mm", "E1", "offsets shifted", False),
    Kind("start_negative", _S, _M.GARBAGE, _NONE, "", "E1", "negative width", False),
    Kind("start_nan", _S, _M.GARBAGE, _NONE, "", "E1", "NaN", False),
    # Control tick.
    Kind("stall", _K, _M.STUCK, (0.005, 2), "s", "C7", "no ticks for this time", False),
    Kind("stalls", _K, _M.INTERMITTENT, (0.01, 0.1), "s", "C7", "5 stalls per second"),
    Kind("clock_ahead", _K, _M.WRONG, (0.05, 3600), "s", "P5", "clock jumps ahead", False),
    Kind("clock_back", _K, _M.WRONG, (0.05, 3600), "s", "P5", "clock jumps back", False),
    Kind("clock_slow", _K, _M.SLOW, (0.2, 0.9), "times", "P5", "slow clock of the loop"),
    # Drive.
    Kind("axis_off", _D, _M.OFF, _NONE, "", "D1", "motor stops and reports a fault"),
    Kind("axis_stuck", _D, _M.STUCK, _NONE, "", "D1", "motor does not move"),
    Kind("axis_some", _D, _M.INTERMITTENT, (0.05, 0.3), "s", "D1", "motor stops intermittently"),
    Kind("axis_slow", _D, _M.SLOW, (0.5, 10), "mm/s", "C6", "speed limited"),
    Kind("axis_late", _D, _M.DELAYED, (0.05, 0.5), "s", "D2", "delayed commands"),
    Kind("axis_limited", _D, _M.WRONG, (0, 10), "mm", "C6", "travel limited"),
    Kind("axis_reversed", _D, _M.WRONG, _NONE, "", "D5", "wrong direction"),
    Kind("axis_scaled", _D, _M.WRONG, (0.5, 2), "times", "D5", "wrong scale of command and counts"),
    Kind("axis_shaking", _D, _M.GARBAGE, (0.2, 3), "mm", "D3", "noise on the command"),
    Kind("axis_runs", _D, _M.WRONG, (5, 100), "mm/s", "D3", "runaway at this speed"),
    Kind("encoder_jump", _D, _M.WRONG, (1, 20), "mm", "D3", "jump, counts unchanged", False),
    Kind("encoder_stuck", _D, _M.STUCK, _NONE, "", "D3", "constant counts"),
    Kind("encoder_noisy", _D, _M.GARBAGE, (0.5, 10), "mm", "D3", "noise on the counts"),
)

KINDS = {kind.name: kind for kind in TABLE}
"""By name."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault to inject.

    Attributes:
        start: Start time [s, the twin's clock].
        duration: Duration [s]; infinite for a permanent fault.
        severity: Severity in the kind's unit; None is the largest.
    """

    kind: str
    start: float = 0.0
    duration: float = math.inf
    severity: float | None = None
    dof: Dof = Dof.INSERTION

    def __post_init__(self) -> None:
        """Validate.

        Raises:
            FieldError: Unknown kind, invalid time, or severity out of range.
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
        """The row of the table for its kind."""
        return KINDS[self.kind]

    @property
    def size(self) -> float:
        """The severity; the largest one if none is given."""
        return self.row.severity[1] if self.severity is None else self.severity

    def is_active(self, time: float) -> bool:
        """Whether the fault is active at a time [s]."""
        return self.start <= time < self.start + self.duration
