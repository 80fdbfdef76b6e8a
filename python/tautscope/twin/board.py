"""A simulated calibration board, as the twin's camera sees it."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import CameraConfig, Config
from tautscope.twin.camera import check_pixel_format

Floats = NDArray[np.float64]

_SAMPLES = 2
"""Samples per pixel and axis."""
_SURROUNDINGS = 110
"""Grey level of what surrounds the board."""
_PAPER, _INK = 205.0, 22.0
"""Grey levels of white and black at the centre of the image."""
_FALL_OFF = 0.35
"""Share of the light that is missing at the corners of the image."""
_BLUR = 0.6
"""Standard deviation of the lens's blur [px]."""


class BoardCamera:
    """Renders a flat board: rays of the camera are traced to the board and its print is sampled.

    Pinhole with OpenCV's distortion, Eq. (8), inverted numerically; blur, a fall-off of the light
    towards the corners, and the sensor noise of `twin.image_noise`.

    Args:
        config: Sections camera and twin are used.
        texture: The print (rows, columns), 0 to 255.
        pixel: Side of a pixel of the print [m].
    """

    def __init__(self, config: Config, texture: NDArray[np.uint8], pixel: float) -> None:
        camera = config.camera
        check_pixel_format(camera)
        self._shape = camera.height, camera.width
        self._noise = config.twin.image_noise
        self._seed = config.twin.seed
        self._texture = _INK + (_PAPER - _INK) * texture.astype(np.float32) / 255
        self._pixel = pixel
        u, v = np.meshgrid(_subpixels(camera.width), _subpixels(camera.height))
        self._rays = undistorted(camera, u, v)
        u, v = np.meshgrid(np.linspace(-1, 1, camera.width), np.linspace(-1, 1, camera.height))
        self._light = (1 - _FALL_OFF * (u * u + v * v) / 2).astype(np.float32)

    def draw(self, rotation: ArrayLike, translation: ArrayLike, sequence: int) -> NDArray[np.uint8]:
        """The image (height, width, 3) of the board at a pose.

        Args:
            rotation: Rotation vector (3,) from the board's to the camera's frame [rad].
            translation: Origin of the board, a corner of the print, in the camera's frame [m].
            sequence: Frame number; selects the noise.
        """
        turn, _ = cv2.Rodrigues(np.asarray(rotation, dtype=np.float64))
        to_camera = np.column_stack([turn[:, 0], turn[:, 1], np.asarray(translation)])
        to_board = np.linalg.inv(to_camera)
        x, y = self._rays
        across, down, depth = (
            (row[0] * x + row[1] * y + row[2]).astype(np.float32) for row in to_board
        )
        scale = 1 / (self._pixel * depth)
        sampled = cv2.remap(
            self._texture,
            across * scale - 0.5,
            down * scale - 0.5,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=_SURROUNDINGS,
        )
        grey = cv2.resize(sampled, self._shape[::-1], interpolation=cv2.INTER_AREA)
        grey = cv2.GaussianBlur(grey, (0, 0), _BLUR) * self._light
        random = np.random.default_rng((self._seed, sequence))
        image = np.repeat(grey[..., None], 3, axis=2)
        image += self._noise * random.standard_normal(image.shape, dtype=np.float32)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def undistorted(camera: CameraConfig, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Normalised coordinates x, y of pixels, by fixed-point iteration of Eq. (8)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = camera.distortion
    bent_x, bent_y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    x, y = bent_x, bent_y
    for _ in range(60):
        r = x * x + y * y
        gain = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        new_x = (bent_x - 2 * p1 * x * y - p2 * (r + 2 * x * x)) / gain
        new_y = (bent_y - p1 * (r + 2 * y * y) - 2 * p2 * x * y) / gain
        step = max(np.abs(new_x - x).max(), np.abs(new_y - y).max())
        x, y = new_x, new_y
        if step < 1e-7:
            break
    return x, y


def _subpixels(size: int) -> Floats:
    """Positions of the samples along an axis [px]; pixel centres are at integers."""
    return (np.arange(size * _SAMPLES) + 0.5) / _SAMPLES - 0.5


def random_poses(
    camera: CameraConfig, extent: tuple[float, float], count: int, seed: int
) -> list[tuple[Floats, Floats]]:
    """Poses of a board, of a width and height [m], as a person shows it.

    Everywhere in the image, near and far, tilted; rotation and translation as for
    `BoardCamera.draw`.
    """
    random = np.random.default_rng((seed, 18))
    width, height = extent
    poses = []
    for _ in range(count):
        share = random.uniform(0.45, 0.9)
        depth = camera.fx * width / (share * camera.width)
        u = camera.width * random.uniform(0.15, 0.85)
        v = camera.height * random.uniform(0.15, 0.85)
        x, y = undistorted(camera, np.array([u]), np.array([v]))
        tilt, about = np.radians(random.uniform(10, 40)), random.uniform(0, 2 * np.pi)
        lean, _ = cv2.Rodrigues(tilt * np.array([np.cos(about), np.sin(about), 0]))
        spin, _ = cv2.Rodrigues(np.array([0, 0, random.uniform(-0.3, 0.3)]))
        turn = lean @ spin
        centre = depth * np.array([x[0], y[0], 1.0])
        corner = centre - turn @ np.array([width / 2, height / 2, 0.0])
        poses.append((cv2.Rodrigues(turn)[0].ravel(), corner))
    return poses
