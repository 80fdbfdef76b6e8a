"""Video sources for tests: FFmpeg's test sources, and DV as in the article's rig."""

from pathlib import Path
from typing import Any

import av
import numpy as np
from tautscope.config import CameraConfig, SourceConfig
from waiting import TIMEOUT

SIZE = {"width": 64, "height": 48}


def camera(url: str, format_name: str | None = "lavfi", **changes: Any) -> CameraConfig:
    source = {"reconnect_period": 0.01, "start_timeout": TIMEOUT, "timeout": TIMEOUT}
    layout = SIZE | {
        key: changes.pop(key) for key in ("width", "height", "pixel_format") if key in changes
    }
    return CameraConfig(
        **layout, source=SourceConfig(url=url, format=format_name, **(source | changes))
    )


def pattern(more: str = "", size: str = "64x48") -> str:
    return f"testsrc2=size={size}:rate=50{more},realtime"


def write_dv(path: Path, frames: int, pixel_format: str = "yuv420p") -> None:
    """A bright bar that moves 10 px per field. In DV the lower field comes first."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("dvvideo", rate=25)
        stream.width, stream.height, stream.pix_fmt = 720, 576, pixel_format
        for number in range(frames):
            image = np.full((576, 720, 3), 60, np.uint8)
            for line, field in ((1, 2 * number), (0, 2 * number + 1)):
                image[line::2, bar(field) : bar(field) + 40] = 200
            frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=pixel_format)
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def bar(field: int) -> int:
    return 20 + 10 * field
