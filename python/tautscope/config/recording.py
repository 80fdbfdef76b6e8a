"""What a run leaves behind."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from tautscope.config.fields import Positive

ImageFormat = Literal["png", "jpeg"]


class RecordingConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The log of a run. All [ours]."""

    image_format: ImageFormat = "png"
    """``png`` is lossless, so that a replay gives the same outputs; ``jpeg`` is a fifth of it and
    moves the features by up to 0.3 px, so that no replay is identical (decision 0020)."""
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 95
    """With ``jpeg``."""
    flush_period: Annotated[float, Meta(gt=0, le=0.2)] = 0.1
    """What is older is in the file if the process is killed [s]."""
    sync_period: Positive = 5.0
    """What is older is on the disk if the power fails [s]."""
    queue_events: Annotated[int, Meta(ge=1)] = 20_000
    """Ticks and image updates that may wait for a slow disk; more are dropped, and it is said."""
    queue_images: Annotated[int, Meta(ge=1)] = 50
    """Images that may wait for encoder and disk; likewise."""
    close_timeout: Positive = 10.0
    """How long the end of a run may wait for a slow disk [s]."""
