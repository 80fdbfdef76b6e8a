"""Simulated views of a board: corners projected by OpenCV, and rendered images."""

import cv2
import numpy as np
from tautscope.calibration.camera.board import MODULES, Board, View
from tautscope.calibration.camera.intrinsics import Intrinsics
from tautscope.config import Config, load_config
from tautscope.twin.board import BoardCamera, random_poses

BOARD = Board()
EXTENT = BOARD.columns * BOARD.square, BOARD.rows * BOARD.square
CONFIG = load_config()
SIZE = CONFIG.camera.width, CONFIG.camera.height
FISHEYE = Intrinsics(SIZE, "fisheye", (330.0, 340.0), (355.0, 290.0), (0.05, -0.02, 0.004, -0.001))


def values(camera: Intrinsics) -> np.ndarray:
    """Focal lengths, centre, distortion."""
    return np.array([*camera.focal, *camera.centre, *camera.distortion])


def pinhole(config: Config = CONFIG) -> Intrinsics:
    camera = config.camera
    focal, centre = (camera.fx, camera.fy), (camera.cx, camera.cy)
    return Intrinsics(SIZE, "pinhole", focal, centre, camera.distortion[:5])


def projected_views(camera: Intrinsics, seed: int, noise: float = 0.06) -> list[View]:
    """30 views with normally distributed errors of the corners [px]."""
    random = np.random.default_rng(seed)
    corners = np.array(
        [
            (BOARD.square * (column + 1), BOARD.square * (row + 1), 0)
            for row in range(BOARD.rows - 1)
            for column in range(BOARD.columns - 1)
        ]
    )
    views = []
    for turn, shift in random_poses(CONFIG.camera, EXTENT, 30, seed):
        if camera.model == "fisheye":
            pixels, _ = cv2.fisheye.projectPoints(
                corners[:, None], turn, shift, camera.matrix, np.array(camera.distortion)
            )
        else:
            pixels, _ = cv2.projectPoints(
                corners, turn, shift, camera.matrix, np.array(camera.distortion)
            )
        pixels = pixels.reshape(-1, 2) + noise * random.standard_normal((len(corners), 2))
        inside = ((pixels > 5) & (pixels < np.array(SIZE) - 5)).all(axis=1)
        if inside.sum() >= 12:
            ids = np.flatnonzero(inside).astype(np.int32)
            points = corners[inside].astype(np.float32)
            views.append(View(ids, points, pixels[inside].astype(np.float32), 0.0))
    return views


def rendered(config: Config, count: int) -> list[np.ndarray]:
    """Images of the board in random poses, with the seed of the twin."""
    scale = 10
    camera = BoardCamera(config, BOARD.texture(scale), BOARD.square / (MODULES * scale))
    poses = random_poses(config.camera, EXTENT, count, config.twin.seed)
    return [camera.draw(*pose, sequence) for sequence, pose in enumerate(poses)]
