"""ROS camera_info files (YAML), as of camera_calibration_parsers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeGuard

from tautscope.calibration.camera.intrinsics import Intrinsics, Model
from tautscope.errors import FieldError, MissingPathError

_MODELS: dict[str, tuple[Model, tuple[int, ...]]] = {
    "plumb_bob": ("pinhole", (4, 5)),
    "rational_polynomial": ("pinhole", (8,)),
    "equidistant": ("fisheye", (4,)),
}
"""ROS's distortion model -> ours, and the allowed numbers of coefficients."""
_SKEW = 5e-3
"""Largest skew of a fisheye lens, as a share of its focal length: a pixel at the edge."""


def camera_info(camera: Intrinsics) -> str:
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
    return (
        f"image_width: {width}\nimage_height: {height}\ncamera_name: camera\n"
        + _matrix("camera_matrix", 3, 3, (fx, 0, cx, 0, fy, cy, 0, 0, 1))
        + f"distortion_model: {model}\n"
        + _matrix("distortion_coefficients", 1, len(coefficients), coefficients)
        + _matrix("rectification_matrix", 3, 3, (1, 0, 0, 0, 1, 0, 0, 0, 1))
        + _matrix("projection_matrix", 3, 4, (fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0))
    )


def read_camera_info(path: Path) -> Intrinsics:
    """Read a camera_info file of an unrectified camera, or what `ros2 topic echo` prints of one.

    A small skew of a fisheye lens, as OpenCV fits it, is left out.

    Raises:
        MissingPathError: The file does not exist.
        FieldError: A value is missing or of the wrong kind, or the distortion model is unknown.
    """
    if not path.is_file():
        raise MissingPathError("camera_info", str(path), "a ROS camera_info file (YAML)")
    document = _document(path)
    width, height = (_count(path, document, f"image_{side}", side) for side in ("width", "height"))
    matrix = _numbers(path, document, "camera_matrix", "k")
    if len(matrix) != 9:
        raise FieldError(f"{path}: camera_matrix", len(matrix), "9 numbers")
    name = str(document.get("distortion_model"))
    coefficients = _numbers(path, document, "distortion_coefficients", "d")
    if name not in _MODELS:
        allowed = "one of " + ", ".join(_MODELS)
        raise FieldError(f"{path}: distortion_model", name, allowed)
    model, counts = _MODELS[name]
    while len(coefficients) > counts[-1] and coefficients[-1] == 0:
        coefficients.pop()
    if len(coefficients) not in counts:
        allowed = " or ".join(map(str, counts)) + " numbers"
        raise FieldError(f"{path}: distortion_coefficients", len(coefficients), allowed)
    if model == "pinhole" and len(coefficients) == 4:
        coefficients = [*coefficients, 0.0]
    fx, skew, cx, _, fy, cy = matrix[:6]
    if abs(skew) > (_SKEW * fx if model == "fisheye" else 0) or not (fx > 0 and fy > 0):
        raise FieldError(f"{path}: camera_matrix", matrix, "focal lengths above 0 and no skew")
    return Intrinsics((width, height), model, (fx, fy), (cx, cy), tuple(coefficients))


def _document(path: Path) -> dict[str, Any]:
    """The first document of a YAML file, with small letters in its keys."""
    from ruamel.yaml import YAML  # noqa: PLC0415  only files of others need it
    from ruamel.yaml.error import YAMLError  # noqa: PLC0415

    text = path.read_text(encoding="utf-8", errors="replace")
    expected = "YAML as of ROS's camera_calibration"
    if text.lstrip().startswith("<") or "!!opencv-matrix" in text:
        raise FieldError(
            "camera_info", f"a file of OpenCV, {path}", f"{expected}: copy its numbers"
        )
    try:
        documents = YAML(typ="safe", pure=True).load_all(text)
        found: object = next((each for each in documents if each is not None), {})
    except (YAMLError, ValueError, RecursionError):
        raise FieldError("camera_info", str(path), expected) from None
    if not isinstance(found, dict):
        raise FieldError("camera_info", str(path), expected)
    if any(isinstance(each, dict) and "intrinsics" in each for each in found.values()):
        copied = f"{expected}: copy intrinsics (fx, fy, cx, cy) and distortion_coeffs"
        raise FieldError("camera_info", f"a file of Kalibr, {path}", copied)
    return {str(name).lower(): value for name, value in found.items()}


def _matrix(name: str, rows: int, columns: int, values: Sequence[float]) -> str:
    data = ", ".join(repr(float(value)) for value in values)
    return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"


def _count(path: Path, document: dict[str, Any], *names: str) -> int:
    value = next((document[name] for name in names if name in document), None)
    if not _is_number(value) or value < 1 or value % 1:
        raise FieldError(f"{path}: {names[0]}", value, "a whole number, at least 1")
    return int(value)


def _numbers(path: Path, document: dict[str, Any], *names: str) -> list[float]:
    """Numbers of a matrix with rows, cols and data, or of a list."""
    value = next((document[name] for name in names if name in document), None)
    data = value.get("data") if isinstance(value, dict) else value
    field, allowed = f"{path}: {names[0]}.data", "a list of finite numbers"
    if not isinstance(data, list) or not data:
        raise FieldError(field, data, allowed)
    for each in data:
        if not _is_number(each):
            raise FieldError(field, each, allowed)
    return [float(each) for each in data]


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e100
