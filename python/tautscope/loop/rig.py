"""The interface between the loop and a rig: the twin, hardware, a recording, or your own.

A rig takes commands and returns samples. It owns the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.dof import display_text


@dataclass(frozen=True, slots=True)
class Frame:
    """One camera image.

    Attributes:
        image: Pixels, uint8 (height, width, 3), BGR.
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
        return f"<Frame {self.sequence}: {width} x {height}, captured at {self.captured_at:.3f} s>"


@dataclass(frozen=True, slots=True)
class Sample:
    """What a rig reports after one control period.

    Attributes:
        time: [s, the rig's clock].
        applied: (3,) [m, rad, rad] what the drives report.
        frame: The newest image that arrived in this period, if any.
        true_state: (3,) [m, rad, rad] of the tip; twin only, the loop never reads it.
    """

    time: float
    applied: NDArray[np.float64]
    frame: Frame | None = None
    true_state: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        frame = "no frame" if self.frame is None else f"frame {self.frame.sequence}"
        return f"<Sample at {self.time:.3f} s: applied {display_text(self.applied)}, {frame}>"


@runtime_checkable
class Rig(Protocol):
    """An instrument with drives and a camera."""

    @property
    def control_period(self) -> float:
        """Time from one command to the next [s]."""
        ...

    def reset(self) -> Sample:
        """Go to the start; the returned sample has the time of the clock then."""
        ...

    def step(self, command: ArrayLike) -> Sample:
        """Send a command (3,) [m, rad, rad] and let one control period pass."""
        ...

    def close(self) -> None:
        """Stop the motors and release all resources; a second call does nothing."""
        ...
