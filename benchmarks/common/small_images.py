"""Images of fewer pixels, for runs that need only the true features of an image."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config

SMALL = 4
"""Part of the camera's resolution, in each direction."""


def with_small_images(config: Config) -> Config:
    """The same view with fewer pixels, whose centres are at integers in both."""
    camera = config.camera

    def centre(value: float) -> float:
        return (value + 0.5) / SMALL - 0.5

    return config.replace(
        **{
            "camera.width": camera.width // SMALL,
            "camera.height": camera.height // SMALL,
            "camera.fx": camera.fx / SMALL,
            "camera.fy": camera.fy / SMALL,
            "camera.cx": centre(camera.cx),
            "camera.cy": centre(camera.cy),
        }
    )


def full_size(features: ArrayLike) -> NDArray[np.float64]:
    """Features of a small image [px] as those of the camera's own [px]."""
    return (np.asarray(features, np.float64) + 0.5) * SMALL - 0.5
