"""A calibration board that is moved in front of the bench's camera."""

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.camera.board import MODULES, Board
from tautscope.config import Config
from tautscope.twin.board import BoardCamera, random_poses

POSE_PERIOD = 1.0
"""How long the board is held in a pose [s]."""
_POSES = 60


class MovedBoard:
    """The board of `tautscope calibrate camera`, in a new pose every `POSE_PERIOD`."""

    def __init__(self, config: Config) -> None:
        board = Board()
        scale = 10
        self._camera = BoardCamera(config, board.texture(scale), board.square / (scale * MODULES))
        extent = board.columns * board.square, board.rows * board.square
        self._poses = random_poses(config.camera, extent, _POSES, config.twin.seed)
        self._start: float | None = None

    def draw(self, at: float, sequence: int) -> NDArray[np.uint8]:
        """The image at a time of the monotonic clock [s]."""
        self._start = at if self._start is None else self._start
        pose = self._poses[int((at - self._start) / POSE_PERIOD) % len(self._poses)]
        return self._camera.draw(*pose, sequence)
