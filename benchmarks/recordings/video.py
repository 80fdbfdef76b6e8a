"""Lossless image and video formats for recordings: size and processor time."""

import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import zstandard
from numpy.typing import NDArray
from recordings.runs import PERIODS, Sines
from tautscope import Twin, load_config
from tautscope.log.images import ImageCodec

Image = NDArray[np.uint8]
Coded = tuple[list[bytes], bytes | None]
SIZE = (720, 576)
"""Width and height of PAL [px]."""
CODECS: dict[str, tuple[str, str, str, dict[str, str]]] = {
    "FFV1, intra": (
        "ffv1", "ffv1", "bgr0",
        {"level": "3", "g": "1", "coder": "0", "context": "0", "slices": "4"},
    ),
    "FFV1, intra, range coder": (
        "ffv1", "ffv1", "bgr0",
        {"level": "3", "g": "1", "coder": "1", "context": "0", "slices": "4"},
    ),
    "H.264 lossless, intra": (
        "libx264rgb", "h264", "bgr24",
        {"preset": "ultrafast", "qp": "0", "g": "1", "tune": "zerolatency"},
    ),
    "H.264 lossless, g 25": (
        "libx264rgb", "h264", "bgr24",
        {"preset": "ultrafast", "qp": "0", "g": "25", "tune": "zerolatency"},
    ),
}  # fmt: skip
"""Name -> encoder, decoder, pixel format, options; one thread each."""


def video_formats(count: int, folder: Path | None, noise: float | None) -> list[dict[str, object]]:
    """Compare lossless formats on images of the twin, or those of a folder scaled to PAL.

    Args:
        count: Number of images, at most.
        folder: Folder of images; None for the twin.
        noise: Image noise of the twin [grey levels]; None for its default.
    """
    images = _twin_images(count, noise) if folder is None else _folder_images(count, folder)
    rows = [_row("PNG, stored; zstd 1", images, _png, _png_decoded)]
    for name, (encoder, decoder, pixels, options) in CODECS.items():
        rows.append(
            _row(
                name,
                images,
                lambda frames, c=encoder, p=pixels, o=options: _encode(frames, c, p, o),
                lambda coded, c=decoder, p=pixels: _decode(coded, c, p),
            )
        )
    return rows


def _row(
    name: str,
    images: list[Image],
    encode: Callable[[list[Image]], Coded],
    decode: Callable[[Coded], list[Image]],
) -> dict[str, object]:
    begin = time.process_time()
    coded = encode(images)
    middle = time.process_time()
    decoded = decode(coded)
    end = time.process_time()
    pairs = zip(images, decoded, strict=True)
    return {
        "format": name,
        "images": len(images),
        "kilobytes": round(sum(map(len, coded[0])) / len(images) / 1e3),
        "write_milliseconds": round(1e3 * (middle - begin) / len(images), 1),
        "read_milliseconds": round(1e3 * (end - middle) / len(images), 1),
        "identical": all(np.array_equal(image, again) for image, again in pairs),
    }


def _png(images: list[Image]) -> Coded:
    config = load_config()
    codec, compressor = (
        ImageCodec(config.camera, config.recording),
        zstandard.ZstdCompressor(level=1),
    )
    return [compressor.compress(codec.encode(image)) for image in images], None


def _png_decoded(coded: Coded) -> list[Image]:
    config = load_config()
    codec, decompressor = ImageCodec(config.camera, config.recording), zstandard.ZstdDecompressor()
    return [codec.decode(decompressor.decompress(data)) for data in coded[0]]


def _encode(images: list[Image], codec: str, pixels: str, options: dict[str, str]) -> Coded:
    context = av.CodecContext.create(codec, "w")
    context.width, context.height = SIZE
    context.pix_fmt, context.time_base = pixels, Fraction(1, 25)
    context.thread_count, context.options = 1, options
    packets = []
    for number, image in enumerate(images):
        frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=pixels)
        frame.pts = number
        packets += context.encode(frame)
    packets += context.encode(None)
    return [bytes(packet) for packet in packets], context.extradata


def _decode(coded: Coded, codec: str, pixels: str) -> list[Image]:
    context = av.CodecContext.create(codec, "r")
    context.extradata = coded[1]
    context.width, context.height = SIZE
    context.thread_count = 1
    if codec == "ffv1":
        context.pix_fmt = pixels
    packets: list[av.Packet | None] = [av.Packet(data) for data in coded[0]]
    return [
        np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8)
        for packet in [*packets, None]
        for frame in context.decode(packet)
    ]


def _twin_images(count: int, noise: float | None) -> list[Image]:
    changes = {} if noise is None else {"twin.image_noise": noise}
    config = load_config().replace(**changes)
    twin, motion = Twin(config), Sines(config.experiment, PERIODS, np.inf)
    images: list[Image] = []
    sample = twin.reset()
    while len(images) < count:
        sample = twin.step(motion(sample.time))
        if sample.frame is not None:
            images.append(sample.frame.image.copy())
    return images


def _folder_images(count: int, folder: Path) -> list[Image]:
    files = sorted(file for file in folder.iterdir() if file.suffix in (".jpg", ".png"))
    images = [cv2.imread(str(file)) for file in files[:count]]
    return [np.asarray(cv2.resize(image, SIZE), np.uint8) for image in images if image is not None]
