"""The interface between the loop and a rig: the twin, hardware, a recording, or your own.

A rig takes commands and returns samples. It owns the clock.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.errors import (
    STOPPED,
    DriveError,
    SignalError,
    StateError,
    TautscopeError,
    described,
)
from tautscope.loop.measurement import Measurement, Points, Pose, Tip
from tautscope.loop.safety import Reaction, Supervision
from tautscope.loop.signal_checks import as_numbers, check_time

_WATCH_PERIOD = 0.005
"""Time between two calls of `must_stop` [s]."""
_STOPPED = "stopped while it was being enabled"
OPTIONAL = ("interrupt", "disable")
"""Methods that a rig may have beside those of `Rig`: see `reset_unless` and `disable`."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One camera image.

    Attributes:
        image: Pixels, uint8, in `camera.pixel_format`: (height, width, 3) B, G, R by default;
            `tautscope.loop.frame_layout` lists the shapes.
        captured_at: When it was taken [s, the rig's clock], not when it arrived.
        sequence: Counts the camera's frames; a gap is a dropped frame.
        true_features: (4,) [px] what an ideal segmentation would measure if each band were wholly
            visible; twin only, the loop never reads it.
        true_visible: (2,) visible share of bands A and B, 0 to 1; twin only, the loop never reads
            it.
    """

    image: NDArray[np.uint8]
    captured_at: float
    sequence: int
    true_features: NDArray[np.float64] | None = None
    true_visible: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        if self.image.ndim == 2:  # nv12 and i420 have U and V below the rows of Y
            height = height * 2 // 3
        return f"<Frame {self.sequence}: {width} x {height}, captured at {self.captured_at:.3f} s>"


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """What a rig reports after one control period.

    Attributes:
        time: [s, the rig's clock].
        applied: (n,) [m or rad] what the drives report.
        frame: The newest image that arrived in this period, if any.
        true_state: (n,) [m or rad] of the tip; simulations only, the loop never reads it.
        measurement: What sensors other than the camera delivered in this period: a `Tip`, `Pose` or
            `Points`, or several in a tuple.
    """

    time: float
    applied: NDArray[np.float64]
    frame: Frame | None = None
    true_state: NDArray[np.float64] | None = None
    measurement: Measurement | tuple[Measurement, ...] = ()

    @property
    def measurements(self) -> tuple[Measurement, ...]:
        """All of `measurement`."""
        return self.measurement if isinstance(self.measurement, tuple) else (self.measurement,)

    def __repr__(self) -> str:
        frame = "no frame" if self.frame is None else f"frame {self.frame.sequence}"
        applied = ", ".join(f"{value:.3g}" for value in self.applied)
        return f"<Sample at {self.time:.3f} s: applied {applied} [m or rad], {frame}>"


@runtime_checkable
class Rig(Protocol):
    """An instrument with drives, and a camera or another sensor of its tip."""

    @property
    def control_period(self) -> float:
        """Time from one command to the next [s]."""

    def reset(self) -> Sample:
        """Go to the start; the returned sample has the time of the clock then."""

    def step(self, command: ArrayLike) -> Sample:
        """Send a command (n,) [m or rad] and let one control period pass."""

    def close(self) -> None:
        """Stop the motors and release all resources; a second call does nothing."""


def reset_unless(rig: Rig, must_stop: Callable[[], bool]) -> Sample:
    """`rig.reset`, which may move motors for seconds, to be stopped once `must_stop` is true.

    It is called periodically in another thread; an error of it is a stop, because nothing else
    could stop the motors then. A rig with a method `interrupt`, as `MotorRig`, is quick-stopped at
    once; any other one is to be closed when its `reset` has ended.

    Raises:
        StateError: It was stopped; also other errors of `reset` may then be raised.
    """
    is_over, is_stopping = threading.Event(), threading.Event()
    interrupt: Callable[[], None] = getattr(rig, "interrupt", lambda: None)
    what = _STOPPED

    def watch() -> None:
        nonlocal what
        while not is_over.wait(_WATCH_PERIOD):
            try:
                if must_stop():
                    is_stopping.set()
            except Exception as error:
                what = f"{_STOPPED} ({type(error).__name__}: {error})"
                is_stopping.set()
            if is_stopping.is_set():
                interrupt()  # again and again: before the motors are open it has no effect

    thread = threading.Thread(target=watch, name="opening")
    thread.start()
    try:
        sample = rig.reset()
    finally:
        is_over.set()
        thread.join()
    if is_stopping.is_set():
        raise StateError("rig", what, "Enable it again")
    return sample


def disable(rig: Rig) -> None:
    """`disable` of a rig that has it, as `MotorRig`: nothing holds its motors; else `close`."""
    end: Callable[[], None] = getattr(rig, "disable", rig.close)
    end()


def apply_reaction(rig: Rig, supervision: Supervision) -> None:
    """Apply a quick stop or disable of the supervisor to a rig, and raise it.

    For the `watch` of `run_experiment`, so that it is in the tick of the decision.

    Raises:
        DriveError: The motors were stopped; its notes say so if they may still move.
    """
    reaction = supervision.reaction
    if reaction.rank < Reaction.QUICK_STOP.rank:
        return
    is_disabled = reaction is Reaction.DISABLE
    is_without_power = is_disabled and hasattr(rig, "disable")
    done, failed = f"The motors are {'without power' if is_without_power else 'stopped'}. ", ""
    try:
        disable(rig) if is_disabled else rig.close()
    except TautscopeError as error:
        done, failed = "", described(error)
    stop = DriveError(
        "loop",
        f"{reaction} ({', '.join(supervision.flags)})",
        f"{done}docs/safety.md explains the flags; the log shows the cause",
    )
    stop.exit_status = STOPPED
    if failed:
        stop.add_note(failed)
    raise stop


def check_sample(sample: Sample, config: Config) -> Sample:
    """The sample, where its parts are as `Sample` says.

    Raises:
        SignalError: The rig returned something else, a time that is not finite, or an array of
            another length; the error names the part.
    """
    if not isinstance(sample, Sample):
        raise SignalError("sample", type(sample).__name__, "a tautscope.Sample from the rig")
    count = len(config.dofs)
    check_time("sample.time", sample.time)
    allowed = f"an array ({count},), one number per degree of freedom"
    for name in ("applied", "true_state"):
        value = getattr(sample, name)
        if value is None:
            if name == "true_state":
                continue
            raise SignalError(f"sample.{name}", value, allowed)
        shape = as_numbers(f"sample.{name}", value, allowed).shape
        if shape != (count,):
            raise SignalError(f"sample.{name}", f"an array {shape}", allowed)
    if not isinstance(sample.frame, Frame | None):
        raise SignalError("sample.frame", type(sample.frame).__name__, "a tautscope.Frame or None")
    for one in sample.measurements:
        if not isinstance(one, Tip | Pose | Points):
            allowed = "a Tip, Pose or Points, or several in a tuple"
            raise SignalError("sample.measurement", type(one).__name__, allowed)
        check_time("sample.measurement.captured_at", one.captured_at)
    return sample
