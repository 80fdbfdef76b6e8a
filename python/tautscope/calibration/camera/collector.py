"""Choice of views of a board from images or a stream of images."""

from __future__ import annotations

from collections import Counter

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.camera.board import (
    LARGEST_SATURATED_SHARE,
    SATURATED,
    Board,
    View,
)
from tautscope.calibration.camera.coverage import Coverage
from tautscope.errors import CalibrationError

Image = NDArray[np.uint8]

MOST_VIEWS = 60
"""A stream gives no more views."""
LARGEST_MOTION = 1.0
"""A view of a stream is used if its corners moved less since the last image on average [px]."""
LEAST_DIFFERENCE = 0.04
"""And if they differ from those of every view so far on average [width of the image]."""


class ViewCollector:
    """Collects views of a board, and counts why images are not used.

    Args:
        board: The board.
        size: Width and height of the images [px].
        is_stream: Whether images are consecutive; then only views at rest that differ are used.

    Attributes:
        views: The views used.
        coverage: How they cover the image.
        rejected: Number of images not used, by reason.
    """

    def __init__(self, board: Board, size: tuple[int, int], *, is_stream: bool) -> None:
        self.views: list[View] = []
        self.coverage = Coverage(size, board)
        self.rejected: Counter[str] = Counter()
        self._board = board
        self._size = size
        self._is_stream = is_stream
        self._last: View | None = None

    def offer(self, image: Image) -> bool:
        """Look for the board in an image, B, G, R; True if it became a view."""
        reason = self._reason(image)
        if reason:
            self.rejected[reason] += 1
        return not reason

    def status(self) -> str:
        """One line for a person: coverage, and what to show next."""
        steps = self.coverage.next_steps()
        return f"{self.coverage.text()}; " + (f"next: {steps[0]}" if steps else "complete")

    def check(self) -> None:
        """Check that the views suffice.

        Raises:
            CalibrationError: They do not; it says why images were not used, and what to show.
        """
        steps = self.coverage.next_steps()
        if not steps:
            return
        reasons = [f"{count} images {reason}" for reason, count in self.rejected.most_common()]
        what = "; ".join([f"Too little of the image is covered: {self.coverage.text()}", *reasons])
        raise CalibrationError(what, f"To continue, {', '.join(steps)}")

    def _reason(self, image: Image) -> str:
        """Why an image is not used; empty if it is."""
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        if (grey.shape[1], grey.shape[0]) != self._size:
            return f"not of the size {self._size[0]} x {self._size[1]}"
        view = self._board.find(grey)
        last, self._last = self._last, view
        saturated = float((grey >= SATURATED).mean()) if view is None else view.saturated
        if saturated > LARGEST_SATURATED_SHARE:
            return "overexposed"
        if view is None:
            return "without the board"
        reason = self._reason_in_stream(view, last) if self._is_stream else ""
        if not reason:
            self.views.append(view)
            self.coverage.add(view)
        return reason

    def _reason_in_stream(self, view: View, last: View | None) -> str:
        if len(self.views) >= MOST_VIEWS:
            return "beyond the number needed"
        if last is None or _distance(view, last) > LARGEST_MOTION:
            return "with the board in motion"
        least = LEAST_DIFFERENCE * self._size[0]
        if any(_distance(view, other) < least for other in self.views):
            return "like others"
        return ""


def _distance(one: View, other: View) -> float:
    """Mean distance of the corners that both have [px]; infinite without any."""
    common, mine, others = np.intersect1d(
        one.ids, other.ids, assume_unique=True, return_indices=True
    )
    if not len(common):
        return float("inf")
    return float(np.linalg.norm(one.pixels[mine] - other.pixels[others], axis=1).mean())
