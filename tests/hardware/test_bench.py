"""The bench: the twin behind a CAN bus and a camera stream, in this process and in its own."""

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn import with_half_images
from drive_settings import drives_document
from tautscope.bench.ground_truth import GroundTruthWriter, read_ground_truth
from tautscope.bench.rig import Bench
from tautscope.cli import main
from tautscope.config import Config, dump_config, from_document
from tautscope.dof import Dof
from tautscope.errors import ConfigError, OutputError
from tautscope.hardware.cameras import Camera, Capture
from tautscope.hardware.experiment import run_on_hardware
from tautscope.hardware.run_results import write_run_folder
from tautscope.hardware.timing import read_sent
from tautscope.log.reader import read_log
from tautscope.loop.references import RecordedReference
from tautscope.runs.recording import Recording, per_dof
from test_processes import Lines, process
from waiting import TIMEOUT, until

CYCLE = 0.02
RUN = "from tautscope.cli import main; raise SystemExit(main())"


def bench_config(folder: Path, **changes: Any) -> Config:
    """Slow motion and cycles, and long timeouts, for a busy computer."""
    document = {
        "law": {"free_gain": 5.0},
        "control": {"period": CYCLE},
        "camera": {
            "source": {
                "url": f"unix:{folder / 'video'}",
                "format": "nut",
                "clock": "device",
                "timeout": TIMEOUT,
                "start_timeout": TIMEOUT,
                "lost_timeout": TIMEOUT,
                "reconnect_period": 0.05,
            }
        },
        "drives": drives_document(
            channel=str(folder / "can"), cycle=CYCLE, command_timeout=TIMEOUT, start_speed=0.5
        ),
        "experiment": {
            "periods": 3,
            "insertion": {"centre": 0.025, "amplitude": 0.0025, "period": 1.0},
            "rotation": {"centre": 0.0, "amplitude": 0.2, "period": 0.4},
            "bending": {"centre": 0.9, "amplitude": 0.1, "period": 0.4},
        },
        "twin": {"frame_rate": 12.5},
        "recording": {"image_format": "jpeg"},
    }
    return from_document(document).replace(**changes)


def next_capture(camera: Camera) -> Capture:
    end = time.monotonic() + TIMEOUT
    while (capture := camera.newest()) is None:
        assert time.monotonic() < end, camera.state
        time.sleep(0.005)
    return capture


def test_camera_stream_and_its_faults(tmp_path: Path) -> None:
    """Without a master the instrument rests and is visible."""
    config = bench_config(tmp_path)
    before = time.monotonic()
    with Bench(config) as bench, Camera(config.camera, time.monotonic) as camera:
        captures = [next_capture(camera) for _ in range(3)]
        stamps = [capture.frame.captured_at for capture in captures]
        assert before < stamps[0] < stamps[1] < stamps[2]
        for capture in captures:
            lag = capture.arrived_at - capture.frame.captured_at
            assert lag >= config.twin.latency - config.twin.latency_jitter - 1e-5
        assert not np.array_equal(captures[0].frame.image, captures[1].frame.image)

        bench.request("freeze camera")
        until(lambda: (last := next_capture(camera)) is not None and _is_still(camera, last))
        bench.request("clear camera")
        until(lambda: not _is_still(camera, next_capture(camera)))

        bench.request("fault camera")
        until(lambda: bool(camera.state.trouble))
        camera.newest()
        bench.request("clear camera")
        next_capture(camera)
        assert camera.state.trouble == ""
        assert camera.state.reconnects >= 1
        events = [event.what for event in bench.events if event.dof == "camera"]
    assert events == ["fault: freeze", "fault: clear", "fault: fault", "fault: clear"]


def _is_still(camera: Camera, last: Capture) -> bool:
    return np.array_equal(next_capture(camera).frame.image, last.frame.image)


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"drives.interface": "socketcan"}, "drives.interface"),
        ({"camera.source.url": "/dev/video0"}, "camera.source.url"),
        ({"camera.pixel_format": "nv12"}, "camera.pixel_format"),
    ],
)
def test_bench_refuses_a_hardware_configuration(
    tmp_path: Path, changes: dict[str, Any], where: str
) -> None:
    with pytest.raises(ConfigError, match=where):
        Bench(bench_config(tmp_path, **changes))


