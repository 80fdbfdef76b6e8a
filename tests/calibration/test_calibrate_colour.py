"""The command `tautscope calibrate colour` without masks."""

import base64
import json
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from refused import failed
from tautscope.calibration.bands.motion import ImageSequence, record_motion
from tautscope.calibration.motion import article_sines
from tautscope.cli import main
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.loop.rig import Sample
from tautscope.loop.vision import MarkerDetector
from tautscope.twin.drawn_rig import draw_rig
from tautscope.twin.rig import Twin

Capture = pytest.CaptureFixture[str]
COMMAND = ("calibrate", "colour")
SEED = 4


@pytest.fixture(scope="module")
def motion() -> ImageSequence:
    """Images of a rig that differs from its configuration."""
    config = load_config().replace(**{"twin.frame_rate": 5.0})
    twin = Twin(draw_rig(config, SEED))
    try:
        return record_motion(twin, config)
    finally:
        twin.close()


def test_the_twin_is_calibrated(capsys: Capture, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    # Weights that find no band.
    rig.write_text(
        "[vision]\nweights = [1.0, -1.0, -1.0]\nthreshold = 250.0\n[twin]\nframe_rate = 5.0\n"
    )
    options = ("--twin", "--seed", str(SEED), "--config", str(rig), "--write", "--json")
    assert main([*COMMAND, *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bands_classified_as_marker"] > 0.95
    assert found["background_classified_as_marker"] < 0.005
    config = load_config(rig)
    assert config.calibration.colour is not None
    # With the actual geometry, the bands are found where the renderer drew them.
    actual = draw_rig(config, SEED)
    no_alternatives = {"vision.alternatives": (), "vision.unlocated.alternatives": ()}
    detector = MarkerDetector(actual.replace(**no_alternatives))
    twin = Twin(actual)
    sample = twin.reset()
    while sample.frame is None:
        sample = twin.step(sample.applied)
    twin.close()
    detection = detector.detect(sample.frame.image)
    assert detection.valid
    assert detection.features == pytest.approx(sample.frame.true_features, abs=2)


class Still:
    """A rig that records its commands."""

    def __init__(self, config: Config) -> None:
        self.control_period, self.commands = config.control.period, [article_sines(config)[0]]

    def reset(self) -> Sample:
        return Sample(0.0, self.commands[0])

    def step(self, command: np.ndarray) -> Sample:
        self.commands.append(np.array(command))
        return Sample((len(self.commands) - 1) * self.control_period, self.commands[-1])

    def close(self) -> None:
        pass


@pytest.mark.parametrize("slow", ["safety.reference_speed", "drives"])
def test_the_whole_motion_is_within_the_speed_of_the_motors(slow: str) -> None:
    config = load_config("bench")
    if slow == "drives":
        config = config.replace(**{"drives.bending.speed_limit": 0.2})
    else:
        periods = {f"experiment.{dof}.period": 60.0 for dof in ("insertion", "rotation", "bending")}
        config = config.replace(**{slow: (0.003, 4.0, 0.2), **periods})
    rig = Still(config)
    record_motion(rig, config)
    commands, (_, amplitude) = np.array(rig.commands), article_sines(config)
    speed = np.abs(np.diff(commands, axis=0)).max(axis=0) / config.control.period
    assert config.drives is not None
    limits = [config.drives[dof].speed_limit for dof in Dof]
    assert (speed <= 0.5 * np.minimum(config.safety.reference_speed, limits)).all()
    moved = np.ptp(commands, axis=0)
    assert moved[[0, 2]] == pytest.approx(2 * amplitude[[0, 2]] * [1.0, 0.6], rel=0.02)


def test_a_video_and_an_image_with_clicks_agree(
    capsys: Capture, tmp_path: Path, motion: ImageSequence
) -> None:
    video, motors, image = (tmp_path / name for name in ("a.mkv", "motors.csv", "a.png"))
    start = float(motion.times[0])
    with av.open(str(video), "w") as container:
        stream = container.add_stream("ffv1", rate=4)
        stream.height, stream.width = motion.images[0].shape[:2]
        stream.pix_fmt = "bgr0"
        for each in motion.images:
            frame = av.VideoFrame.from_ndarray(each, format="bgr24").reformat(format="bgr0")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    lines = ["time,insertion,rotation,bending"]
    lines += [
        f"{start + k / 4},{','.join(map(str, row))}" for k, row in enumerate(motion.positions)
    ]
    motors.write_text("\n".join(lines) + "\n")
    options = ("--motors", str(motors), "--video-start", str(start), "--json")
    assert main([*COMMAND, str(video), *options]) == 0
    by_motion = json.loads(capsys.readouterr().out)["values"]["vision.weights"]
    cv2.imwrite(str(image), motion.images[0])
    config = draw_rig(load_config(), SEED)
    twin = Twin(config)
    sample = twin.reset()
    while sample.frame is None:
        sample = twin.step(sample.applied)
    twin.close()
    u_a, v_a, u_b, v_b = np.asarray(sample.frame.true_features).round().astype(int)
    clicks = ("--click", f"{u_a},{v_a}", "--click", f"{u_b},{v_b}")
    assert main([*COMMAND, str(image), *clicks, "--json"]) == 0
    by_click = json.loads(capsys.readouterr().out)["values"]["vision.weights"]
    cosine = np.dot(by_motion, by_click) / np.linalg.norm(by_motion) / np.linalg.norm(by_click)
    assert cosine > 0.9


def test_a_page_takes_the_clicks(capsys: Capture, tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (20, 30, 3), np.uint8)
    file, page = tmp_path / "a &b.png", tmp_path / "click.html"
    cv2.imwrite(str(file), image)
    assert main([*COMMAND, str(file), "--page", str(page)]) == 0
    assert str(page) in capsys.readouterr().out
    text = page.read_text()
    code = text.partition("data:image/png;base64,")[2].partition('"')[0]
    pixels = cv2.imdecode(np.frombuffer(base64.b64decode(code), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(pixels, image)
    assert 'a &amp;b.png&#x27;"></pre>' in text
    assert "http" not in text
    assert "does not exist yet" in failed(capsys, *COMMAND, str(file), "--page", str(page))


def test_bad_input_is_refused(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "--twin" in failed(capsys, *COMMAND)
    assert "one image, with --click" in failed(capsys, *COMMAND, "--click", "1,2")
    rig = tmp_path / "rig.toml"
    rig.write_text("[drives.insertion]\nnode = 1 # REPLACE\n")
    with pytest.raises(SystemExit) as usage:
        main([*COMMAND, "a.png", "--click", "1"])
    assert usage.value.code == 2
    assert "two whole numbers" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin.readline", lambda: "n\n", raising=False)
    assert main([*COMMAND, "--config", "bench"]) == 2
    assert "nothing moved" in capsys.readouterr().err
    assert "placeholders" in failed(capsys, *COMMAND, "--config", "article_rig")
