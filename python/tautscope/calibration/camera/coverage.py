"""How well views of a board cover the image, and what to show next."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.camera.board import Board, View

COLUMNS, ROWS = 4, 3
"""Cells of the image."""
LEAST_CORNERS = 6
"""A cell is covered by so many corners of all views."""
LEAST_VIEWS = 15
LEAST_TILTED = 2
"""Views of each tilt: the left, right, upper and lower edge of the board nearer to the camera."""
LEAST_TILT = 0.12
"""A board is tilted if its depth changes by more over its width or height [share]."""

_TILTS = ("left", "right", "upper", "lower")


@dataclass
class Coverage:
    """Cells of the image in which corners were seen, and tilts of the board.

    Args:
        size: Width and height of the images [px].
        board: The board.

    Attributes:
        corners: (ROWS, COLUMNS) corners seen per cell.
        tilts: Views per tilt.
        views: Number of views.
    """

    size: tuple[int, int]
    board: Board
    corners: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((ROWS, COLUMNS), dtype=np.int64)
    )
    tilts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(_TILTS, 0))
    views: int = 0

    def add(self, view: View) -> None:
        """Count a view."""
        width, height = self.size
        columns = np.clip(view.pixels[:, 0] * COLUMNS // width, 0, COLUMNS - 1).astype(int)
        rows = np.clip(view.pixels[:, 1] * ROWS // height, 0, ROWS - 1).astype(int)
        np.add.at(self.corners, (rows, columns), 1)
        across, down = _tilt(view, self.board)
        for tilt, value in zip(_TILTS, (across, -across, down, -down), strict=True):
            self.tilts[tilt] += value > LEAST_TILT
        self.views += 1

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
            least = np.unravel_index(
                np.where(self.covered, 10**9, self.corners).argmin(), (ROWS, COLUMNS)
            )
            steps.append(
                f"show the board at the {_place(int(least[0]), int(least[1]))} of the image"
            )
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


def _tilt(view: View, board: Board) -> tuple[float, float]:
    """Relative decrease of depth from right to left and from bottom to top of the whole board."""
    homography, _ = cv2.findHomography(view.points[:, :2], view.pixels)
    if homography is None:
        return 0.0, 0.0
    width, height = board.columns * board.square, board.rows * board.square
    by_x, by_y, at_origin = homography[2]
    depth = by_x * width / 2 + by_y * height / 2 + at_origin
    return float(by_x * width / depth), float(by_y * height / depth)


def _place(row: int, column: int) -> str:
    vertical = ("upper", "", "lower")[row]
    horizontal = ("left", "centre left", "centre right", "right")[column]
    return f"{vertical} {horizontal}".strip()
