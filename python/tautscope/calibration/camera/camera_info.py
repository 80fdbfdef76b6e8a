"""ROS camera_info files (YAML), as of camera_calibration_parsers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from tautscope.calibration.camera.intrinsics import Intrinsics, Model
from tautscope.errors import FieldError, MissingPathError

_MODELS: dict[str, tuple[Model, tuple[int, ...]]] = {
    "plumb_bob": ("pinhole", (4, 5)),
    "rational_polynomial": ("pinhole", (8,)),
    "equidistant": ("fisheye", (4,)),
}
"""ROS's distortion model -> ours, and the allowed numbers of coefficients."""


def camera_info(camera: Intrinsics, name: str = "camera") -> str:
    """The text of a camera_info file of an unrectified camera."""
    coefficients = camera.distortion
    if camera.model == "fisheye":
        model = "equidistant"
    elif len(coefficients) == 8 and any(coefficients[5:]):
        model = "rational_polynomial"
    else:
        model, coefficients = "plumb_bob", coefficients[:5]
    (fx, fy), (cx, cy) = camera.focal, camera.centre
    width, height = camera.size
    return "".join(
        (
            f"image_width: {width}\nimage_height: {height}\ncamera_name: {name}\n",
            _matrix("camera_matrix", 3, 3, (fx, 0, cx, 0, fy, cy, 0, 0, 1)),
            f"distortion_model: {model}\n",
            _matrix("distortion_coefficients", 1, len(coefficients), coefficients),
            _matrix("rectification_matrix", 3, 3, (1, 0, 0, 0, 1, 0, 0, 0, 1)),
            _matrix("projection_matrix", 3, 4, (fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0)),
        )
    )


def read_camera_info(path: Path) -> Intrinsics:
    """Read a camera_info file of an unrectified camera.

    Raises:
        MissingPathError: The file does not exist.
        FieldError: A value is missing or of the wrong kind, or the distortion model is unknown.
    """
    if not path.is_file():
        raise MissingPathError("camera_info", str(path), "a ROS camera_info file (YAML)")
    text = path.read_text(encoding="utf-8", errors="replace")
    # OpenCV's parser needs its own first line.
    body = re.sub(r"\A(%YAML[^\n]*\n)?(---[^\n]*\n)?", "", text)
    try:
        storage = cv2.FileStorage(
            f"%YAML:1.0\n---\n{body}", cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
        )
    except (cv2.error, SystemError):
        raise FieldError("camera_info", str(path), "YAML as of ROS's camera_calibration") from None
    width, height = (_number(path, storage, f"image_{side}") for side in ("width", "height"))
    matrix = _numbers(path, storage, "camera_matrix")
    if len(matrix) != 9:
        raise FieldError(f"{path}: camera_matrix", len(matrix), "9 numbers")
    name = str(storage.getNode("distortion_model").string())
    coefficients = _numbers(path, storage, "distortion_coefficients")
    if name not in _MODELS:
        allowed = "one of " + ", ".join(_MODELS)
        raise FieldError(f"{path}: distortion_model", name, allowed)
    model, counts = _MODELS[name]
    if len(coefficients) not in counts:
        allowed = " or ".join(map(str, counts)) + " numbers"
        raise FieldError(f"{path}: distortion_coefficients", len(coefficients), allowed)
    if model == "pinhole" and len(coefficients) == 4:
        coefficients = [*coefficients, 0.0]
    fx, skew, cx, _, fy, cy = matrix[:6]
    if skew or not (fx > 0 and fy > 0):
        raise FieldError(f"{path}: camera_matrix", matrix, "focal lengths above 0 and no skew")
    return Intrinsics((int(width), int(height)), model, (fx, fy), (cx, cy), tuple(coefficients))


def _matrix(name: str, rows: int, columns: int, values: Sequence[float]) -> str:
    data = ", ".join(repr(float(value)) for value in values)
    return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"


def _number(path: Path, storage: cv2.FileStorage, name: str) -> float:
    node = storage.getNode(name)
    if not (node.isInt() or node.isReal()) or not node.real() >= 1:
        raise FieldError(f"{path}: {name}", None, "a number above 0")
    return float(node.real())


def _numbers(path: Path, storage: cv2.FileStorage, name: str) -> list[float]:
    data = storage.getNode(name).getNode("data")
    items = [data.at(k) for k in range(data.size())] if data.isSeq() else []
    values = [float(item.real()) for item in items if item.isInt() or item.isReal()]
    if not values or len(values) != len(items) or not np.isfinite(values).all():
        raise FieldError(f"{path}: {name}.data", None, "a list of finite numbers")
    return values
