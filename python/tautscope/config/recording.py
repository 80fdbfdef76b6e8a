"""Configuration of the log of a run."""

from typing import Annotated, Literal, get_args

from msgspec import Meta

from tautscope.config.fields import Positive
from tautscope.config.section import Section

ImageFormat = Literal["png", "jpeg"]
IMAGE_FORMATS: tuple[ImageFormat, ...] = get_args(ImageFormat)


class RecordingConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Image format and buffers of the log. All [ours]."""

    image_format: ImageFormat = "png"
    """``png`` is lossless, so that replays are identical; ``jpeg`` takes a fifth of the space and
    shifts features by up to 0.3 px."""
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 95
    """JPEG quality, for ``jpeg``."""
    flush_period: Annotated[float, Meta(gt=0, le=0.2)] = 0.1
    """Data lost at most if the process is killed [s]."""
    sync_period: Positive = 5.0
    """Data lost at most if the power fails [s]."""
    queue_events: Annotated[int, Meta(ge=1)] = 20_000
    """Queue length for ticks and image updates; more are dropped with a warning."""
    queue_images: Annotated[int, Meta(ge=1)] = 50
    """The same for images."""
    close_timeout: Annotated[float, Meta(gt=0, le=300)] = 10.0
    """Longest wait for the disk at the end of a run [s]."""
