"""The console without a browser: lease, motion, stop, faults of the connection, log."""

import os
import signal
import time
from pathlib import Path

import cv2
import pytest
from console.pages import PERIOD
from running import (
    TIMEOUT,
    Page,
    RunningConsole,
    receive_image,
    rests,
    running_console,
    small_config,
)
from tautscope.log.reader import Request, read_log
from tautscope.log.replay import replay_same


@pytest.fixture
def page(console: RunningConsole) -> Page:
    found = console.page()
    found.take()
    assert found.request(type="action", name="enable")["is_accepted"]
    yield found
    found.close()
    while console.control.lease.holder == found.client:
        time.sleep(0.01)


def test_hold_to_move_and_rest_when_released(console: RunningConsole, page: Page) -> None:
    assert rests(console)
    before = console.command
    page.move()
    assert (console.command != before).any()
    page.servo(is_holding=False)
    page.wait(lambda: page.state["motion"] == "ready")
    assert rests(console)


def test_motion_stops_in_the_control_process_when_the_page_is_silent(
    console: RunningConsole, page: Page
) -> None:
    page.move()
    time.sleep(TIMEOUT + 0.1)
    assert rests(console)
    assert console.control.operator.must_release


def test_the_web_server_killed_while_moving_stops_motion(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        page = console.page()
        page.take()
        page.move()
        os.kill(console.server.pid, signal.SIGKILL)
        time.sleep(TIMEOUT + 0.1)
        assert rests(console)


def test_a_closed_page_gives_up_the_lease(console: RunningConsole) -> None:
    page = console.page()
    page.take()
    page.move()
    page.close()
    deadline = time.monotonic() + 10
    while console.control.lease.holder is not None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert rests(console)


def test_stop_from_anyone_is_latched(console: RunningConsole, page: Page) -> None:
    watcher = console.page()
    watcher.wait(lambda: bool(watcher.state))
    page.move()
    watcher.send({"type": "stop"})
    page.wait(lambda: page.state["motion"] == "stopped")
    page.servo(is_holding=False)
    page.servo()
    assert rests(console)
    watcher.send({"type": "stop"})  # again: nothing else
    reply = page.request(type="action", name="home")
    assert reply["reason"] == "motion is stopped"
    assert page.request(type="action", name="enable")["is_accepted"]
    assert rests(console)
    page.move()
    watcher.close()


def test_a_second_page_watches_until_it_takes_over(console: RunningConsole, page: Page) -> None:
    second = console.page()
    second.wait(lambda: bool(second.state))
    fields = {"lease": page.state["lease"], "image": page.state["image"]["sequence"]}
    for k in range(100):
        second.send(
            {"type": "servo", **fields, "sequence": k, "axes": [1, 0, 0], "is_holding": k % 5 > 0}
        )
    second.send({"type": "action", "name": "home", **fields, "sequence": 1})
    second.wait(lambda: bool(second.replies))
    assert second.replies[0]["reason"] == "another has the lease"
    assert rests(console)
    page.move()
    second.take()
    assert rests(console)
    page.wait(lambda: page.state["holder"] == second.client)
    page.servo(is_holding=False)
    page.servo()
    assert rests(console)
    second.move()
    second.close()


def test_settings_programs_and_profile(console: RunningConsole, page: Page) -> None:
    def setting(name: str, value: float, **more: str) -> None:
        found = page.request(type="setting", name=name, value=value, **more)
        assert found["is_accepted"], found

    setting("scale", 0.7, dof="rotation")
    setting("clutch", 0, dof="bending")
    setting("compensation", 0.5)
    page.wait(lambda: page.state["compensation"] == 0.5)
    assert page.state["scale"][1] == 0.7
    assert page.state["clutch"] == [True, True, False]
    setting("clutch", 1, dof="bending")
    setting("compensation", 1)
    before = console.command
    assert page.request(type="profile", profile="paper")["is_accepted"]
    page.wait(lambda: page.state["profile"] == "paper")
    assert rests(console)
    assert (console.command == before).all()
    assert page.request(type="profile", profile="best")["is_accepted"]
    page.let_go()
    page.wait(lambda: page.request(type="action", name="sweep")["is_accepted"], PERIOD)

    def present() -> bool:
        page.servo(is_holding=False)
        return bool(page.state["progress"] > 0.005)

    page.wait(present, PERIOD)
    assert page.state["program"] == "calibration sweep"
    page.servo((1, 0, 0))  # the operator takes over
    page.wait(lambda: not page.state["program"])


def test_the_tip_shown_in_paper_is_where_the_instrument_is(
    console: RunningConsole, page: Page
) -> None:
    """Not where a model is that knows no slack yet: it follows the command at once."""
    page.let_go()
    start = console.control.operator.reference[1]
    side = -1 if start > 0 else 1

    def has_travelled() -> bool:
        insertion, rotation, bending = page.state["reference"]
        # Of an instrument in the channel or straight no image tells the rotation.
        out = 1 if insertion < 0.02 else 0
        bend = 0 if abs(bending - 0.9) < 0.1 else 1 if bending < 0.9 else -1
        # Rotation last: the tip shall lag as far as the slack lets it.
        turn = 0 if out or bend else side
        page.servo((out, turn, bend), is_holding=not page.state["must_release"])
        return abs(rotation - start) > 1.2 and bend == out == 0

    page.wait(has_travelled, PERIOD)
    page.servo(is_holding=False)
    page.wait(lambda: page.state["motion"] == "ready")
    assert page.request(type="profile", profile="paper")["is_accepted"]
    page.wait(lambda: page.state["profile"] == "paper" and page.state["image"]["updates"] > 20)
    page.wait(lambda: page.state["tip"][1] is not None)
    run = console.control.run
    assert run is not None
    true = run.sample.true_state[1]
    assert page.state["tip"][1] == pytest.approx(true, abs=0.15)
    assert abs(run.loop.predicted_state[1] - true) > 0.3
    assert page.request(type="profile", profile="best")["is_accepted"]


@pytest.mark.parametrize("text", ["\x01" * 200, "\N{ROCKET}" * 150, "\x7f\t\n" * 66])
def test_any_mark_that_is_accepted_leaves_the_connection_open(
    console: RunningConsole, page: Page, text: str
) -> None:
    assert page.request(type="action", name="mark", text=text)["is_accepted"]
    assert page.request(type="action", name="mark", text="again")["is_accepted"]


def test_a_long_error_is_shown_and_ends_nothing(
    console: RunningConsole, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.control, "fault", "\x01" * 5000)
    monkeypatch.setattr(console.control, "run", None)
    monkeypatch.setattr(console.control, "open", lambda: None)
    reply = page.request(type="action", name="enable")
    assert reply["reason"].startswith("\x01" * 100)
    page.wait(lambda: page.state["motion"] == "off")
    assert "\x01" * 100 in page.state["message"]


def test_everything_is_in_the_log_and_the_log_replays(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        page = console.page()
        page.take()
        page.move((0, 1, 1))
        formats, replies = [], []
        for action in ("record", "still", "record", "acknowledge"):
            replies.append(page.request(type="action", name=action))
            formats.append(console.control.run.log.image_format)
        assert formats == ["png", "png", "jpeg", "jpeg"]
        assert all(reply["is_accepted"] for reply in replies)
        path = tmp_path / "console-1.mcap"
        assert f"tautscope console --replay {path}" in replies[2]["reason"]
        page.request(type="setting", name="compensation", value=0)
        page.move((0, -1, 0))
        page.request(type="action", name="mark", text="here")
        page.send({"type": "stop"})
        page.wait(lambda: page.state["motion"] == "stopped")
        while not (tmp_path / "still-1.png").exists():
            time.sleep(0.01)
        while console.control.run.ticks <= 100:
            time.sleep(0.01)
    log = read_log(tmp_path / "console-1.mcap")
    texts = [event.text for event in log.events.values() if isinstance(event, Request)]
    found = [text.partition(": ")[2] or text for text in texts]
    for text in (
        "note take 1 begins", "still", "note take 1 ends", "acknowledge", "set_compensation 0.0",
        "mark here", "note STOP by page 1",
    ):  # fmt: skip
        assert text in found, (text, texts)
    shape = small_config().camera.height, small_config().camera.width, 3
    assert cv2.imread(str(tmp_path / "still-1.png")).shape == shape
    # Images are JPEG here, so estimates differ; commands do not depend on them in this time.
    comparison, _ = replay_same(log)
    assert comparison.ticks > 100


def test_a_slow_video_client_delays_no_command(console: RunningConsole, page: Page) -> None:
    video = console.page("/video")
    _, image = receive_image(video)  # and then it reads no more
    assert image.shape[:2] == (small_config().camera.height, small_config().camera.width)
    newest = console.control.images.newest
    while console.control.images.newest < newest + 20:
        time.sleep(0.02)
    page.move()
    page.servo(is_holding=False)
    video.close()


def test_images_are_as_large_as_the_largest_page_shows_them(console: RunningConsole) -> None:
    full = small_config().camera.width
    small, large = console.page("/video"), console.page("/video")
    widths = {small: full // 2, large: full // 2}

    def wait_for(width: int) -> None:
        for _ in range(100):
            for page, shown in widths.items():
                overlay, image = receive_image(page)
                page.send({"type": "drawn", "image": overlay["sequence"], "width": shown})
                assert overlay["width"] == full
            if image.shape[1] == width:
                return
        pytest.fail(f"images {image.shape[1]} px wide, not {width}")

    wait_for(full // 2)
    widths[large] = full // 2 + 1
    wait_for(full)
    small.close()
    large.close()
