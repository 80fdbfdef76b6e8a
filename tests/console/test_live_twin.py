"""The twin in real time: stamps and order of its images."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from running import small_config
from tautscope.console.live_twin import LiveTwin
from tautscope.loop.rig import Frame
from tautscope.twin.rig import Twin


class AtOnce:
    """Renders in the caller's thread."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(function(*arguments))
        return done

    def shutdown(self) -> None: ...


def live_twin(**changes: Any) -> LiveTwin:
    rig = LiveTwin(small_config(**changes))
    rig._renderer.shutdown()
    rig._renderer = AtOnce()  # type: ignore[assignment]
    return rig


def frames(rig: Twin, ticks: int) -> list[Frame]:
    start = rig.reset().applied
    if isinstance(rig, LiveTwin):
        rig._pace.wait = lambda: None  # type: ignore[method-assign]
    samples = [rig.step(start) for _ in range(ticks)]
    return [sample.frame for sample in samples if sample.frame is not None]


@pytest.mark.parametrize("readout", [0.0, 0.03])
def test_its_images_are_stamped_as_those_of_the_twin(readout: float) -> None:
    changes = {
        "camera.source.delay": 0.02,
        "twin.sensor.stamp_error": 0.015,
        "twin.sensor.readout": readout,
    }
    live, plain = live_twin(**changes), Twin(small_config(**changes))
    found, expected = (frames(rig, 60) for rig in (live, plain))
    assert len(found) == len(expected) > 3
    for one, other in zip(found, expected, strict=True):
        assert (one.captured_at, one.sequence) == (other.captured_at, other.sequence)
        assert (one.image == other.image).all()


def test_an_image_from_before_a_reset_is_forgotten() -> None:
    rig = live_twin()
    frames(rig, 224)  # in the last of which an image is rendered, and is put in transit later
    again = frames(rig, 60)
    assert [frame.sequence for frame in again] == list(range(len(again)))
    assert again[0].captured_at < 0.05


def test_a_closed_twin_can_be_reset_as_the_node_does_when_it_is_enabled_again() -> None:
    rig = LiveTwin(small_config())
    for _ in range(2):
        start, deadline = rig.reset().applied, time.monotonic() + 20
        while rig.step(start).frame is None:
            assert time.monotonic() < deadline
        rig.close()
    rig.close()
