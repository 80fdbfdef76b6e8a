"""The node with a rig of one's own: a stop during its reset, which may move motors."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tautscope
from common.small_images import with_small_images
from numpy.typing import ArrayLike
from ros2.peers import peers
from service_client import Client
from tautscope.errors import StateError
from tautscope.loop.measurement import Tip
from tautscope.loop.rig import Sample
from tautscope.ros2 import messages
from tautscope.ros2.endpoints import IMAGE
from tautscope.ros2.session import SENSOR_DATA
from tautscope.ros2.wire import Qos
from tautscope.twin import Twin


class Arm:
    """Its reset moves for 0.3 s, or longer until it is interrupted."""

    control_period = 0.005

    def __init__(self) -> None:
        self.is_closed = self.is_interrupted = False
        self.duration, self.time = 0.3, 0.0

    def reset(self) -> Sample:
        end = time.monotonic() + self.duration
        while time.monotonic() < end and not self.is_interrupted:
            time.sleep(0.001)
        if self.is_interrupted:
            raise StateError("rig", "interrupted", "Call reset() to start again")
        return self.step(np.zeros(2))

    def step(self, command: ArrayLike) -> Sample:
        self.time += self.control_period
        position = np.array(command)
        return Sample(self.time, position, measurement=Tip(position, self.time))

    def close(self) -> None:
        self.is_closed = True


class Interrupted(Arm):
    def __init__(self) -> None:
        super().__init__()
        self.duration = 20.0

    def interrupt(self) -> None:
        self.is_interrupted = True


@pytest.mark.parametrize("command", ["pause", "disable"])
@pytest.mark.parametrize("kind", [Interrupted, Arm])
def test_a_stop_while_a_rig_resets_is_not_forgotten(
    tmp_path: Path, kind: type[Arm], command: str
) -> None:
    arm, config = kind(), tautscope.axes(2, width_limit=1.2, unit="rad")
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        for text in ("enable", command):
            both.requests.publish({"string": text})
        both.delivered()
        both.control.serve()
        assert both.control.run is None
        assert both.control.operating_state == "FAULT"
        assert arm.is_closed
        assert arm.is_interrupted == (kind is Interrupted)


class Disabled(Arm):
    is_disabled = False

    def disable(self) -> None:
        self.is_disabled = True


@pytest.mark.parametrize("kind", [Disabled, Arm])
def test_disable_reaches_a_rig_that_has_it(tmp_path: Path, kind: type[Arm]) -> None:
    arm, config = kind(), tautscope.axes(2, width_limit=1.2, unit="rad")
    arm.duration = 0.0
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        both.enable(np.zeros(2))
        both.request("disable")
        assert both.control.run is None
        assert getattr(arm, "is_disabled", arm.is_closed)


def test_a_stop_that_the_drives_do_not_confirm_is_in_the_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, config = Arm(), tautscope.axes(2, width_limit=1.2, unit="rad")
    arm.duration = 0.0
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        both.enable(np.zeros(2))
        error = StateError("bend_y", "fault 12", "See the manual")
        error.add_note("bend_x: quick stop is not confirmed")

        def broken(command: ArrayLike) -> Sample:
            raise error

        monkeypatch.setattr(arm, "step", broken)
        both.tick()
        assert both.control.fault.endswith("; bend_x: quick stop is not confirmed")
        assert both.control.fault in [each.data for each in both.drain(both.warnings)]


class NotDisabled(Disabled):
    def disable(self) -> None:
        super().disable()
        raise StateError("bend_x", "quick stop is not confirmed", "Cut the power")


def test_a_stop_that_is_not_confirmed_stays_a_fault_until_the_rig_is_enabled(
    tmp_path: Path,
) -> None:
    arm, config = NotDisabled(), tautscope.axes(2, width_limit=1.2, unit="rad")
    arm.duration = 0.0
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        both.enable(np.zeros(2))
        for _ in range(2):
            both.request("disable")
            assert both.control.operating_state == "FAULT"
            assert "not confirmed" in both.control.fault
            assert both.control.is_unconfirmed
        both.enable(np.zeros(2))
        assert both.control.operating_state == "ENABLED"
        assert not both.control.is_unconfirmed


class OffClock(Arm):
    """Its sensor's clock is not the rig's."""

    off = 0.0

    def step(self, command: ArrayLike) -> Sample:
        sample = super().step(command)
        return replace(sample, measurement=Tip(np.zeros(2), self.off))


@pytest.mark.parametrize("off", [1e12, -1.8e9, -1e12, 1e308])
def test_a_measurement_whose_time_is_far_off_ends_nothing(tmp_path: Path, off: float) -> None:
    arm, config = OffClock(), tautscope.axes(2, width_limit=1.2, unit="rad")
    arm.duration, arm.off = 0.0, off
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        both.enable(np.zeros(2))
        for _ in range(5):
            both.tick()
        assert both.control.run is not None
        assert both.control.run.loop.updates > 0
        assert not both.control.run.log.failure


class Unconfirmed(Arm):
    def close(self) -> None:
        super().close()
        raise StateError("bend_y", "quick stop is not confirmed", "Use the emergency stop")


def test_a_rig_that_does_not_stop_leaves_the_first_fault_and_the_node(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, config = Unconfirmed(), tautscope.axes(2, width_limit=1.2, unit="rad")
    make: Any = lambda _: arm  # noqa: E731

    def broken(*_: Any) -> Sample:
        raise StateError("bend_x", "fault 12", "See the manual")

    with peers(config, tmp_path, make_rig=make) as both:
        for call in ("reset", "step"):
            arm.duration = 0.0
            if call == "step":
                both.enable(np.zeros(2))
            with monkeypatch.context() as patch:
                patch.setattr(arm, call, broken)
                both.request("enable") if call == "reset" else both.tick()
            assert both.control.operating_state == "FAULT"
            first, _, second = both.control.fault.partition("; ")
            assert first.startswith("bend_x: fault 12"), call
            assert second.startswith("bend_y: quick stop is not confirmed"), call
        arm.close = lambda: None  # type: ignore[method-assign]


def test_the_share_of_the_compensation_in_use_is_published(tmp_path: Path) -> None:
    arm, config = Arm(), tautscope.axes(2, width_limit=1.2, unit="rad")
    arm.duration = 0.0
    make: Any = lambda _: arm  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both, Client(both) as client:
        shares = both.other.subscription(
            "/instrument/hysteresis/compensation", "std_msgs/msg/Float64", Qos(depth=100)
        )
        both.delivered(resend=True)
        both.enable(np.zeros(2))
        for share in (1.0, 0.0):
            client.set_parameters(("compensation", share))
            both.drain(shares)
            for _ in range(5):
                both.tick()
            assert {each.data for each in both.drain(shares)} == {share}


def test_an_image_that_cannot_be_sent_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion goes on: images are for people."""

    def cannot(*_: object) -> None:
        raise ValueError("no such encoding")

    config = with_small_images(tautscope.load_config())
    make: Any = lambda _: Twin(config)  # noqa: E731
    with peers(config, tmp_path, make_rig=make) as both:
        monkeypatch.setattr(messages, "image", cannot)
        images = both.other.subscription("/endoscope/image_raw", IMAGE, SENSOR_DATA)
        both.delivered(resend=True)
        both.request("enable")
        for _ in range(40):
            both.tick()
        told = [each.data for each in both.drain(both.warnings)]
        assert "an image was not sent: no such encoding" in told
        assert images.take() is None
