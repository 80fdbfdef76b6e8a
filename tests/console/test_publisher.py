"""Images that cannot be shown, and states that the web server cannot read."""

import logging
import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from running import small_config
from tautscope.console import messages as msg
from tautscope.console.live_twin import LiveTwin
from tautscope.console.rig_control import RigControl
from tautscope.console.session import Session
from tautscope.console.shared import Channels, SharedMemory
from tautscope.console.start import web_server


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_an_image_that_cannot_be_shown_is_told_and_the_next_is_shown(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = small_config()
    memory = SharedMemory(multiprocessing.get_context("spawn"), config)
    shown, channels = Channels(memory), Channels(memory)
    image = np.zeros(memory.shape, np.uint8)
    with ThreadPoolExecutor(1) as executor:
        control = RigControl(config, LiveTwin(config), tmp_path, executor)
        session = Session(control, channels)

        def show(pixels: np.ndarray) -> None:
            session._publisher.submit(1, pixels, time.monotonic())

        def message() -> str:
            session._published_at = 0.0
            session._publish()
            found = shown.state.newest()
            assert found is not None
            return str(msg.decode_state(found[1])["message"])

        try:
            for count in (1, 2):  # the same problem again later is told again
                for _ in range(3):
                    show(image[:-1])
                    wait(lambda: "No image is shown: ValueError" in message())
                warnings = [each for each in caplog.records if each.levelno >= logging.WARNING]
                assert len(warnings) == count
                assert "No image is shown: ValueError" in warnings[-1].getMessage()
                assert shown.images.newest() is None
                show(image + np.uint8(count))
                wait(lambda: "No image" not in message())
                found = shown.images.newest()
                assert found is not None
                assert (found[0] == count).all()
        finally:
            control.shut_down()
            session._publisher.close()


@pytest.mark.parametrize("channel", ["state", "replies"])
def test_a_server_that_cannot_read_what_it_shows_ends(
    channel: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without a state nobody should steer: the control process then stops motion."""
    config = small_config()
    with web_server(config, 0) as (server, channels, _):
        getattr(channels, channel).write(b"no message")
        server.join(20)
        assert server.exitcode == 1
    assert "JSON is malformed" in capfd.readouterr().err
