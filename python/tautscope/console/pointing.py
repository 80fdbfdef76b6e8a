"""Motion of the reference towards a pixel of the image, by the loop's model of the image."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from tautscope.loop.kinematics import Floats

Point = tuple[float, float]
SLOWING_TIME = 0.2
"""Time at full speed to the pixel below which motion slows down [s]; the distance then falls by a
factor e in this time."""
REST_DISTANCE = 0.5
"""Distance to the pixel below which motion rests, and what motion has at least to gain [px]."""


class Pointing:
    """Velocities that move the image of the reference towards a pixel.

    The image of the reference is the centre of the distal band, Eqs. (7)-(9). With e (2,) [px] from
    it to the pixel, J (2, n) its derivative, A = J diag(s) for the largest speeds s (n,), the width
    W [px] of the image and the control period T, the velocity is

        v = s w / max(SLOWING_TIME, |w|_inf),  w = A^T (A A^T + d I)^-1 e,
        d = |e| (W / 2) max(s)^2 T / SLOWING_TIME,

    the damped least-squares inverse (Nakamura and Hanafusa, 1986). As e^T A w >= 0, and as d bounds
    a step where a turn by max(s) curves the path of the image by up to (W / 2) max(s)^2, the
    distance falls until the pixel is reached or no velocity lessens it.

    Insertion takes no part: the image barely shows motion along the optical axis, and the other two
    degrees of freedom reach a pixel without it.

    Wrong when the geometry of camera or instrument is. Instruments with [[dof]] have none.
    """

    def __init__(self, config: Config) -> None:
        self._model: Final = build_feature_model(config)
        self._size: Final = config.camera.width, config.camera.height

    def is_in_image(self, point: Point) -> bool:
        """Whether a point (u, v) [px] is in the image; false for NaN."""
        return all(0 <= x <= size for x, size in zip(point, self._size, strict=True))

    def velocity(
        self,
        reference: Floats,
        point: Point,
        speed: Floats,
        period: float,
        is_blocked: Callable[[Floats], NDArray[np.bool_]],
    ) -> Floats:
        """The velocity (3,) [m/s, rad/s, rad/s]; zero where the model has no image of the bands.

        Args:
            reference: u (3,) [m, rad, rad].
            point: (u, v) [px].
            speed: s (3,) [m/s, rad/s, rad/s]; a DOF with speed zero takes no part.
            period: Control period [s]: no state without an image is entered in it.
            is_blocked: Which DOFs (3,) may not move as in a direction (3,).
        """
        rest = np.zeros_like(reference)
        predicted = self._model.predict(reference)
        if predicted is None:
            return rest
        features, jacobian = predicted
        error, speed = np.array(point) - features[2:], speed.copy()
        speed[Dof.INSERTION] = 0
        # What gains only beyond the end of its travel takes no part; the others do what they can.
        speed[is_blocked(jacobian[2:].T @ error)] = 0
        distance = np.linalg.norm(error)
        if distance < REST_DISTANCE or not speed.any():
            return rest
        curvature = self._size[0] / 2 * np.max(speed) ** 2
        damping = distance * curvature * period / SLOWING_TIME
        while True:
            by_speed = jacobian[2:] * speed
            square = by_speed @ by_speed.T + damping * np.eye(2)
            times = by_speed.T @ np.linalg.solve(square, error)
            blocked = is_blocked(times)
            if not blocked.any():
                break
            speed[blocked] = 0
        if np.linalg.norm(by_speed @ times) < REST_DISTANCE:
            return rest
        velocity: Floats = speed * times / max(SLOWING_TIME, np.max(np.abs(times)))
        following = self._model.predict(reference + velocity * period)
        return rest if following is None else velocity
