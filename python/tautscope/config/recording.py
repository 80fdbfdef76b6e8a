"""The log of a run."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from tautscope.config.fields import Positive

ImageFormat = Literal["png", "jpeg"]


class RecordingConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Image format and buffers of the log. All [ours]."""

    image_format: ImageFormat = "png"
    """``png`` is lossless, so a replay is identical; ``jpeg`` has a fifth of the size and moves the
    features by up to 0.3 px, so no replay is identical (decision 0020)."""
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 95
    """Quality of ``jpeg``."""
    flush_period: Annotated[float, Meta(gt=0, le=0.2)] = 0.1
    """Largest age of data that is lost if the process is killed [s]."""
    sync_period: Positive = 5.0
    """Largest age of data that is lost if the power fails [s]."""
    queue_events: Annotated[int, Meta(ge=1)] = 20_000
    """Ticks and image updates that may wait for a slow disk; more are dropped with a warning."""
    queue_images: Annotated[int, Meta(ge=1)] = 50
    """Images that may wait for encoder and disk; more are dropped with a warning."""
    close_timeout: Positive = 10.0
    """Time limit for writing the rest of the log at the end of a run [s]."""
