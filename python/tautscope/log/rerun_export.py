"""Export of a log as a recording for the Rerun viewer."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.errors import OutputError, RecordError
from tautscope.figure_style import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, YELLOW
from tautscope.log import topics
from tautscope.log.mcap_records import Damage, read_messages
from tautscope.log.messages import Clock
from tautscope.log.reader import Log, Tick, Update, read_log
from tautscope.runs.output_folder import new_file

RIG_TIME, WALL_CLOCK = "rig_time", "wall_clock"
POSITIONS = {"reference": GREY, "command": ORANGE, "applied": AMBER, "estimate": SKY, "true": GREEN}
OFFSETS = {"delta_minus": PURPLE, "delta_plus": BLUE}
BANDS = {
    "measured": ("features", YELLOW),
    "predicted": ("predicted_features", SKY),
    "true": ("true_features", GREEN),
}
"""Name -> columns of frames.csv, and colour."""
_RADIUS = rr.Radius.ui_points(4)  # on the screen, at every zoom


def export_rerun(path: str | PathLike[str], out: str | PathLike[str]) -> tuple[Log, int]:
    """Write a new Rerun recording (.rrd) of a log, with a blueprint; no viewer is opened.

    Timelines are the rig's clock and the wall clock. Scalars are in the display units that their
    names end with. The pinhole has no distortion, which Rerun does not know. Status is written
    where it changes.

    Returns:
        The log and the number of its images.

    Raises:
        MissingPathError, RecordError, ConfigError: As `read_log`; a log without a tick, too.
        OutputError: The file exists already, or cannot be written.
    """
    with new_file(out) as partial:
        log = read_log(path)
        recording = rr.RecordingStream("tautscope", send_properties=False)
        recording.send_recording_name(Path(path).stem)
        try:
            recording.save(partial, default_blueprint=_blueprint(log.config))
            images = _LogWriter(recording, log).write()
        except RuntimeError as error:  # of Rerun's thread that writes
            allowed = f"a place that can be written ({error})"
            raise OutputError("out", str(out), allowed) from None
        finally:
            recording.disconnect()
    return log, images


class _LogWriter:
    def __init__(self, recording: rr.RecordingStream, log: Log) -> None:
        self._recording, self._log = recording, log
        tick = next((event for event in log.events.values() if isinstance(event, Tick)), None)
        if tick is None:
            raise RecordError("log", str(log.path), "a log with a control tick")
        stamp = topics.decode(topics.APPLIED, tick.raw[topics.APPLIED])["header"]["stamp"]
        self._clock = Clock(tick.sample.time, stamp["sec"] * 10**9 + stamp["nanosec"])

    def write(self) -> int:
        """Write everything; the number of images."""
        self._write_scalars()
        if not self._log.config.dof:
            self._write_camera()
        self._write_status()
        images = self._write_messages()
        self._recording.flush()
        return images

    def _write_scalars(self) -> None:
        run = self._log.recording()
        for group, colour in (POSITIONS | OFFSETS).items():
            table, time = run.trace, run.trace["time"]
            if group == "estimate":  # that of the capture time
                table, time = run.frames, run.frames["captured_at"]
            for dof in run.config.dofs:
                values = table[f"{group}_{dof.label}"]
                if np.isnan(values).all():  # no true state
                    continue
                entity = f"{'offset' if group in OFFSETS else 'position'}/{dof.label}/{group}"
                style = rr.SeriesLines(names=f"{group} [{dof.display_unit}]", colors=_rgba(colour))
                self._recording.log(entity, style, static=True)
                scalars = rr.Scalars.columns(scalars=values * dof.display_scale)
                self._recording.send_columns(entity, self._at(time), scalars)

    def _write_camera(self) -> None:
        camera, frames = self._log.config.camera, self._log.recording().frames
        pinhole = rr.Pinhole(
            focal_length=(camera.fx, camera.fy),
            principal_point=(camera.cx, camera.cy),
            resolution=(camera.width, camera.height),
        )
        self._recording.log("endoscope", pinhole, static=True)
        for name, (group, colour) in BANDS.items():
            for band in "ab":
                points = np.stack([frames[f"{group}_{band}_{axis}"] for axis in "xy"], axis=1)
                found = np.isfinite(points).all(axis=1)
                entity = f"endoscope/{name}/{band}"
                style = rr.Points2D.from_fields(
                    colors=_rgba(colour), radii=_RADIUS, labels=band.upper(), show_labels=False
                )
                self._recording.log(entity, style, static=True)
                # A row without a point removes the one before.
                columns = rr.Points2D.columns(positions=points[found]).partition(found)
                self._recording.send_columns(entity, self._at(frames["captured_at"]), columns)

    def _write_status(self) -> None:
        previous = ""
        for event in self._log.events.values():
            if not isinstance(event, Update):
                continue
            status = topics.decode(topics.STATUS, event.raw[topics.STATUS])["status"][0]
            values = {each["key"]: each["value"] for each in status["values"]}
            text = f"{status['name']}: {status['message']}, reaction: {values['reaction']}"
            text += f", warnings: {values['warnings']}" if values["warnings"] else ""
            if text != previous:
                level = rr.TextLogLevel.WARN if status["level"] else rr.TextLogLevel.INFO
                self._write_text("status", event.row[0], text, level)
                previous = text

    def _write_messages(self) -> int:
        """Write images, warnings and requests, which a log in memory has not or without time."""
        images = 0
        for _, topic, record in read_messages(self._log.path, Damage()):
            now = self._clock.start + (record.log_time - self._clock.epoch) / 1e9
            if topic == topics.WARNING:
                text = topics.decode(topic, record.data)["msg"]
                self._write_text("warning", now, text, rr.TextLogLevel.WARN)
            elif topic == topics.EVENT:
                text = topics.decode(topic, record.data)["data"]
                self._write_text("event", now, text, rr.TextLogLevel.INFO)
            elif topic == topics.IMAGE and self._log.has_image(record.sequence):
                event = self._log.events[record.sequence]
                assert isinstance(event, Update)
                image = topics.decode(topic, record.data)
                kind = image["format"].partition("; ")[2].split()[0]  # as `ImageCodec.format`
                columns = rr.EncodedImage.columns(
                    blob=[bytes(image["data"])], media_type=[f"image/{kind}"]
                )
                self._recording.send_columns("endoscope/image", self._at([event.row[0]]), columns)
                self._recording.flush()  # else all images wait in memory
                images += 1
        return images

    def _write_text(self, entity: str, now: object, text: str, level: str) -> None:
        columns = rr.TextLog.columns(text=[text], level=[level])
        self._recording.send_columns(f"log/{entity}", self._at([now]), columns)

    def _at(self, seconds: ArrayLike | list[object]) -> list[rr.TimeColumn]:
        """Times (n,) [s, the rig's clock] on both timelines."""
        times = np.asarray(seconds, np.float64)
        wall = self._clock.epoch + _nanoseconds(times - self._clock.start)
        return [
            rr.TimeColumn(RIG_TIME, duration=_nanoseconds(times).astype("timedelta64[ns]")),
            rr.TimeColumn(WALL_CLOCK, timestamp=wall.astype("datetime64[ns]")),
        ]


def _nanoseconds(times: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.round(times * 1e9).astype(np.int64)


def _rgba(colour: str) -> int:
    return int(colour.removeprefix("#") + "ff", 16)


def _blueprint(config: Config) -> rrb.Blueprint:
    """Image and texts beside the time series of each degree of freedom."""
    series = [
        rrb.Vertical(
            *(
                rrb.TimeSeriesView(
                    origin=f"{kind}/{dof.label}", name=f"{dof.label} [{dof.display_unit}]"
                )
                for dof in config.dofs
            ),
            name=name,
        )
        for kind, name in (("position", "positions"), ("offset", "contact offsets"))
    ]
    texts = rrb.TextLogView(origin="log", name="status, warnings, requests")
    image = [] if config.dof else [rrb.Spatial2DView(origin="endoscope", name="image")]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*image, texts, row_shares=[3, 1] if image else [1]), rrb.Tabs(*series)
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(timeline=RIG_TIME),
    )
