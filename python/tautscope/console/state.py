"""The state of the loop as the page shows it."""

import math
from itertools import zip_longest
from typing import Any, Literal

import numpy as np
from msgspec import Struct, field
from numpy.typing import ArrayLike

from tautscope.config import Config
from tautscope.console.programs import programs_of
from tautscope.loop.kinematics import Kinematics

STATE_PERIOD = 0.02
"""Time between two states for the page [s]."""
Mode = Literal["twin", "hardware", "replay"]
Values = tuple[float, ...]
"""(n,) [m or rad]."""
Known = tuple[float | None, ...]
"""(n,) [m or rad]; None where it is not known."""


def layout_of(config: Config) -> dict[str, Any]:
    """What a page has to know of an instrument, once.

    `dofs` are in the order of every (n,), with the range of commands [m or rad], if any. With
    `sees_bands` images of the bands are the measurement; they are shown, and commands name the
    image displayed. Without them commands name the state displayed.
    """
    dofs = zip_longest(config.dofs, [dof.range for dof in config.dof])
    return {
        "dofs": [{"name": d.label, "unit": d.display_unit, "range": ends} for d, ends in dofs],
        "sees_bands": not config.dof,
        "programs": programs_of(config),
    }


class ImageState(Struct):
    """What became of the newest images or measurements.

    Attributes:
        sequence: What a command has to name, as in `ImageTimes`: the newest image, or without
            images this state.
        status: Result of the newest update.
        age: Time from capture to the result [s].
        dropped: Number of images of the camera that the loop did not use.
        updates: Number of updates of the loop.
        deviation: (n,) standard deviation of the state estimate.
    """

    sequence: int = 0
    status: str = "no_image"
    age: float = 0.0
    dropped: int = 0
    updates: int = 0
    deviation: Known = ()


class LogState(Struct):
    """The log of the session.

    Attributes:
        size: Of its file [byte].
        remaining: Time until the disk is full [s]; None if not known yet.
        dropped: Number of events and images that are not in the log.
        failure: Why recording ended; empty while it works.
    """

    path: str = ""
    size: int = 0
    remaining: float | None = None
    dropped: int = 0
    failure: str = ""


class State(Struct):
    """All that a page shows beside the image. Every (n,) is [m or rad].

    Attributes:
        now: When it was made [s, monotonic clock].
        time: The rig's clock [s].
        motion: ``off``, ``opening``, ``stopped``, ``unconfirmed`` where the drives did not confirm
            that, ``held``, ``moving``, ``ready``, or of a recording ``replay``.
        message: What is in force and why, in one line.
        tip: (n,) estimated; in profile ``paper`` that of the newest image, if this determined it.
        true: (n,) true tip, in simulations without an image of it.
        uncompensated, uncompensated_by: (n,) tip without compensation, and by what it is known.
        score: (n,) as `Score.errors`.
        positions: For the side view, where a kinematics has positions: of reference, tip, true and
            uncompensated, each (3,) [m] in the frame of the guide, None where it is not known.
        width_std: (n,) standard deviations of the slack's width.
        reaction, flags: The supervisor's reaction in force, and the active flags.
        latched: The flags since the last acknowledgement, the most urgent first; each with its
            meaning and what to do.
        lead, compensation: Shares of the compensation that the supervisor allows, and that the
            operator has chosen.
        scale, clutch: (n,) of the input device, and whether it moves each DOF.
        rested_by, must_release, is_off_centre, refused: As of `OperatorInput`.
        lease, holder: As of `Lease`.
        program, progress: Motion that runs by itself, empty if none, and its share done.
        program_ended: How the last one ended; empty before one has.
        late: Number of control ticks that came late, and all of them.
        stopped_at: When the newest STOP took effect [s, monotonic clock].
        replay: Time and duration of a recording [s], and whether it plays; None if live.
    """

    mode: Mode
    profile: str
    now: float = 0.0
    time: float = 0.0
    motion: str = "off"
    message: str = ""
    reference: Values = ()
    command: Values = ()
    applied: Values = ()
    tip: Known = ()
    delta_minus: Values = ()
    delta_plus: Values = ()
    true: Values | None = None
    uncompensated: Known = ()
    uncompensated_by: str = ""
    score: list[tuple[float, float] | None] = field(default_factory=list)
    positions: dict[str, Values | None] | None = None
    width_std: Known = ()
    reaction: str = "none"
    flags: tuple[str, ...] = ()
    latched: tuple[tuple[str, str], ...] = ()
    lead: float = 1.0
    compensation: float = 1.0
    scale: Values = ()
    clutch: tuple[bool, ...] = ()
    rested_by: str = ""
    must_release: bool = True
    is_off_centre: bool = False
    lease: int = 0
    holder: int | None = None
    program: str = ""
    progress: float = 0.0
    program_ended: str = ""
    is_recording: bool = False
    refused: dict[str, int] = field(default_factory=dict)
    image: ImageState = field(default_factory=ImageState)
    log: LogState = field(default_factory=LogState)
    late: tuple[int, int] = (0, 0)
    stopped_at: float | None = None
    drives: str = ""
    replay: tuple[float, float, bool] | None = None

    def show_truth(self, true: ArrayLike | None, kinematics: Kinematics | None) -> None:
        """Add what an image would show: the true tip (n,), and positions by the kinematics."""
        self.true = None if true is None else values(true)
        if kinematics is not None:
            self.positions = {}
            for name in ("reference", "tip", "true", "uncompensated"):
                of = getattr(self, name)
                is_known = of and None not in of
                place = values(kinematics.tip(np.array(of))[0]) if is_known else None
                self.positions[name] = place


def blank_state(mode: Mode, config: Config) -> State:
    """The state of an instrument that is off."""
    count = len(config.dofs)
    state = State(mode, config.profile)
    state.reference = state.command = state.applied = (0.0,) * count
    state.delta_minus = state.delta_plus = (0.0,) * count
    state.tip = state.uncompensated = (None,) * count
    state.score = [None] * count
    state.width_std = state.image.deviation = (None,) * count
    state.scale, state.clutch = (0.4,) * count, (True,) * count
    return state


def values(of: ArrayLike) -> Values:
    """(n,) as a message has it."""
    return tuple(np.asarray(of, np.float64).tolist())


def known(of: ArrayLike) -> Known:
    """The same, None where a number is not finite."""
    return tuple(value if math.isfinite(value) else None for value in values(of))