def test_a_mode_that_cia_402_does_not_have_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "--modes", "0"])
    assert "--modes: invalid choice: 0" in capsys.readouterr().err


def test_error_names_a_socket_that_cannot_be_made(tmp_path: Path) -> None:
    config = bench_config(tmp_path)
    with (
        Bench(config),
        pytest.raises(ConfigError, match=r"drives\.channel.*in use.*another bench"),
    ):
        Bench(config)
    nowhere = config.replace(**{"camera.source.url": f"unix:{tmp_path / 'none' / 'video'}"})
    with pytest.raises(ConfigError, match=r"camera\.source\.url.*No such file"):
        Bench(nowhere).__enter__()
    with pytest.raises(OutputError, match=r"--truth.*No such file"):
        Bench(config, tmp_path / "none" / "truth.csv")


@pytest.mark.parametrize("fault", ["1 drop rotatoin", "1 explode camera", "1 unplug rotation"])
def test_wrong_faults_are_refused_at_the_start(
    fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bench.toml"
    file.write_text(dump_config(bench_config(tmp_path)))
    assert main(["bench", "--config", str(file), "--faults", "0 drop camera", fault]) == 2
    printed = capsys.readouterr()
    assert f"--faults: got '{fault[2:]}'" in printed.err
    assert printed.out == ""


def test_a_file_in_the_place_of_the_truth_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.csv"
    file.write_text("mine")
    assert main(["bench", "--truth", str(file)]) == 2
    assert "--truth: got" in capsys.readouterr().err
    assert file.read_text() == "mine"


def test_unknown_fault_requests_are_refused(tmp_path: Path) -> None:
    with Bench(bench_config(tmp_path)) as bench:
        for line in ("explode camera", "freeze", "freeze tail", "explode rotation"):
            with pytest.raises(ConfigError, match="fault"):
                bench.request(line)


def test_stalled_disk_does_not_delay_the_drives(tmp_path: Path) -> None:
    """A pipe without a reader simulates the disk; all data are written in the end."""
    pipe = tmp_path / "truth.csv"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    rows = np.arange(4 * 5000, dtype=float).reshape(-1, 4)
    with GroundTruthWriter(pipe) as truth:
        for now, *state in rows:
            truth.add(now, np.array(state))  # 100 kB: more than a pipe holds
        time.sleep(0.3)
        os.set_blocking(reader, True)
        drain = threading.Thread(target=lambda: _copy(reader, tmp_path / "copy.csv"))
        drain.start()
    drain.join()
    instants, states = read_ground_truth(tmp_path / "copy.csv")
    np.testing.assert_array_equal(np.column_stack([instants, states]), rows)


def _copy(reader: int, file: Path) -> None:
    with os.fdopen(reader, "rb") as pipe:
        file.write_bytes(pipe.read())


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[tuple[Config, Path, Lines]]:
    """A bench in its own process: configuration, its file, its output."""
    config = with_half_images(bench_config(tmp_path))
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    arguments = ("-c", RUN, "bench", "--config", str(file), "--truth", str(tmp_path / "truth.csv"))
    with process(*arguments) as (_, lines):
        lines.until("ready")
        yield config, file, lines


def test_protocol_runs_over_bus_and_stream(rig: tuple[Config, Path, Lines], tmp_path: Path) -> None:
    config, _, lines = rig
    out = tmp_path / "run"
    found = run_on_hardware(config, out, lambda share: None)
    write_run_folder(found, out)
    lines.until("quick stop active", 3)

    recording = Recording.load(out)
    trace, frames = recording.trace, recording.frames
    assert len(trace) == round(5.4 / CYCLE)
    np.testing.assert_allclose(np.diff(trace["time"]), CYCLE, rtol=1e-6)
    assert len(frames) > 0
    assert (frames["captured_at"] < frames["arrived_at"]).all()
    # The motors follow the commands with a lag of two cycles.
    late = np.abs(per_dof(trace, "applied")[2:] - per_dof(trace, "command")[:-2])
    assert (late.max(axis=0) < [2e-3, 0.2, 0.1]).all()

    sent = read_sent(out / "timing_cycles.csv")
    instants, states = read_ground_truth(tmp_path / "truth.csv")
    assert len(sent) == len(trace)
    truth = np.interp(sent, instants, states[:, Dof.INSERTION])
    measured = frames[frames["observable_insertion"] & (frames["captured_at"] > 0)]
    if len(measured) > 5:  # a busy computer may deliver too few frames
        tip = np.interp(measured["captured_at"], trace["time"], truth)
        assert np.median(np.abs(measured["estimate_insertion"] - tip)) < 2e-3

    facts = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert facts["runs"]["compensated"]["ticks"] == len(trace)
    assert facts["runs"]["compensated"]["timing"]["frames"] >= len(frames)
    for name in ("report.html", "timing.png", "compensated.mcap", "timing_frames.csv"):
        assert (out / name).stat().st_size > 0


def test_a_recorded_motion_runs_on_the_rig(
    rig: tuple[Config, Path, Lines], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The files of the pictures suffice.
    monkeypatch.setattr("tautscope.report.report.figure_list", lambda pictures: "")
    config, _, lines = rig
    time = np.linspace(5, 6.5, 40)
    centre = np.array([config.experiment[dof].centre for dof in Dof])
    motion = np.sin(4 * (time - 5))[:, np.newaxis] * [5e-3, 0.3, 0.2]
    reference = RecordedReference(time, centre + motion, config)
    out = tmp_path / "run"
    found = run_on_hardware(config, out, lambda share: None, reference, compare=True)
    write_run_folder(found, out)
    lines.until("quick stop active", 6)
    trace = found.compensated.recording.trace
    np.testing.assert_array_equal(
        per_dof(trace, "reference"), [reference(tick - trace["time"][0]) for tick in trace["time"]]
    )
    assert len(trace) == round(reference.duration / CYCLE)
    facts = json.loads((out / "run.json").read_text(encoding="utf-8"))["by_camera"]
    assert {"uncompensated_rms", "compensated_rms", "reduction"} <= facts["insertion"].keys()
    assert "Recorded motion" in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "tracking.png").stat().st_size > 0
    assert not (out / "table1.csv").exists()


def test_sigterm_stops_the_motors_and_keeps_the_log(
    rig: tuple[Config, Path, Lines], tmp_path: Path
) -> None:
    _, file, lines = rig
    out = tmp_path / "run"
    with process("-c", RUN, "run", "--config", str(file), "--out", str(out), "--yes") as (
        running,
        _,
    ):
        lines.until("operation enabled", 3)
        log = out / "compensated.mcap"
        until(lambda: log.is_file() and log.stat().st_size > 10_000)
        running.send_signal(signal.SIGTERM)
        lines.until("quick stop active", 3)
        assert running.wait(TIMEOUT) == 128 + signal.SIGTERM
    assert len(read_log(log).recording().trace) > 0


def test_error_names_a_wrong_node_before_any_motion(
    rig: tuple[Config, Path, Lines], tmp_path: Path
) -> None:
    _, file, _ = rig
    wrong = tmp_path / "wrong.toml"
    text = file.read_text(encoding="utf-8").replace("node = 2", "node = 9")
    wrong.write_text(text.replace("request_timeout = 5.0", "request_timeout = 0.5"))
    with process(
        "-c", RUN, "run", "--config", str(wrong), "--out", str(tmp_path / "run"), "--yes"
    ) as (
        running,
        _,
    ):
        assert running.wait(TIMEOUT) == 3
        assert running.stderr is not None
        errors = running.stderr.read()
    assert "error: rotation, node 9: no answer to an SDO request" in errors
    assert "Check drives.rotation.node" in errors
    assert not (tmp_path / "run").exists()
