"""Calibration over the bus and the video stream of the bench."""

from pathlib import Path

import pytest
from tautscope.bench.drive import SERIAL_NUMBERS
from tautscope.bench.rig import Bench
from tautscope.calibration.camera.board import Board
from tautscope.cli import main
from tautscope.config import Config, load_config
from tautscope.config.load import dump_config
from tautscope.hardware.cameras import Camera
from tautscope.hardware.doctor.drives import check_drives
from tautscope.twin.drawn_rig import draw_rig
from test_bench import bench_config, next_capture
from waiting import until

SEED = 2
STILL = {"twin.sensor.stamp_error": 0.0}
MOTION = {"centre": 0.025, "amplitude": 0.015, "period": 10.0}


@pytest.fixture
def rig(tmp_path: Path) -> tuple[Config, Path]:
    """The configuration of a bench, and its file."""
    config = bench_config(tmp_path, **{"experiment.insertion": MOTION})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config))
    return config, file


def is_shown(camera: Camera) -> bool:
    image = next_capture(camera).frame.image
    return Board().find(image[..., 1].copy()) is not None


def test_the_camera_is_calibrated_with_a_board_that_leaves_again(
    rig: tuple[Config, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautscope.bench.board.POSE_PERIOD", 0.4)
    config, file = rig
    actual = draw_rig(config, SEED).replace(**STILL)
    with Bench(actual) as bench:
        with Camera(config.camera) as camera:
            assert not is_shown(camera)
        bench.request("board camera")
        assert main(["calibrate", "camera", "--config", str(file), "--write"]) == 0
        bench.request("clear camera")
        with Camera(config.camera) as camera:
            until(lambda: not is_shown(camera))
    found = load_config(file)
    record = found.calibration.camera
    assert record is not None
    for key in ("fx", "fy", "cx", "cy"):
        error = getattr(found.camera, key) - getattr(actual.camera, key)
        assert abs(error) < 4.5 * record.std[f"camera.{key}"]


def test_the_colour_is_calibrated_by_moving_the_drives(
    rig: tuple[Config, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    config, file = rig
    with Bench(draw_rig(config, SEED).replace(**STILL)):
        assert main(["calibrate", "colour", "--config", str(file), "--yes", "--write"]) == 0
        drives = config.drives
        assert drives is not None
        numbers = {
            each.data["dof"]: each.data["serial_number"]
            for each in check_drives(drives)
            if "serial_number" in each.data
        }
    record = load_config(file).calibration.colour
    assert record is not None
    assert record.serial_numbers == numbers
    assert numbers["insertion"] == f"{SERIAL_NUMBERS + drives.insertion.node:08X}"
    assert "THE MOTORS" not in capsys.readouterr().out


def test_an_unplugged_drive_stops_the_calibration(
    rig: tuple[Config, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    config, file = rig
    before = file.read_text()
    with Bench(config) as bench:
        bench.request("drop bending")
        assert main(["calibrate", "colour", "--config", str(file), "--yes", "--write"]) == 3
    assert "bending" in capsys.readouterr().err
    assert file.read_text() == before
