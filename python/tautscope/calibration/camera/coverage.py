"""Choice of views of a board: how well they cover the image, and what to show next."""

from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.camera.board import LARGEST_SATURATED_SHARE, Board, View
from tautscope.calibration.images import SATURATED, Image
from tautscope.errors import CalibrationError

_COLUMN_NAMES = ("left", "centre left", "centre right", "right")
_ROW_NAMES = ("upper", "", "lower")
COLUMNS, ROWS = len(_COLUMN_NAMES), len(_ROW_NAMES)
"""Cells of the image."""
LEAST_CORNERS = 6
"""A cell is covered by so many corners of all views."""
LEAST_VIEWS = 15
LEAST_TILTED = 2
"""Views of each tilt: the left, right, upper and lower edge of the board nearer to the camera."""
LEAST_TILT = 0.12
"""A board is tilted if its depth changes by more over its width or height [share]."""

MOST_VIEWS = 60
"""A stream gives no more views, but for those with what is lacking."""
LARGEST_MOTION = 1.0
"""A view of a stream is used if its corners moved less since the last image on average [px]."""
LEAST_DIFFERENCE = 0.04
"""And if they differ from those of every view so far on average [width of the image]."""
_TILTS = ("left", "right", "upper", "lower")


@dataclass(eq=False)
class Coverage:
    """Cells of the image in which corners were seen, and tilts of the board.

    Attributes:
        size: Width and height of the images [px].
        corners: (ROWS, COLUMNS) corners seen per cell.
        tilts: Views per tilt.
    """

    size: tuple[int, int]
    board: Board
    corners: NDArray[np.int64] = field(default_factory=lambda: np.zeros((ROWS, COLUMNS), np.int64))
    tilts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(_TILTS, 0))
    views: int = 0

    def add(self, view: View) -> None:
        """Count a view."""
        np.add.at(self.corners, self._cells(view), 1)
        for tilt in self._tilts(view):
            self.tilts[tilt] += 1
        self.views += 1

    def is_lacking(self, view: View) -> bool:
        """Whether a view has corners in a cell, or a tilt, that is lacking."""
        has_new_tilt = any(self.tilts[tilt] < LEAST_TILTED for tilt in self._tilts(view))
        return has_new_tilt or not self.covered[self._cells(view)].all()

    def _cells(self, view: View) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the cells of a view's corners."""
        cells = np.array([COLUMNS, ROWS])
        columns, rows = np.clip(view.pixels * cells // self.size, 0, cells - 1).astype(int).T
        return rows, columns

    def _tilts(self, view: View) -> list[str]:
        across, down = _tilt(view, self.board)
        values = zip(_TILTS, (across, -across, down, -down), strict=True)
        return [tilt for tilt, value in values if value > LEAST_TILT]

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(ROWS, COLUMNS), True for cells with enough corners."""
        return self.corners >= LEAST_CORNERS

    @property
    def is_complete(self) -> bool:
        """Whether the views suffice."""
        return not self.next_steps()

    def next_steps(self) -> list[str]:
        """What to show next, the most useful first; empty if the views suffice."""
        steps = []
        if not self.covered.all():
            row, column = divmod(int(self.corners.argmin()), COLUMNS)
            place = f"{_ROW_NAMES[row]} {_COLUMN_NAMES[column]}".strip()
            steps.append(f"show the board at the {place} of the image")
        lacking = [tilt for tilt in _TILTS if self.tilts[tilt] < LEAST_TILTED]
        if lacking:
            edges = " or ".join(lacking)
            steps.append(f"tilt the board by about 30 degrees, its {edges} edge nearer")
        if self.views < LEAST_VIEWS:
            steps.append(f"show the board in other poses ({LEAST_VIEWS - self.views} to go)")
        return steps

    def text(self) -> str:
        """One line: views, covered cells row by row, tilts."""
        cells = "/".join("".join("#" if one else "." for one in row) for row in self.covered)
        tilts = sum(min(count, LEAST_TILTED) for count in self.tilts.values())
        return f"views {self.views}, cells {cells}, tilts {tilts} of {4 * LEAST_TILTED}"


class ViewCollector:
    """Collects views of a board, and counts why images are not used.

    Args:
        board: The board.
        size: Width and height of the images [px].
        is_stream: Whether images are consecutive; then only views at rest that differ are used.

    Attributes:
        views, coverage: The views used, and how they cover the image.
        rejected: Number of images not used, by reason.
    """

    def __init__(self, board: Board, size: tuple[int, int], *, is_stream: bool) -> None:
        self.views: list[View] = []
        self.coverage = Coverage(size, board)
        self.rejected: Counter[str] = Counter()
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
        if not (steps := self.coverage.next_steps()):
            return
        reasons = [f"{count} images {reason}" for reason, count in self.rejected.most_common()]
        what = "; ".join([f"Too little of the image is covered: {self.coverage.text()}", *reasons])
        raise CalibrationError(what, f"To continue, {', '.join(steps)}")

    def _reason(self, image: Image) -> str:
        """Why an image is not used; empty if it is."""
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        width, height = self.coverage.size
        if grey.shape != (height, width):
            return f"not of the size {width} x {height}"
        view = self.coverage.board.find(grey)
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
        if len(self.views) >= MOST_VIEWS and not self.coverage.is_lacking(view):
            return "beyond the number needed"
        if last is None or _distance(view, last) > LARGEST_MOTION:
            return "with the board in motion"
        least = LEAST_DIFFERENCE * self.coverage.size[0]
        if any(_distance(view, other) < least for other in self.views):
            return "like others"
        return ""


def _distance(one: View, other: View) -> float:
    """Mean distance of the corners that both have [px]; infinite without any."""
    _, mine, others = np.intersect1d(one.ids, other.ids, return_indices=True)
    distances = np.linalg.norm(one.pixels[mine] - other.pixels[others], axis=1)
    return float(distances.mean()) if len(distances) else float("inf")


def _tilt(view: View, board: Board) -> tuple[float, float]:
    """Relative decrease of depth from right to left and from bottom to top of the whole board."""
    homography, _ = cv2.findHomography(view.points[:, :2], view.pixels)
    if homography is None:
        return 0.0, 0.0
    width, height = board.columns * board.square, board.rows * board.square
    by_x, by_y, at_origin = homography[2]
    depth = by_x * width / 2 + by_y * height / 2 + at_origin
    return float(by_x * width / depth), float(by_y * height / depth)
