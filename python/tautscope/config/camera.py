"""Configuration of the camera: projection, image source, pose of the guide."""

from typing import Annotated, Literal

from msgspec import Meta, field

from tautscope.config.fields import Position, Positive, Rotation
from tautscope.config.section import Section, require

PixelFormat = Literal["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"]
Deinterlace = Literal["bwdif", "always", "none"]
CameraClock = Literal["stream", "device", "arrival"]
Pixel = Annotated[float, Meta(ge=-8192, le=16384)]
Coefficient = Annotated[float, Meta(ge=-1000, le=1000)]
Vector8 = tuple[
    Coefficient, Coefficient, Coefficient, Coefficient,
    Coefficient, Coefficient, Coefficient, Coefficient,
]  # fmt: skip


class PoseConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pose of the guide, where the instrument leaves the scope, in the camera frame."""

    translation: Position = (13.5e-3, 14e-3, 15e-3)
    """Origin of the guide in the camera frame: x right, y down, z forward [m] [ours]."""
    rotation: Rotation = (0.32, -0.26, 0.0)
    """Rotation vector from guide to camera coordinates [rad]; the guide's z axis is that of the
    channel, outwards [ours]."""


class SourceConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The source of a camera's images, in FFmpeg's terms. All [ours]."""

    url: str = "/dev/video0"
    """Device, file, ``pipe:0``, ``udp://...``, ``rtsp://...``, or a filter graph of lavfi."""
    format: str = "v4l2"
    """FFmpeg's input format: v4l2, dv, mpegts, lavfi, ...; "" lets it detect the format."""
    options: dict[str, str] = field(default_factory=dict)
    """FFmpeg's options: ``video_size``, ``framerate``, ``input_format``, ..."""
    deinterlace: Deinterlace = "bwdif"
    """``bwdif`` makes each field a frame, one frame late; ``always`` also where the source does not
    say that it is interlaced."""
    clock: CameraClock = "stream"
    """Capture time: ``stream``, the time stamp, mapped to our clock by the frame with the lowest
    latency in `clock_window`; ``device``, that of V4L2 on the monotonic clock; ``arrival``, for a
    source without stamps."""
    clock_window: Positive = 10.0
    """Window of ``clock = "stream"`` [s]."""
    delay: Annotated[float, Meta(ge=0, le=10)] = 0.0
    """Time from exposure to stamp for ``device``, else lowest time from exposure to arrival [s], by
    `tautscope calibrate latency` or `geometry`."""
    timeout: Positive = 2.0
    """Time without a frame after which the source is opened again [s]."""
    reconnect_period: Positive = 0.5
    """Time between two attempts [s]."""
    start_timeout: Positive = 10.0
    """Time limit of the self-test at the start [s]."""
    lost_timeout: Positive = 5.0
    """Time without a frame after which a run on hardware ends and the motors stop [s]."""
    darkest: Annotated[int, Meta(ge=1, le=255)] = 24
    """An image without a pixel above this is black [grey levels]; video black is 16."""


class CameraConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pinhole camera with OpenCV's distortion model, Eq. (8)."""

    width: Annotated[int, Meta(ge=1, le=8192)] = 720
    """Width of the images [px], PAL DV [paper]."""
    height: Annotated[int, Meta(ge=1, le=8192)] = 576
    """Height of the images [px], PAL DV [paper]."""
    pixel_format: PixelFormat = "bgr"
    """Layout of the 8-bit pixels. YUV formats are BT.601 with limited range and need an even width,
    nv12 and i420 an even height."""
    fx: Positive = 424.0
    """Focal length along x [px] [public colonoscope calibration]."""
    fy: Positive = 454.0
    """Focal length along y [px]; DV pixels are not square."""
    cx: Pixel = 349.6
    """Principal point, u [px]."""
    cy: Pixel = 285.0
    """Principal point, v [px]."""
    distortion: Vector8 = (-0.18, 0.05, 0.0, 0.0, -0.005, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, k3, k4, k5, k6, as in OpenCV [ours]."""
    source: SourceConfig = field(default_factory=SourceConfig)
    camera_from_guide: PoseConfig = field(default_factory=PoseConfig)

    def _check(self) -> None:
        """Pixels that share U and V are in pairs."""
        halved = {"yuyv": 1, "uyvy": 1, "nv12": 2, "i420": 2}.get(self.pixel_format, 0)
        for name in ("width", "height")[:halved]:
            side = getattr(self, name)
            require(side % 2 == 0, name, side, f"even, for {self.pixel_format}")
