"""The command `tautscope calibrate camera`."""

import json
import tomllib
from pathlib import Path

import av
import cv2
import matplotlib as mpl
import numpy as np
import pytest
from boards import CONFIG, rendered
from refused import failed
from tautscope.calibration.camera.camera_info import read_camera_info
from tautscope.cli import main
from tautscope.commands import board_images
from tautscope.config import CameraConfig, load_config
from tautscope.config.load import config_file
from tautscope.config.placeholders import placeholders
from tautscope.errors import CameraError
from tautscope.hardware.cameras import CameraState
from tautscope.hardware.cameras import Capture as CapturedFrame
from tautscope.loop.rig import Frame
from tautscope.twin.drawn_rig import draw_rig

Capture = pytest.CaptureFixture[str]
COMMAND = ("calibrate", "camera")
KEYS = ("fx", "fy", "cx", "cy")


@pytest.fixture(scope="module")
def images() -> list[np.ndarray]:
    """The board in 16 poses, seed 0."""
    return rendered(CONFIG, 16)


@pytest.fixture
def files(tmp_path: Path, images: list[np.ndarray]) -> list[str]:
    paths = [tmp_path / f"{k}.png" for k in range(len(images))]
    for path, image in zip(paths, images, strict=True):
        cv2.imwrite(str(path), image)
    return [str(path) for path in paths]


