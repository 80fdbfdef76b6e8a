"""The state of the loop as the page shows it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct, field

Mode = Literal["twin", "hardware", "replay"]
Three = tuple[float, float, float]


class ImageState(Struct):
    """What became of the newest images.

    Attributes:
        sequence: Of the newest image, as in `ImageTimes`.
        status: Result of its update.
        age: Time from capture to the result [s].
        dropped: Number of images of the camera that the loop did not use.
        deviation: (3,) standard deviation of the state estimate; None where it is not known.
    """

    sequence: int = 0
    status: str = "no_image"
    age: float = 0.0
    dropped: int = 0
    deviation: tuple[float | None, float | None, float | None] = (None, None, None)


class LogState(Struct):
    """The log of the session.

    Attributes:
        path: The file.
        size: Its size [byte].
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
    """All that a page shows beside the image. Every (3,) is [m, rad, rad].

    Attributes:
        mode: What is commanded.
        now: When it was made [s, monotonic clock].
        time: The rig's clock [s].
        motion: ``off``, ``stopped``, ``held``, ``moving``, ``ready``.
        message: What is in force and why, in one line.
        reference, command, applied, tip, delta_minus, delta_plus: (3,).
        width_std: (3,) standard deviations of the slack's width; None where not known.
        reaction: The supervisor's reaction in force.
        flags: The active flags.
        latched: The flags since the last acknowledgement, with their meanings.
        lead: Share of the compensation that the supervisor allows.
        compensation: Share that the operator has chosen.
        profile: The profile of compensation.
        scale: (3,) of the input device.
        clutch: (3,) whether it moves each DOF.
        rested_by: Why the last motion ended, if the operator did not end it.
        must_release: Whether the operator has to let go of the input device first.
        lease: Number of the lease.
        holder: Connection that holds it.
        program: Motion that runs by itself; empty if none.
        progress: Its progress, 0 to 1.
        is_recording: Whether a take is being recorded.
        refused: Reason -> number of refused commands.
        image: The newest image.
        log: The log.
        late: Number of control ticks that came late, and all of them.
        stopped_at: When the newest STOP took effect [s, monotonic clock].
        drives: The drives' state, in words.
    """

    mode: Mode
    profile: str
    now: float = 0.0
    time: float = 0.0
    motion: str = "off"
    message: str = ""
    reference: Three = (0.0, 0.0, 0.0)
    command: Three = (0.0, 0.0, 0.0)
    applied: Three = (0.0, 0.0, 0.0)
    tip: Three = (0.0, 0.0, 0.0)
    delta_minus: Three = (0.0, 0.0, 0.0)
    delta_plus: Three = (0.0, 0.0, 0.0)
    width_std: tuple[float | None, float | None, float | None] = (None, None, None)
    reaction: str = "none"
    flags: tuple[str, ...] = ()
    latched: tuple[tuple[str, str], ...] = ()
    lead: float = 1.0
    compensation: float = 1.0
    scale: Three = (0.4, 0.4, 0.4)
    clutch: tuple[bool, bool, bool] = (True, True, True)
    rested_by: str = ""
    must_release: bool = True
    lease: int = 0
    holder: int | None = None
    program: str = ""
    progress: float = 0.0
    is_recording: bool = False
    refused: dict[str, int] = field(default_factory=dict)
    image: ImageState = field(default_factory=ImageState)
    log: LogState = field(default_factory=LogState)
    late: tuple[int, int] = (0, 0)
    stopped_at: float | None = None
    drives: str = ""
