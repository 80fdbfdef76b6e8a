"""Conversion of a source's time stamps to the computer's clock."""

import numpy as np
import pytest
from tautscope.config import SourceConfig
from tautscope.errors import CameraError
from tautscope.hardware.cameras import Capture, check_first_frames
from tautscope.hardware.stream_clock import StreamClock
from tautscope.loop.rig import Frame
from video_sources import camera


def captures(stamps: list[float], lag: float = 0.05) -> list[Capture]:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (48, 64, 3)).astype(np.uint8) for _ in stamps]
    return [
        Capture(Frame(image, at, number), at + lag)
        for number, (image, at) in enumerate(zip(images, stamps, strict=True))
    ]


def test_time_stamps_of_another_clock_are_refused() -> None:
    config = camera("x", clock="device")
    good = [0.02 * k for k in range(8)]
    check_first_frames(captures(good), config)
    with pytest.raises(CameraError, match=r"camera\.source\.clock.*captured 1e\+06 s before"):
        check_first_frames(captures(good, lag=1e6), config)
    with pytest.raises(CameraError, match=r"captured -0\.2 s before"):
        check_first_frames(captures(good, lag=-0.2), config)
    with pytest.raises(CameraError, match="do not increase"):
        check_first_frames(captures(good[::-1]), config)
    with pytest.raises(CameraError, match="3 frames in 60 s"):
        check_first_frames(captures(good[:3]), config)


def test_stream_clock_rejects_arrival_jitter() -> None:
    """Frames 0.04 s apart that take 30 ms and up to 25 ms more, on a clock 1000 s off."""
    rng = np.random.default_rng(1)
    true = 0.04 * np.arange(500)
    arrived = true + 0.03 + 0.025 * rng.beta(1, 3, len(true))
    clock = StreamClock(SourceConfig(delay=0.03))
    found = np.array([clock.captured_at(t + 1000, a) for t, a in zip(true, arrived, strict=True)])
    assert np.all(found <= arrived)
    assert np.abs(found - true)[50:].max() < 1.5e-3
    naive = arrived - 0.03
    assert np.abs(found - true)[50:].max() < 0.1 * np.abs(naive - true)[50:].max()


def test_stream_clock_resets_after_a_jump() -> None:
    clock = StreamClock(SourceConfig())
    for k in range(5):
        clock.captured_at(0.04 * k, 100 + 0.04 * k)
    assert clock.captured_at(7000.0, 101.0) == pytest.approx(101.0)
    assert clock.captured_at(7000.04, 101.05) == pytest.approx(101.04)
    assert StreamClock(SourceConfig(clock="arrival", delay=0.1)).captured_at(5.0, 9.0) == 8.9
    assert StreamClock(SourceConfig(clock="device", delay=0.1)).captured_at(5.0, 9.0) == 4.9
    assert StreamClock(SourceConfig()).captured_at(None, 9.0) == 9.0
