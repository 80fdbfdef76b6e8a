"""Video files and pixel formats; DV as in the article's rig."""

from pathlib import Path

import numpy as np
import pytest
from tautscope.config import CameraConfig, SourceConfig
from tautscope.errors import CameraError, MissingPathError
from tautscope.hardware.video import Decoder, open_source, read_video
from video_sources import bar, camera, write_dv


@pytest.mark.parametrize("suffix", ["dv", "avi"])
def test_interlaced_video_yields_fields_with_their_times(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"clip.{suffix}"
    write_dv(path, 10)
    frames = list(read_video(str(path), CameraConfig(), start=3.0))
    assert len(frames) == 20
    np.testing.assert_allclose(
        [frame.captured_at for frame in frames], 3.0 + 0.02 * np.arange(20), atol=1e-6
    )
    for field, frame in enumerate(frames):
        assert frame.sequence == field
        assert frame.image.shape == (576, 720, 3)
        for row in (100, 101, 300, 301):  # of both fields
            bright = np.flatnonzero(frame.image[row, :, 1] > 130)
            assert bright[0] == pytest.approx(bar(field), abs=1), (field, row)
            assert len(bright) == pytest.approx(40, abs=3), (field, row)
        assert frame.image.max() > 180


def test_without_deinterlacing_a_frame_holds_both_fields(tmp_path: Path) -> None:
    write_dv(tmp_path / "clip.dv", 3)
    config = CameraConfig(source=SourceConfig(deinterlace="none"))
    frames = list(read_video(str(tmp_path / "clip.dv"), config))
    assert len(frames) == 3
    even, odd = (np.flatnonzero(frames[1].image[row, :, 1] > 130)[0] for row in (100, 101))
    assert (odd, even) == (pytest.approx(bar(2), abs=1), pytest.approx(bar(3), abs=1))


def test_error_names_a_wrong_video_size(tmp_path: Path) -> None:
    write_dv(tmp_path / "clip.dv", 2)
    with pytest.raises(CameraError, match=r"720 x 576.*640 x 480.*calibrate"):
        list(read_video(str(tmp_path / "clip.dv"), CameraConfig(width=640, height=480)))
    with pytest.raises(MissingPathError, match="a video file"):
        list(read_video(str(tmp_path / "none.avi"), CameraConfig()))
    (tmp_path / "text.avi").write_text("not a video")
    with pytest.raises(CameraError, match=r"text\.avi"):
        list(read_video(str(tmp_path / "text.avi"), CameraConfig()))


@pytest.mark.parametrize("name", ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"])
def test_pixel_formats_have_the_same_colours(name: str) -> None:
    """Green, as BT.601 with limited range has it."""
    config = camera("color=0x30c040:size=64x48:rate=25,format=yuv420p", pixel_format=name)
    with open_source(config.source.url, "lavfi") as container:
        image = next(iter(Decoder(container, config))).image
    y, u, v = (
        16
        + np.array(
            [[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]
        )
        @ np.array([0x30, 0xC0, 0x40])
        / 255
        + [0, 112, 112]
    )
    found = {
        "bgr": lambda: image[20, 30],
        "rgb": lambda: image[20, 30][::-1],
        "bgra": lambda: image[20, 30, :3],
        "yuyv": lambda: image[20, 30:32].ravel()[[0, 1, 3]],
        "uyvy": lambda: image[20, 30:32].ravel()[[1, 0, 2]],
        "nv12": lambda: [image[20, 30], *image[48 + 10, 30:32]],
        "i420": lambda: [
            image[20, 30],
            image[48:60].reshape(-1, 32)[10, 15],
            image[60:].reshape(-1, 32)[10, 15],
        ],
    }[name]()
    wanted = [0x40, 0xC0, 0x30] if name in ("bgr", "rgb", "bgra") else [y, u, v]
    np.testing.assert_allclose(np.asarray(found, float), wanted, atol=4)