def test_the_twin_is_calibrated_into_a_file(capsys: Capture, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(config_file("article_rig").read_text())
    out, ros = tmp_path / "out", tmp_path / "camera.yaml"
    options = ("--config", str(rig), "--write", "--out", str(out), "--ros", str(ros), "--json")
    assert main([*COMMAND, "--twin", "--seed", "5", *options]) == 0
    printed, progress = capsys.readouterr()
    found, actual = json.loads(printed), draw_rig(load_config("article_rig"), 5).camera
    config = load_config(rig)
    for key in KEYS:
        std = found["std"][f"camera.{key}"]
        assert abs(getattr(config.camera, key) - getattr(actual, key)) < 4.5 * std
    for k, value in enumerate(config.camera.distortion[:5]):
        std = found["std"][f"camera.distortion[{k}]"]
        assert abs(value - actual.distortion[k]) < 4.5 * std
    record = config.calibration.camera
    assert record is not None
    assert record.std == found["std"]
    assert record.residual == found["residual"] < 0.2
    assert "camera.fx" not in placeholders(rig)
    assert "complete" in progress.splitlines()[-1]
    assert sorted(path.name for path in out.iterdir()) == ["camera.png", "values.toml"]
    assert tomllib.loads((out / "values.toml").read_text())["camera"]["fx"] == config.camera.fx
    assert read_camera_info(ros).focal[0] == pytest.approx(config.camera.fx, abs=0.1)


def test_image_files_and_a_video_give_the_same_camera(
    capsys: Capture, tmp_path: Path, files: list[str], images: list[np.ndarray]
) -> None:
    assert main([*COMMAND, *files]) == 0
    camera = tomllib.loads(capsys.readouterr().out)["camera"]
    # Each pose is shown for three frames; of a stream, only images at rest are used.
    video = tmp_path / "board.mkv"
    with av.open(str(video), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = images[0].shape[1], images[0].shape[0], "bgr0"
        for image in np.repeat(images, 3, axis=0):
            frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format="bgr0")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    assert main([*COMMAND, str(video), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)["values"]
    for key in KEYS:
        assert values[f"camera.{key}"] == pytest.approx(camera[key], abs=0.5)


def test_a_ros_file_becomes_a_section(capsys: Capture, tmp_path: Path, files: list[str]) -> None:
    ros = tmp_path / "camera.yaml"
    assert main([*COMMAND, *files, "--ros", str(ros), "--model", "fisheye"]) == 0
    fitted = tomllib.loads(capsys.readouterr().out)["camera"]
    assert "equidistant" in ros.read_text()
    assert main([*COMMAND, str(ros)]) == 0
    imported = tomllib.loads(capsys.readouterr().out)["camera"]
    assert imported["distortion"] == pytest.approx(fitted["distortion"], rel=1e-3, abs=1e-3)
    assert imported["distortion"][5] != 0
    copy = tmp_path / "copy.yaml"
    assert main([*COMMAND, str(ros), "--ros", str(copy)]) == 0
    assert read_camera_info(copy) == read_camera_info(ros)


def test_the_board_has_true_scale(capsys: Capture, tmp_path: Path) -> None:
    file = tmp_path / "board.pdf"
    with mpl.rc_context({"pdf.compression": 0}):
        assert main([*COMMAND, "--board", str(file), "--square", "0.01"]) == 0
    assert "100 %" in capsys.readouterr().out
    words = file.read_bytes().split()
    points = 72 / 25.4
    assert float(words[words.index(b"/MediaBox") + 4]) == pytest.approx(210 * points, abs=0.01)
    # The image is a unit square, transformed by "width 0 0 -height 0 height cm /I1 Do".
    draw = words.index(b"Do")
    assert words[draw - 2] == b"cm"
    width, height = float(words[draw - 8]), -float(words[draw - 5])
    assert width == pytest.approx(90 * points, rel=1e-3)
    assert height == pytest.approx(70 * points, rel=1e-3)
    assert "a file that does not exist yet" in failed(capsys, *COMMAND, "--board", str(file))
    large = str(tmp_path / "large.pdf")
    assert "fits on A4" in failed(capsys, *COMMAND, "--board", large, "--square", "0.1")


def test_refusals_write_nothing(capsys: Capture, tmp_path: Path, files: list[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[camera]\nwidth = 720\n")
    text = tmp_path / "text.mp4"
    text.write_text("not a video")
    before = set(tmp_path.iterdir())
    out = ("--config", str(rig), "--write", "--out", str(tmp_path / "out"))
    assert main([*COMMAND, *files[:4], *out]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "Too little of the image is covered" in error
    assert "show the board at the" in error
    assert "--config" in failed(capsys, *COMMAND, *files, "--write")
    assert "a file of your own" in failed(capsys, *COMMAND, "--config", "bench", "--write")
    assert "--twin: got True, expected no files" in failed(capsys, *COMMAND, files[0], "--twin")
    assert "--twin" in failed(capsys, *COMMAND)
    assert "File not found" in failed(capsys, *COMMAND, str(tmp_path / "none.mp4"))
    assert "a video file that FFmpeg reads" in failed(capsys, *COMMAND, str(text))
    assert set(tmp_path.iterdir()) == before
    assert rig.read_text() == "[camera]\nwidth = 720\n"


class Interrupted:
    """A camera without images, twice: the second time it stays away."""

    ages = iter([0.1, 2.1, 2.2, None, 2.5, 4.9, 5.1])

    def __init__(self, config: CameraConfig) -> None:
        self._age: float | None = None

    def __enter__(self) -> "Interrupted":
        return self

    def __exit__(self, *failure: object) -> None:
        pass

    def newest(self) -> CapturedFrame | None:
        self._age = next(self.ages)
        image = np.zeros((576, 720, 3), np.uint8)
        return CapturedFrame(Frame(image, 0.0, 0), 0.0) if self._age is None else None

    @property
    def state(self) -> CameraState:
        assert self._age is not None
        return CameraState(age=self._age, trouble=f"no frame for {self._age} s" * (self._age > 2))


def test_a_lost_camera_is_named_and_ends_the_calibration(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(board_images, "Camera", Interrupted)
    images = board_images.live_images(CONFIG, 60.0).images
    assert next(images).shape == (576, 720, 3)
    with pytest.raises(CameraError, match=r"no frame for 5\.1 s.*lost_timeout, 5 s"):
        next(images)
    told = [line for line in capsys.readouterr().err.splitlines() if "camera:" in line]
    assert told == ["camera: no frame for 2.1 s", "camera: no frame for 2.5 s"]


def test_another_board_is_not_found(capsys: Capture, files: list[str]) -> None:
    assert main([*COMMAND, files[0], "--columns", "12"]) == 2
    assert "images" in capsys.readouterr().err
