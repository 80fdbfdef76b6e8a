"""ROS camera_info files; ruamel.yaml is the oracle of those that are written."""

import re
from pathlib import Path

import pytest
from boards import FISHEYE, SIZE, pinhole
from ruamel.yaml import YAML
from tautscope.calibration.camera.camera_info import camera_info, read_camera_info
from tautscope.calibration.camera.intrinsics import Intrinsics
from tautscope.errors import FieldError, MissingPathError

RATIONAL = Intrinsics(SIZE, "pinhole", (1e3, 1e3), (1.5, 2.5), tuple(0.1 * k for k in range(1, 9)))
ROS = """# As camera_calibration writes it.
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [515.34626,   0.     , 326.92755,
           0.     , 515.76337, 241.83061,
           0.     ,   0.     ,   1.     ]
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.02, 1e-3, -1.5e-05, 0.000000, 0]}
"""


@pytest.mark.parametrize(
    ("camera", "model"),
    [(pinhole(), "plumb_bob"), (RATIONAL, "rational_polynomial"), (FISHEYE, "equidistant")],
)
def test_a_written_file_is_yaml_and_is_read_back(
    tmp_path: Path, camera: Intrinsics, model: str
) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(camera_info(camera))
    assert read_camera_info(file) == camera
    document = YAML(typ="safe").load(file.read_text())
    assert document["distortion_model"] == model
    assert document["camera_name"] == "camera"
    assert (document["image_width"], document["image_height"]) == SIZE
    assert document["camera_matrix"]["data"] == camera.matrix.ravel().tolist()
    assert tuple(document["distortion_coefficients"]["data"]) == camera.distortion
    for name in ("camera_matrix", "rectification_matrix", "projection_matrix"):
        matrix = document[name]
        assert matrix["rows"] * matrix["cols"] == len(matrix["data"])


@pytest.mark.parametrize("head", ["", "%YAML 1.2\n---\n", "---\n"])
def test_a_file_of_ros_is_read(tmp_path: Path, head: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(head + ROS)
    camera = read_camera_info(file)
    assert camera.size == (640, 480)
    assert camera.focal == (515.34626, 515.76337)
    assert camera.centre == (326.92755, 241.83061)
    assert camera.distortion == (-0.02, 1e-3, -1.5e-05, 0, 0)


COEFFICIENTS = "{rows: 1, cols: 5, data: [-0.02, 1e-3, -1.5e-05, 0.000000, 0]}"
assert COEFFICIENTS in ROS
BLOCK = re.sub(
    r"data: \[(.*?)\]",
    lambda found: "data:\n  - " + re.sub(r",\s+", "\n  - ", found[1]),
    ROS.replace(COEFFICIENTS, "\n  rows: 1\n  cols: 5\n  data: " + COEFFICIENTS[24:-1]),
    flags=re.DOTALL,
)
ECHO = """header: {stamp: {sec: 3, nanosec: 8}, frame_id: endo}
height: 480
width: 640
distortion_model: plumb_bob
d: [-0.02, 1e-3, -1.5e-05, 0.0, 0]
k:
- 515.34626
- 0.0
- 326.92755
- 0.0
- 515.76337
- 241.83061
- 0.0
- 0.0
- 1.0
binning_x: 0
---
"""
VARIANTS = {
    "block lists": BLOCK,
    "echo of a message": ECHO,
    "echo of two": ECHO + ECHO.replace("515", "9"),
    "echo in ROS 1": ECHO.replace("d:", "D:").replace("k:", "K:"),
    "a name of digits and letters": ROS.replace("narrow_stereo", "00b09d0100a8f6ac"),
    "a name of digits": ROS.replace("narrow_stereo", "0012"),
    "a name with an exponent": ROS.replace("narrow_stereo", "12e3"),
    "a name in quotes": ROS.replace("narrow_stereo", '"a: b"'),
    "trailing zeros": ROS.replace("0.000000, 0]", "0.000000, 0, 0.0, 0, 0]"),
    "four coefficients": ROS.replace("0.000000, 0]", "0.000000]"),
    "comments": "# left eye\n" + ROS.replace("plumb_bob", "plumb_bob  # Brown"),
    "carriage returns": ROS.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=list(VARIANTS))
def test_variants_of_ros_are_the_same_camera(tmp_path: Path, text: str) -> None:
    files = tmp_path / "plain.yaml", tmp_path / "variant.yaml"
    files[0].write_text(ROS)
    files[1].write_text(text, newline="")
    assert read_camera_info(files[1]) == read_camera_info(files[0])


@pytest.mark.parametrize("skew", [0.0, -0.7, 2.0, 3.0, 50.0])
def test_a_small_skew_of_a_fisheye_is_left_out(tmp_path: Path, skew: float) -> None:
    file = tmp_path / "camera.yaml"
    text = camera_info(FISHEYE)
    matrix = FISHEYE.matrix.ravel().tolist()
    file.write_text(text.replace(f"[{matrix[0]!r}, 0.0,", f"[{matrix[0]!r}, {skew},", 1))
    if abs(skew) <= 5e-3 * matrix[0]:
        assert read_camera_info(file) == FISHEYE
    else:
        with pytest.raises(FieldError, match="no skew"):
            read_camera_info(file)


FOREIGN = {
    "Kalibr": "cam0:\n  camera_model: pinhole\n  intrinsics: [410.5, 411.1, 361.2, 287.9]\n",
    "OpenCV": "<?xml version='1.0'?>\n<opencv_storage><K></K></opencv_storage>\n",
    "OpenCV, ": "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n",
    "expected YAML": "image_width: [\n",
    "expected YAML as": "[1, 2]\n",
}


@pytest.mark.parametrize(("named", "text"), FOREIGN.items())
def test_files_of_other_programs_are_named(tmp_path: Path, named: str, text: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(FieldError, match=named):
        read_camera_info(file)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (ROS, "a: [", "camera_info"),
        (ROS, "", "image_width"),
        ("image_width: 640", "image_width: x", "image_width"),
        ("image_width: 640", "image_width: 0", "width: got 0, expected a whole number, at least 1"),
        ("image_width: 640", "image_width: 640.5", "width: got 640.5, expected a whole number"),
        ("data: [515.34626,", "data: [", "camera_matrix"),
        ("515.34626,   0.     ,", "515.34626,   1.     ,", "no skew"),
        ("plumb_bob", "double_sphere", "plumb_bob, rational_polynomial, equidistant"),
        ("-0.02, 1e-3,", "", "4 or 5 numbers"),
        ("-0.02", ".nan", "data: got nan, expected a list of finite numbers"),
        ("-0.02", "x", "data: got 'x'"),
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, old: str, new: str, named: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(ROS.replace(old, new, 1))
    with pytest.raises(FieldError, match=named):
        read_camera_info(file)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match=r"none\.yaml"):
        read_camera_info(tmp_path / "none.yaml")
