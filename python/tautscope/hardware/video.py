"""Decoding of video with FFmpeg through PyAV; fields of interlaced video become frames.

OpenCV's reader is not used: it decodes interlaced DV to black images without an error.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig
from tautscope.errors import USAGE, CameraError, CameraMismatchError, MissingPathError, NoRigError
from tautscope.extras import require_extras
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.rig import Frame

if TYPE_CHECKING:
    import av
    from av.container import InputContainer
    from av.filter import Graph
    from av.video.stream import VideoStream

_LOG = logging.getLogger(__name__)

Image = NDArray[np.uint8]

_FORMATS = {
    "bgr": "bgr24",
    "rgb": "rgb24",
    "bgra": "bgra",
    "yuyv": "yuyv422",
    "uyvy": "uyvy422",
    "nv12": "nv12",
    "i420": "yuv420p",
}
"""`camera.pixel_format` -> FFmpeg's name."""
_NO_STAMPS = 0x80
"""FFmpeg's AVFMT_NOTIMESTAMPS: the format has none, and they are counted from a nominal rate."""
_TURNS = {
    0: (),
    90: (("transpose", "cclock"),),
    -90: (("transpose", "clock"),),
    180: (("hflip", ""), ("vflip", "")),
}
"""Angle by which a player turns the frames, counterclockwise -> FFmpeg's filters."""


class DecodedFrame(NamedTuple):
    """A frame or field in `camera.pixel_format`, and the source's time stamp [s], if it has one."""

    image: Image
    stamp: float | None


@contextmanager
def open_source(
    url: str,
    format_name: str | None = None,
    options: dict[str, str] | None = None,
    timeout: float | None = None,
) -> Iterator[InputContainer]:
    """Open a source for the block.

    Raises:
        CameraMismatchError: The source has no video.
        CameraError: The source cannot be opened or read.
        NoRigError: It is the socket of a bench that is not running.
    """
    require_extras("the camera", ["hardware"])
    import av  # noqa: PLC0415  takes 0.1 s

    try:
        with av.open(url, format=format_name, options=options or {}, timeout=timeout) as container:
            if not container.streams.video:
                raise CameraMismatchError("camera.source.url", url, "a source with a video stream")
            yield container
    except av.error.FFmpegError as error:
        if Path(url).is_file():
            allowed = f"a video file that FFmpeg reads ({error.strerror})"
            raise CameraError("video", url, allowed) from None
        if url.startswith("unix:"):
            raise NoRigError("camera.source.url", url, "a running bench") from None
        hint = (
            "a source that can be opened and read; is it connected, and used by no other program?"
        )
        raise CameraError("camera.source.url", url, f"{hint} ({error.strerror})") from None


@contextmanager
def open_video_file(path: str) -> Iterator[InputContainer]:
    """Open a video file for the block. Errors of the block are of an input, not of a rig.

    Raises:
        MissingPathError: The file does not exist.
        CameraError: It is no video.
    """
    if not Path(path).is_file():
        raise MissingPathError("video", path, "a video file")
    try:
        with open_source(path) as container:
            yield container
    except CameraError as error:
        error.exit_status = USAGE
        raise


