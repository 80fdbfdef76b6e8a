"""ROS camera_info files; ruamel.yaml is the oracle."""

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
    file.write_text(camera_info(camera, "endoscope"))
    assert read_camera_info(file) == camera
    document = YAML(typ="safe").load(file.read_text())
    assert document["distortion_model"] == model
    assert document["camera_name"] == "endoscope"
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
    document = YAML(typ="safe").load(ROS)
    assert camera.size == (640, 480)
    assert camera.matrix.ravel().tolist() == document["camera_matrix"]["data"]
    assert list(camera.distortion) == document["distortion_coefficients"]["data"]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (ROS, "a: [", "camera_info"),
        (ROS, "", "image_width"),
        ("image_width: 640", "image_width: x", "image_width"),
        ("data: [515.34626,", "data: [", "camera_matrix"),
        ("515.34626,   0.     ,", "515.34626,   1.     ,", "no skew"),
        ("plumb_bob", "double_sphere", "plumb_bob, rational_polynomial, equidistant"),
        ("-0.02, 1e-3,", "", "4 or 5 numbers"),
        ("-0.02", "nan", "finite"),
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
