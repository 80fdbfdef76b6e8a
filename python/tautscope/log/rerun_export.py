"""Export of a log as a recording for the Rerun viewer."""

import shutil
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import Chunk
from rerun.encodings import Utf8Like

from tautscope.config import Config
from tautscope.errors import OutputError
from tautscope.figure_style import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, YELLOW
from tautscope.log import topics
from tautscope.log.fields import LONGEST
from tautscope.log.mcap_records import Damage, read_messages
from tautscope.log.reader import Log, Update, read_log
from tautscope.runs.output_folder import new_file
from tautscope.runs.recording import Recording

APPLICATION = "tautscope"
RIG_TIME, WALL_CLOCK = "rig_time", "wall_clock"
POSITIONS = {"reference": GREY, "command": ORANGE, "applied": AMBER, "estimate": SKY, "true": GREEN}
OFFSETS = {"delta_minus": PURPLE, "delta_plus": BLUE}
BANDS = {
    "measured": ("features", YELLOW),
    "predicted": ("predicted_features", SKY),
    "true": ("true_features", GREEN),
}
"""Name -> columns of frames.csv, and colour."""
_RADIUS = -4.0  # negative: points of the screen, at every zoom


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
        chunks = _Chunks(log)
        _check_room(log.path, partial)
        recording = rr.RecordingStream(
            APPLICATION, recording_id=chunks.recording_id, send_properties=False
        )
        recording.save(partial, default_blueprint=_blueprint(log.config))
        try:
            for chunk in chunks.all():
                recording.send_chunks(chunk)
                recording.flush()  # else all images wait in memory
        except RuntimeError as error:  # of Rerun's thread that writes
            allowed = f"a place that can be written ({error})"
            raise OutputError("out", str(out), allowed) from None
        finally:
            recording.disconnect()
    return log, chunks.images


def _check_room(log: Path, out: Path) -> None:
    """Check that the disk has room: Rerun's thread that writes may hang on a full one."""
    most = 3 * log.stat().st_size + 2**26  # images are at most twice as large as in the log
    if (free := shutil.disk_usage(out.parent).free) < most:
        raise OutputError(
            "out", str(out.parent), f"a disk with {most / 1e6:.0f} MB free, not {free / 1e6:.0f}"
        )


class _Chunks:
    """The chunks of a recording; the images are read from the file, one at a time."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self.images = 0
        self._clock = log.clock
        self.recording_id = f"{log.path.stem}-{self._clock.epoch}"

    def all(self) -> Iterator[Chunk]:
        """The chunks."""
        run = self._log.recording()
        yield from self._scalars(run)
        if not run.config.dof:
            yield from self._camera(run)
        yield from self._status()
        yield from self._messages()

    def _scalars(self, run: Recording) -> Iterator[Chunk]:
        for group, colour in (POSITIONS | OFFSETS).items():
            table, time = run.trace, run.trace["time"]
            if group == "estimate":  # that of the capture time
                table, time = run.frames, run.frames["captured_at"]
            for dof in run.config.dofs:
                values = table[f"{group}_{dof.label}"]
                if np.isnan(values).all():  # no true state
                    continue
                entity = f"{'offset' if group in OFFSETS else 'position'}/{dof.label}/{group}"
                name = f"{group} [{dof.display_unit}]"
                style = rr.SeriesLines.columns(names=[name], colors=[_rgba(colour)])
                yield Chunk.from_columns(entity, [], style)
                scalars = rr.Scalars.columns(scalars=values * dof.display_scale)
                yield Chunk.from_columns(entity, self._at(time), scalars)

    def _camera(self, run: Recording) -> Iterator[Chunk]:
        camera, frames = run.config.camera, run.frames
        matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
        pinhole = rr.Pinhole.columns(
            image_from_camera=matrix[None], resolution=[[camera.width, camera.height]]
        )
        yield Chunk.from_columns("endoscope", [], pinhole)
        for name, (group, colour) in BANDS.items():
            for band in "ab":
                points = np.stack([frames[f"{group}_{band}_{axis}"] for axis in "xy"], axis=1)
                found = np.isfinite(points).all(axis=1)
                entity = f"endoscope/{name}/{band}"
                style = rr.Points2D.columns(
                    colors=[_rgba(colour)],
                    radii=[_RADIUS],
                    labels=[band.upper()],
                    show_labels=[False],
                )
                yield Chunk.from_columns(entity, [], style)
                # A row without a point removes the one before.
                columns = rr.Points2D.columns(positions=points[found]).partition(found)
                yield Chunk.from_columns(entity, self._at(frames["captured_at"]), columns)

    def _status(self) -> Iterator[Chunk]:
        previous = ""
        for event in self._log.events.values():
            if not isinstance(event, Update):
                continue
            status, values = event.status
            text = f"{status.name}: {status.message}, reaction: {values['reaction']}"
            text += f", warnings: {values['warnings']}" if values["warnings"] else ""
            if text != previous:
                level = rr.TextLogLevel.WARN if status.level else rr.TextLogLevel.INFO
                yield self._text("status", event.row["captured_at"], text, level)
                previous = text

    def _messages(self) -> Iterator[Chunk]:
        """Images, warnings and requests, which a log in memory has not or without time."""
        for _, topic, record in read_messages(self._log.path, Damage()):
            now = self._clock.start + (record.log_time - self._clock.epoch) / 1e9
            if topic == topics.WARNING:
                text = topics.decode(topic, record.data).msg
                yield self._text("warning", now, text, rr.TextLogLevel.WARN)
            elif topic == topics.EVENT:
                text = topics.decode(topic, record.data).data
                yield self._text("event", now, text, rr.TextLogLevel.INFO)
            elif topic == topics.IMAGE and self._log.has_image(record.sequence):
                event = self._log.events[record.sequence]
                assert isinstance(event, Update)
                image = topics.decode(topic, record.data)
                kind = image.format.partition("; ")[2].split()[0]  # as `ImageCodec.format`
                columns = rr.EncodedImage.columns(
                    blob=[bytes(image.data)], media_type=[f"image/{kind}"]
                )
                at = self._at(event.row["captured_at"])
                yield Chunk.from_columns("endoscope/image", at, columns)
                self.images += 1

    def _text(self, entity: str, now: object, text: str, level: Utf8Like) -> Chunk:
        columns = rr.TextLog.columns(text=[text], level=[level])
        return Chunk.from_columns(f"log/{entity}", self._at(now), columns)

    def _at(self, seconds: object) -> list[rr.TimeColumn]:
        """A time, or times (n,) [s, the rig's clock], on both timelines."""
        times = np.atleast_1d(np.asarray(seconds, np.float64))
        wall = self._clock.epoch + _nanoseconds(times - self._clock.start)
        return [
            rr.TimeColumn(RIG_TIME, duration=_nanoseconds(times).astype("timedelta64[ns]")),
            rr.TimeColumn(WALL_CLOCK, timestamp=wall.astype("datetime64[ns]")),
        ]


def _nanoseconds(times: NDArray[np.float64]) -> NDArray[np.int64]:
    # Any time of a rig, within what a message of its log states.
    return np.round(np.clip(times, -LONGEST, LONGEST) * 1e9).astype(np.int64)


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