class Decoder:
    """Decodes the video of an open source into images of the configured size and format.

    Frames are turned as the source says. A damaged one is left out: FFmpeg would fill its gaps.

    Attributes:
        is_interlaced: Whether the source is interlaced; None before the first frame.
        damaged: Number of frames that were left out.
    """

    def __init__(self, container: InputContainer, camera: CameraConfig) -> None:
        self.is_interlaced: bool | None = None
        self.damaged = 0
        self._container = container
        self._stream: VideoStream = container.streams.video[0]
        # Frame threading delays the output by one frame per thread, and loses those after an error.
        self._stream.thread_type = "SLICE"
        self._stream.codec_context.options = {"err_detect": "explode"}
        self._camera = camera
        self._shape = FrameLayout(camera).shape
        self._graph: Graph | None = None

    @property
    def period(self) -> float | None:
        """Nominal time from one frame to the next [s]; None if the source has none."""
        rate = self._stream.average_rate or self._stream.guessed_rate
        if not rate:
            return None
        return 1 / float(rate) / (2 if self._has_fields else 1)

    def __iter__(self) -> Iterator[DecodedFrame]:
        """Decode all frames until the source ends.

        Raises:
            CameraMismatchError: A frame does not have the configured size, or is turned by an angle
            that is no multiple of 90 degrees.
        """
        from av.error import InvalidDataError  # noqa: PLC0415  takes 0.1 s

        for packet in self._container.demux(self._stream):
            try:
                frames = packet.decode()
            except InvalidDataError:
                self.damaged += 1
                continue
            for frame in frames:
                yield from self._decode(frame)
        if self._graph is not None:
            self._graph.push(None)
            yield from self._fields(self._graph)

    @property
    def _has_fields(self) -> bool:
        """Whether each field becomes a frame."""
        choice = self._camera.source.deinterlace
        return choice == "always" or (choice == "bwdif" and bool(self.is_interlaced))

    def _decode(self, frame: av.VideoFrame) -> Iterator[DecodedFrame]:
        self.is_interlaced = bool(self.is_interlaced or frame.interlaced_frame)
        turns = _TURNS.get((frame.rotation + 179) % 360 - 179)
        if turns is None:
            raise CameraMismatchError(
                "camera.source", f"images turned by {frame.rotation} degrees", "multiples of 90"
            )
        if not self._has_fields and not turns:
            yield self._convert(frame)
            return
        if self._graph is None:
            deint = "all" if self._camera.source.deinterlace == "always" else "interlaced"
            fields = (("bwdif", f"mode=send_field:deint={deint}"),) if self._has_fields else ()
            self._graph = _graph(self._stream, (*fields, *turns))
        self._graph.push(frame)
        yield from self._fields(self._graph)

    def _fields(self, graph: Graph) -> Iterator[DecodedFrame]:
        from av.error import BlockingIOError, EOFError  # noqa: PLC0415

        while True:
            try:
                field = graph.pull()
            except (BlockingIOError, EOFError):
                return
            yield self._convert(field)  # type: ignore[arg-type]  # a video graph gives video

    def _convert(self, frame: av.VideoFrame) -> DecodedFrame:
        camera = self._camera
        if (frame.width, frame.height) != (camera.width, camera.height):
            raise CameraMismatchError(
                "camera.source",
                f"images of {frame.width} x {frame.height}",
                f"camera.width x height = {camera.width} x {camera.height}, as calibrated; set "
                "camera.source.options.video_size, or calibrate for this size",
            )
        return DecodedFrame(_pixels(frame, _FORMATS[camera.pixel_format], self._shape), frame.time)


def read_video(path: str, camera: CameraConfig, start: float = 0.0) -> Iterator[Frame]:
    """Read the frames of a video file, or the fields if it is interlaced.

    Args:
        path: The file.
        camera: Size, pixel format, and treatment of interlaced frames.
        start: Capture time of the first frame [s].

    Raises:
        MissingPathError: The file does not exist.
        CameraError: It is no video, has another size, or its frames have no time stamps.
    """
    with open_video_file(path) as container:
        if container.format.flags & _NO_STAMPS:
            raise CameraError(
                "video",
                f"{path}, a raw stream ({container.format.name}) whose frames have no time stamps",
                "a container with them; if no frame was dropped at, say, 25 per second, "
                f"ffmpeg -r 25 -i {path} -c copy clip.mkv makes one",
            )
        first: float | None = None
        decoder = Decoder(container, camera)
        for sequence, decoded in enumerate(decoder):
            if decoded.stamp is None:
                raise CameraError(
                    "video", f"frame {sequence} without a time stamp", "a time stamp per frame"
                )
            first = decoded.stamp if first is None else first
            yield Frame(decoded.image, start + decoded.stamp - first, sequence)
        if decoder.damaged:
            _LOG.warning("%s: %d damaged frames were left out", path, decoder.damaged)


def _graph(stream: VideoStream, filters: tuple[tuple[str, str], ...]) -> Graph:
    """FFmpeg's filters, one after the other: names and arguments."""
    from av.filter import Graph  # noqa: PLC0415

    graph = Graph()
    made = (graph.add(name, arguments or None) for name, arguments in filters)
    graph.link_nodes(graph.add_buffer(template=stream), *made, graph.add("buffersink")).configure()
    return graph


def _pixels(frame: av.VideoFrame, name: str, shape: tuple[int, ...]) -> Image:
    if name != "uyvy422":
        return np.ascontiguousarray(frame.to_ndarray(format=name), dtype=np.uint8)
    # PyAV does not convert this format; the lines of its only plane are padded at the end.
    plane = frame.reformat(format=name).planes[0]
    lines = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)  # type: ignore[call-overload]
    rows, columns, channels = shape
    return np.ascontiguousarray(lines[:rows, : columns * channels].reshape(shape))
