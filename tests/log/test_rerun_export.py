"""`tautscope export --rerun`, read with Rerun's own reader."""

import json
import shutil
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from drawn import DrawnRig, short_experiment
from play_rig import SensorRig, by_joints
from rosbags.highlevel import AnyReader
from tautscope import extras
from tautscope.cli import main
from tautscope.config import Sine, axes
from tautscope.log.export import export_csv
from tautscope.log.writer import LogWriter
from tautscope.loop.measurement import Tip
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import OperatorMotion, SineSequence
from tautscope.loop.rig import Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording

rerun = pytest.importorskip("rerun", reason="the extra `rerun` is not installed")

Files = tuple[Path, Path]
Rows = dict[str, list[dict[str, Any]]]


class CoveredRig(DrawnRig):
    """For half a second there is nothing in its images."""

    def _draw(self):
        image = super()._draw()
        return image[:1, :1] + np.zeros_like(image) if 50 <= self._ticks < 100 else image


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A log with images, a request and a warning, and its export."""
    folder = tmp_path_factory.mktemp("rerun")
    config = short_experiment().replace(**{"recording.image_format": "jpeg"})
    reference = SineSequence(config.experiment)
    reference.duration = 1.5
    with LogWriter(folder / "run.mcap", config, wait=True) as log:
        run_experiment(CoveredRig(config), reference, config, log=log)
        log.event(1.25, "note half done")
        log.warn("the light is low")
    assert main(["export", str(log.close().path), "--rerun", str(folder / "run.rrd")]) == 0
    return folder / "run.mcap", folder / "run.rrd"


def rows_of(path: Path) -> Rows:
    """Entity -> rows in order of time; a static row has no time."""
    from rerun.chunk import RrdReader

    found: Rows = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        columns = {name: batch.column(name) for name in batch.schema.names}
        for name in ("rig_time", "wall_clock"):
            if name in columns:
                columns[name] = columns[name].cast("int64")
        found[chunk.entity_path] += [
            {name: column[row].as_py() for name, column in columns.items()}
            for row in range(batch.num_rows)
        ]
    for rows in found.values():
        rows.sort(key=lambda row: row.get("rig_time", -1))
    return found


def assert_scalars(found: Rows, saved: Recording, groups: set[str]) -> None:
    """Every scalar is that of the CSV export, in the unit of its name, at its time."""
    shown = {entity.split("/")[-1] for entity in found if entity.startswith(("/pos", "/off"))}
    assert shown == groups
    for group in groups:
        kind = "offset" if group.startswith("delta") else "position"
        table, time = (
            (saved.frames, "captured_at") if group == "estimate" else (saved.trace, "time")
        )
        for dof in saved.config.dofs:
            style, *rows = found[f"/{kind}/{dof.label}/{group}"]
            unit = {"mm": 1e-3, "rad": 1.0}
            (name,) = style["SeriesLines:names"]
            scale = unit[name.removeprefix(f"{group} [").removesuffix("]")]
            values = [row["Scalars:scalars"][0] * scale for row in rows]
            np.testing.assert_allclose(values, table[f"{group}_{dof.label}"], rtol=1e-14)
            times = np.array([row["rig_time"] for row in rows]) * 1e-9
            np.testing.assert_allclose(times, table[time], atol=1e-9)


def exported_csv(log: Path, folder: Path) -> Recording:
    export_csv(log, folder)
    return Recording.load(folder)


def test_scalars_are_those_of_the_csv(files: Files, tmp_path: Path) -> None:
    saved = exported_csv(files[0], tmp_path / "csv")
    positions = {"reference", "command", "applied", "estimate", "true"}
    assert_scalars(rows_of(files[1]), saved, positions | {"delta_minus", "delta_plus"})


def test_images_camera_and_wall_clock_are_those_of_the_messages(files: Files) -> None:
    found = rows_of(files[1])
    stamps: dict[str, list[int]] = defaultdict(list)
    images = []
    with AnyReader([files[0]]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if hasattr(message, "header"):
                stamp = message.header.stamp
                stamps[connection.topic].append(stamp.sec * 10**9 + stamp.nanosec)
            if connection.topic == "/endoscope/image_raw/compressed":
                images.append(message.data.tobytes())
            if connection.topic == "/endoscope/camera_info":
                camera = message
    rows = found["/endoscope/image"]
    assert [bytes(row["EncodedImage:blob"][0]) for row in rows] == images
    assert {row["EncodedImage:media_type"][0] for row in rows} == {"image/jpeg"}
    wall = [row["wall_clock"] for row in rows]
    np.testing.assert_allclose(wall, stamps["/endoscope/image_raw/compressed"], rtol=0, atol=1)
    wall = [row["wall_clock"] for row in found["/position/insertion/reference"][1:]]
    np.testing.assert_allclose(wall, stamps["/instrument/servo_jp"], rtol=0, atol=1)
    (pinhole,) = found["/endoscope"]
    matrix = np.reshape(pinhole["Pinhole:image_from_camera"][0], (3, 3)).T  # by columns
    np.testing.assert_allclose(matrix.ravel(), camera.k, rtol=1e-6)
    assert pinhole["Pinhole:resolution"][0] == [camera.width, camera.height]


def test_bands_are_where_they_were_found(files: Files, tmp_path: Path) -> None:
    found, frames = rows_of(files[1]), exported_csv(files[0], tmp_path / "csv").frames
    assert 0 < np.isnan(frames["features_a_x"]).sum() < len(frames)
    for name, group in (("measured", "features"), ("predicted", "predicted_features")):
        for band in "ab":
            style, *rows = found[f"/endoscope/{name}/{band}"]
            assert style["Points2D:labels"] == [band.upper()]
            expected = [frames[f"{group}_{band}_{axis}"] for axis in "xy"]
            for row, point in zip(rows, np.transpose(expected), strict=True):
                positions = row["Points2D:positions"]
                assert len(positions) == np.isfinite(point).all()
                if positions:
                    np.testing.assert_allclose(positions[0], point, rtol=1e-6)


def test_status_warnings_and_requests_are_texts(files: Files, tmp_path: Path) -> None:
    found, frames = rows_of(files[1]), exported_csv(files[0], tmp_path / "csv").frames
    (request,), (warning,) = found["/log/event"], found["/log/warning"]
    assert (request["TextLog:text"], request["rig_time"]) == (["note half done"], 1_250_000_000)
    assert warning["TextLog:text"] == ["the light is low"]
    # The log has the wall clock's time of a warning alone; both clocks run alike.
    between = [warning[clock] - request[clock] for clock in ("rig_time", "wall_clock")]
    assert between[0] == between[1] < 0
    assert warning["TextLog:level"] == ["WARN"]
    rows = found["/log/status"]
    texts = [row["TextLog:text"][0] for row in rows]
    assert all(text != after for text, after in pairwise(texts))
    assert {row["TextLog:level"][0] for row in rows} == {"INFO", "WARN"}
    for frame in frames:  # the newest text has the status of every update
        now = round(frame["captured_at"] * 1e9)
        newest = max(row["rig_time"] for row in rows if row["rig_time"] <= now)
        shown = [text for row, text in zip(rows, texts, strict=True) if row["rig_time"] == newest]
        assert f": {frame['status']}, " in shown[-1]


def test_times_that_are_far_off_are_exported(tmp_path: Path) -> None:
    """Above what int64 [ns] holds they are clipped, to what a message states."""
    config = axes(1, width_limit=1.0)
    loop, tip = HysteresisReduction(config), Tip(np.zeros(1), -1e12)
    loop.step(np.zeros(1), 0.0)
    with LogWriter(tmp_path / "run.mcap", config) as log:
        for time in (0.0, 1e12):
            log.tick(Sample(time, np.zeros(1)), np.zeros(1), np.zeros(1))
        log.measurement(0.0, tip, loop.on_sample(tip))
    assert main(["export", str(tmp_path / "run.mcap"), "--rerun", str(tmp_path / "run.rrd")]) == 0
    found = rows_of(tmp_path / "run.rrd")
    bound = (2**31 - 1) * 10**9
    assert [row["rig_time"] for row in found["/log/status"]] == [-bound]
    _, *rows = found["/position/axis_1/reference"]
    assert [row["rig_time"] for row in rows] == [0, bound]


def views_of(path: Path) -> dict[str, str]:
    """Name -> class of the views of the blueprint."""
    from rerun.chunk import RrdReader

    reader, views = RrdReader(path), {}
    (blueprint,) = reader.blueprints()
    for chunk in reader.stream(store=blueprint):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:display_name" in batch.schema.names:
            name = batch.column("ViewBlueprint:display_name")[0].as_py()[0]
            origin = batch.column("ViewBlueprint:space_origin")[0].as_py()[0]
            views[f"{origin}: {name}"] = batch.column("ViewBlueprint:class_identifier")[0].as_py()[
                0
            ]
    return views


def test_the_blueprint_has_the_image_and_series_per_dof(files: Files) -> None:
    units = {"insertion": "mm", "rotation": "rad", "bending": "rad"}
    assert views_of(files[1]) == {
        "endoscope: image": "2D",
        "log: status, warnings, requests": "TextLog",
        **{
            f"{kind}/{dof}: {dof} [{unit}]": "TimeSeries"
            for kind in ("position", "offset")
            for dof, unit in units.items()
        },
    }


def test_a_robot_without_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = axes(5, width_limit=0.01, unit="m")
    motion = OperatorMotion([Sine(centre=0.0, amplitude=8e-3)] * 5, 3, 0.5)
    log, out = tmp_path / "run.mcap", tmp_path / "run.rrd"
    with LogWriter(log, config, wait=True) as writer:
        run_experiment(SensorRig(config, (by_joints,)), motion, config, log=writer)
    assert main(["export", str(log), "--rerun", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["images"] == 0
    found, saved = rows_of(out), exported_csv(log, tmp_path / "csv")
    groups = {"reference", "command", "applied", "estimate", "delta_minus", "delta_plus"}
    has_truth = np.isfinite(saved.trace["true_axis_1"]).any()
    assert_scalars(found, saved, groups | ({"true"} if has_truth else set()))
    assert not any("endoscope" in entity for entity in found)
    assert len(views_of(out)) == 11


def test_nothing_half_written_remains(
    files: Files,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out" / "run.rrd"
    out.parent.mkdir()
    (tmp_path / "no.mcap").write_bytes(b"no log")
    assert main(["export", str(tmp_path / "no.mcap"), "--rerun", str(out)]) == 2
    with monkeypatch.context() as broken:  # Rerun's thread has ended after a chunk
        broken.setattr(rerun.RecordingStream, "flush", Mock(side_effect=[None, RuntimeError]))
        assert main(["export", str(files[0]), "--rerun", str(out)]) == 2
    with monkeypatch.context() as full:
        full.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
        assert main(["export", str(files[0]), "--rerun", str(out)]) == 2
    assert "MB free, not 0" in capsys.readouterr().err
    assert list(out.parent.iterdir()) == []
    out.write_text("mine")
    assert main(["export", str(files[0]), "--rerun", str(out)]) == 2
    assert "a file that does not exist yet" in capsys.readouterr().err
    assert out.read_text() == "mine"


def test_a_missing_extra_is_named(
    files: Files, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(extras.MODULES, "rerun", ("no_such_module",))
    assert main(["export", str(files[0]), "--rerun", "run.rrd"]) == 2
    assert 'pip install "tautscope[rerun]"' in capsys.readouterr().err
