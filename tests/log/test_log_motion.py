"""Images and motor positions of a log, for calibration."""

from argparse import Namespace
from pathlib import Path

import av
import numpy as np
import pytest
from tautscope.calibration.bands.motion import MOST_IMAGES, ImageSequence
from tautscope.commands.positions import read_motion
from tautscope.config import load_config
from tautscope.errors import MissingPathError
from tautscope.log.reader import Update, read_log
from tautscope.log.writer import LogSummary
from tautscope.runs.recording import Recording, per_dof


def log_motion(path: Path) -> ImageSequence:
    return read_motion(Namespace(config=None), path, ImageSequence)[0]


def test_images_have_the_positions_of_their_capture(
    recorded: tuple[Path, Recording, LogSummary],
) -> None:
    path, recording, _ = recorded
    found = log_motion(path)
    assert 20 <= len(found.images) <= MOST_IMAGES
    assert (np.diff(found.times) > 0).all()
    log = read_log(path)
    captured = {
        float(event.row[0]): index  # type: ignore[arg-type]
        for index, event in log.events.items()
        if isinstance(event, Update)
    }
    for k in (0, len(found.images) // 2, -1):
        assert np.array_equal(found.images[k], log.image(captured[float(found.times[k])]))
    trace = recording.trace
    for k, dof in enumerate(per_dof(trace, "applied").T):
        expected = np.interp(found.times, trace["time"], dof)
        assert found.positions[:, k] == pytest.approx(expected, abs=1e-9)


def test_the_delay_is_that_which_the_stamps_are_without(
    recorded: tuple[Path, Recording, LogSummary], tmp_path: Path
) -> None:
    """That of the log, and none of a video, whatever the file of ``--config`` says."""
    path, recording, _ = recorded
    config, motors, video = (tmp_path / name for name in ("rig.toml", "motors.csv", "a.mkv"))
    config.write_text("[camera.source]\ndelay = 0.2\n")
    motors.write_text("time,insertion,rotation,bending\n0,0,0,0\n1,0.01,0,0\n")
    with av.open(str(video), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 720, 576, "bgr0"
        blank = av.VideoFrame.from_ndarray(np.zeros((576, 720, 3), np.uint8), format="bgr24")
        container.mux([*stream.encode(blank.reformat(format="bgr0")), *stream.encode(None)])
    options = Namespace(config=str(config), motors=motors, units="", video_start=0.0)
    for file, expected in ((path, recording.config.camera.source.delay), (video, 0.0)):
        used = read_motion(options, file, ImageSequence)[1]
        assert used.camera.source.delay == expected != load_config(config).camera.source.delay


def test_a_missing_log_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPathError):
        log_motion(tmp_path / "none.mcap")
