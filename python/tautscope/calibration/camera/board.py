"""A ChArUco board: its print, and its corners in an image."""

from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import SATURATED, Image
from tautscope.errors import FieldError

MODULES = 8
"""Modules (black or white cells) per side of a square; a marker has 6."""
LEAST_CORNERS = 8
"""An image with fewer corners of the board is not a view."""
LARGEST_SATURATED_SHARE = 0.2
"""A view with more overexposed pixels within its corners is rejected: white spreads over edges."""
_PIXELS_PER_MODULE = 20
_A4 = 0.210, 0.297
_INCH = 0.0254


@dataclass(frozen=True, eq=False)
class View:
    """The corners of the board in one image.

    Attributes:
        ids: (n,) numbers of the corners.
        points: (n, 3) [m] corners in the board's frame, z = 0; float32, as OpenCV takes them.
        pixels: (n, 2) [px] the same corners in the image; float32.
        saturated: Share of overexposed pixels within the corners.
    """

    ids: NDArray[np.int32]
    points: NDArray[np.float32]
    pixels: NDArray[np.float32]
    saturated: float


@dataclass(frozen=True)
class Board:
    """A ChArUco board: a chessboard with ArUco markers of dictionary 4X4_250 in its white squares.

    Args:
        columns, rows: Squares.
        square: Side of a square [m], as measured on the print.

    Raises:
        FieldError: The board is smaller than 4 x 4 or larger than 20 x 20 squares, or the square
            has no size.
    """

    columns: int = 9
    rows: int = 7
    square: float = 4e-3

    def __post_init__(self) -> None:
        for name, value in (("columns", self.columns), ("rows", self.rows)):
            if not 4 <= value <= 20:
                raise FieldError(name, value, "4 to 20 squares")
        if not 0 < self.square < 1:
            raise FieldError("square", self.square, "the side of a square in m, below 1")

    def texture(self, pixels_per_module: int) -> Image:
        """The board as an image (rows, columns); each square has `MODULES` modules."""
        image = self._board.generateImage((self.columns * MODULES, self.rows * MODULES))
        modules = np.asarray(image, np.uint8)
        return modules.repeat(pixels_per_module, axis=0).repeat(pixels_per_module, axis=1)

    def write_pdf(self, path: Path) -> None:
        """Write the board in true scale on a page of A4, with a ruler to check the print."""
        from matplotlib.figure import Figure  # noqa: PLC0415

        width, height = self.columns * self.square, self.rows * self.square
        page = (_A4[1], _A4[0]) if width > _A4[0] - 0.02 else _A4
        if width > page[0] - 0.02 or height > page[1] - 0.05:
            raise FieldError("square", self.square, "a board that fits on A4")
        figure = Figure(figsize=(page[0] / _INCH, page[1] / _INCH))
        left, top = (page[0] - width) / 2, page[1] - 0.02
        area = left / page[0], (top - height) / page[1], width / page[0], height / page[1]
        board = figure.add_axes(area)
        board.imshow(self.texture(_PIXELS_PER_MODULE), cmap="gray", interpolation="none")
        board.set_axis_off()
        whole = 0, 0, 1, 1
        scale = figure.add_axes(whole, facecolor="none", xlim=(0, page[0]), ylim=(0, page[1]))
        scale.set_axis_off()
        start, below = page[0] / 2 - 0.025, top - height - 0.012
        for k in range(6):
            scale.plot([start + 0.01 * k] * 2, [below, below + 0.002], "k", linewidth=0.5)
        scale.plot([start, start + 0.05], [below, below], "k", linewidth=0.5)
        text = (
            f"50 mm. Print at 100 %, and measure this line and the squares.\nChArUco, "
            f"{self.columns} x {self.rows} squares of {1e3 * self.square:g} mm, markers 4X4_250. "
            "Glue it on a flat plate; matt paper."
        )
        scale.text(page[0] / 2, below - 0.002, text, ha="center", va="top", fontsize=7)
        data = BytesIO()  # the PDF of a file that cannot be written ends in another error
        figure.savefig(data, format="pdf", dpi=figure.dpi)
        path.write_bytes(data.getvalue())

    def find(self, grey: Image) -> View | None:
        """Find the board's corners in a grey image; None with fewer than `LEAST_CORNERS`."""
        pixels, ids, _, _ = self._detector.detectBoard(grey)
        if ids is None or len(ids) < LEAST_CORNERS:
            return None
        ids = np.asarray(ids, np.int32).ravel()
        points = np.asarray(self._board.getChessboardCorners(), np.float32)[ids]
        if len(np.unique(points[:, 0])) < 3 or len(np.unique(points[:, 1])) < 3:
            return None
        corners = np.asarray(pixels, np.float32).reshape(-1, 2)
        inside = np.zeros_like(grey)
        cv2.fillConvexPoly(inside, cv2.convexHull(corners).astype(np.int32), 1)
        return View(ids, points, corners, float((grey[inside > 0] >= SATURATED).mean()))

    @cached_property
    def _board(self) -> cv2.aruco.CharucoBoard:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
        size = self.columns, self.rows
        return cv2.aruco.CharucoBoard(size, self.square, 0.75 * self.square, dictionary)

    @cached_property
    def _detector(self) -> cv2.aruco.CharucoDetector:
        return cv2.aruco.CharucoDetector(self._board)
