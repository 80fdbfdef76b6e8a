"""The page in a real browser, Debian's chromium."""

import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tautscope
from common.paths import ROOT
from console.steering import DEVICES, GAMEPAD, holding, use_all_controls
from playwright.sync_api import Browser, Page, expect, sync_playwright
from running import AGE, Arm, RunningConsole, rests, running_console
from tautscope.config import load_config
from tautscope.console.control_run import ControlRun
from tautscope.console.log_player import LogPlayer
from tautscope.console.messages import Setting
from tautscope.console.paced_rig import PacedRig
from tautscope.console.start import web_server
from tautscope.console.uncompensated import Score
from tautscope.dof import Dof
from tautscope.log.reader import read_log
from tautscope.log.writer import LogWriter
from tautscope.loop.construction import build_feature_model
from tautscope.loop.rig import Sample
from tautscope.loop.safety import REMEDIES, by_urgency

CHROMIUM = shutil.which("chromium") or "/usr/bin/chromium"
AXE = ROOT / "target" / "axe-core" / "package" / "axe.min.js"
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-quic", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
]  # fmt: skip
TIMEOUT = 20_000  # ms


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not Path(CHROMIUM).exists():
        pytest.skip("no chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


@pytest.fixture
def open_page(browser: Browser, console: RunningConsole) -> Iterator[Callable[..., Page]]:
    """Opens pages in a window; each must be free of errors and of requests to others."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(TIMEOUT)
    problems: list[str] = []

    def open_one(query: str = "", script: str = "") -> Page:
        page = context.new_page()
        page.on("console", lambda message: problems.append(message.text))
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("request", lambda request: check(request.url))
        if script:
            page.add_init_script(script)
        page.goto(f"{console.origin}/{query}#token={console.token}")
        expect(page.locator("body")).not_to_have_attribute("data-motion", "lost", timeout=TIMEOUT)
        expect(page.locator("#stale")).to_be_hidden(timeout=TIMEOUT)
        return page

    def check(url: str) -> None:
        if not url.startswith((console.origin, f"ws://{console.host}")):
            problems.append(f"request to {url}")

    yield open_one
    context.close()
    wait(lambda: console.control.lease.holder is None)
    console.control.operator.enable()
    assert not problems


def wait(condition: Callable[[], Any]) -> None:
    deadline = time.monotonic() + TIMEOUT / 1000
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def take(page: Page) -> None:
    if page.is_visible("#take"):
        page.click("#take")
    expect(page.locator("#lease")).to_have_text("You have control.", timeout=TIMEOUT)
    if page.get_attribute("body", "data-motion") == "stopped":
        page.click("#enable")
    expect(page.locator("#hint")).to_contain_text("Hold a key", timeout=TIMEOUT)


def overflow(page: Page, *sides: str) -> list[str]:
    """Elements that end outside of the window, at sides or both right and bottom."""
    return page.evaluate(  # type: ignore[no-any-return]
        "sides => [...document.querySelectorAll('body > *, fieldset, button')].filter(each => {"
        " const box = each.getBoundingClientRect();"
        " const end = {right: innerWidth, bottom: innerHeight};"
        " return box.width && sides.some(side => box[side] > end[side] + 1)})"
        ".map(each => each.id || each.textContent)",
        sides or ("right", "bottom"),
    )


def moves(console: RunningConsole) -> bool:
    return bool(console.control.operator.is_moving)


def test_the_page_shows_the_loop(console: RunningConsole, open_page) -> None:
    page = open_page()
    assert "token" not in page.url
    expect(page.locator("#mode")).to_have_text("SIMULATED")
    expect(page.locator("#message")).to_contain_text("Compensating")
    assert page.evaluate("[image.width, image.height]") == [180, 144]
    assert page.evaluate("document.querySelectorAll('.dof canvas').length") == 9
    page.reload()  # the token is kept for this tab
    expect(page.locator("body")).not_to_have_attribute("data-motion", "lost", timeout=TIMEOUT)
    assert rests(console, 0.1)


def test_images_that_cannot_be_decoded_do_not_end_the_others(open_page) -> None:
    """The server sends no third image before the page has taken the first."""
    open_page(
        script="""
        const decode = createImageBitmap;
        let count = 0;
        window.createImageBitmap = (data) => (count++ < 5 ? Promise.reject() : decode(data));
        """
    )


def test_keys_move_while_they_are_held(console: RunningConsole, open_page) -> None:
    page = open_page()
    page.keyboard.down("ArrowUp")  # without the lease
    assert rests(console)
    page.keyboard.up("ArrowUp")
    take(page)
    for key, dof in (("ArrowUp", 0), ("ArrowRight", 1), ("KeyS", 2)):
        before = console.control.operator.reference
        page.keyboard.down(key)
        wait(lambda: moves(console))
        page.keyboard.up(key)
        wait(lambda: not moves(console))
        moved = console.control.operator.reference - before
        assert [k for k in range(3) if moved[k]] == [dof]


def test_the_charts_are_drawn_where_the_page_is_not_rendered_at_first(open_page) -> None:
    page = open_page(script="window.ResizeObserver = class { observe() {} }")
    expect(page.locator(".chart canvas")).to_have_count(9, timeout=TIMEOUT)


@pytest.mark.parametrize(
    "script",
    [
        "dispatchEvent(new Event('blur')); document.hasFocus = () => false",
        "Object.defineProperty(document, 'visibilityState', {value: 'hidden'});"
        "document.dispatchEvent(new Event('visibilitychange'))",
    ],
    ids=["focus", "hidden"],
)
def test_a_page_without_focus_or_hidden_moves_nothing(
    console: RunningConsole, open_page, script: str
) -> None:
    page = open_page()
    take(page)
    page.keyboard.down("ArrowUp")
    wait(lambda: moves(console))
    page.evaluate(script)
    wait(lambda: not moves(console))
    assert rests(console)


def test_a_gamepad_moves_while_its_button_is_held(console: RunningConsole, open_page) -> None:
    page = open_page(script=GAMEPAD)
    take(page)
    page.evaluate("pad.axes = [0.8, 0, 0, 0]")
    assert rests(console)
    page.evaluate("pad.buttons[5].pressed = true")
    wait(lambda: moves(console))
    page.evaluate("pad.buttons[5].pressed = false")
    wait(lambda: not moves(console))
    page.evaluate("pad.buttons[1].pressed = true")
    expect(page.locator("#motion")).to_have_text("STOPPED", timeout=TIMEOUT)


REST4, REST8 = [0, 0, 0, 0], [0, 0, -1, 0, 0, -1, 0, 0]
PADS = {  # mapping, axes at rest, number of buttons, the button that is B
    "standard": ("standard", REST4, 17, 1),
    "standard, worn to 0.15": ("standard", [0.15, -0.15, 0.15, -0.15], 17, 1),
    "standard, stuck": ("standard", [0, 0, 0, -1], 17, 1),
    "standard, NaN": ("standard", [0, "NaN", 0, 0], 17, 1),
    "standard, two axes": ("standard", [0, 0], 10, 1),
    "PS4, Firefox on macOS": ("", [0, 0, 0, -1, -1, 0, 0, 0], 18, 2),
    "PS4, Firefox on Linux": ("", REST8, 13, 1),
    "Xbox, Firefox on Linux": ("", REST8, 11, 1),
    "Xbox, Safari": ("", [0, 0, 0, 0, -1, -1], 17, 2),
    "flight stick with a throttle": ("", [0, 0, 0, 1], 12, 0),
    "steering wheel": ("", [0, 1, 1, 1], 20, 7),
    "Switch, Chromium, Bluetooth": ("", [0, 0, 0, 0, 0, 0, 0, 0, 0, 1.28], 16, 1),
}


def test_no_gamepad_moves_anything_by_itself_and_each_stops(
    console: RunningConsole, open_page
) -> None:
    page = open_page(script=GAMEPAD + "navigator.getGamepads = () => [];")
    operator = console.control.operator
    for index, (pad, (mapping, axes, count, stop)) in enumerate(PADS.items()):
        take(page)
        page.evaluate(
            f"pad = {{...pad, index: {index}, mapping: '{mapping}'}};"
            f"pad.axes = [{', '.join(map(str, axes))}];"
            f"pad.buttons = Array.from({{length: {count}}}, () => ({{pressed: false}}));"
            "navigator.getGamepads = () => [null, null, pad]"
        )
        before = operator.reference
        for held in (4, 5) if mapping else ():  # on any other each button stops
            page.evaluate(f"pad.buttons[{held}].pressed = true")
            assert rests(console, 0.3), pad
            page.evaluate(f"pad.buttons[{held}].pressed = false")
        assert (operator.reference == before).all(), pad
        assert rests(console, 0.2), pad
        assert not operator.stopped_by, pad
        page.evaluate(f"pad.buttons[{stop}].pressed = true")
        expect(page.locator("#motion"), pad).to_have_text("STOPPED", timeout=TIMEOUT)
        assert (operator.reference == before).all(), pad
        page.evaluate("navigator.getGamepads = () => []")


def test_a_gamepad_that_is_plugged_in_with_its_stick_held_has_to_rest_first(
    console: RunningConsole, open_page
) -> None:
    page = open_page(script=GAMEPAD)
    take(page)
    page.evaluate("pad.buttons[4].pressed = true; pad.axes = [0, -1, 0, 0]")
    wait(lambda: moves(console))
    page.evaluate("pad.connected = false")
    wait(lambda: not moves(console))
    page.evaluate("pad.connected = true")
    assert rests(console, 0.5)
    page.evaluate("pad.axes = [0, 0, 0, 0]")
    assert rests(console, 0.3)  # the button was never released
    page.evaluate("pad.buttons[4].pressed = false")
    page.wait_for_timeout(200)
    page.evaluate("pad.buttons[4].pressed = true; pad.axes = [0, -1, 0, 0]")
    wait(lambda: moves(console))


CONTROLS = ("#compensate", "#gain", "[aria-label='scale of bending']", "#profile",
            "#dofs [type=checkbox]")  # fmt: skip


def test_keys_steer_after_a_click_on_any_control(console: RunningConsole, open_page) -> None:
    page = open_page()
    for control in CONTROLS:
        take(page)
        element = page.locator(control).first
        if control == "#profile":
            element.focus()
        else:
            element.click()
            element.click()
        expect(element, control).to_be_focused(timeout=TIMEOUT)
        page.wait_for_timeout(300)
        value = element.evaluate("each => [each.value, each.checked]")
        for key in ("ArrowDown", "ArrowUp", "ArrowRight"):
            page.keyboard.down(key)
            wait(lambda: moves(console))
            page.keyboard.up(key)
            wait(lambda: not moves(console))
        assert element.evaluate("each => [each.value, each.checked]") == value, control
        if control == "#gain":  # as the other tests expect it; keys that do not steer set it
            element.press("End")
            wait(lambda: console.control.compensation == 1)
        page.focus("#mark")
        page.keyboard.down("ArrowUp")
        assert rests(console, 0.2), control  # keys write there
        expect(page.locator("#hint")).to_contain_text("Keys write into the text field")
        page.keyboard.up("ArrowUp")
        page.keyboard.press("Escape")
        expect(page.locator("#motion"), control).to_have_text("STOPPED", timeout=TIMEOUT)


def test_a_key_whose_release_macos_does_not_tell_moves_nothing(
    console: RunningConsole, open_page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = open_page()
    take(page)
    # So slow that it does not come to an end by itself.
    monkeypatch.setattr(console.control.operator, "scale", np.full(3, 0.02))
    page.keyboard.down("ArrowUp")
    wait(lambda: moves(console))
    page.keyboard.down("Meta")
    wait(lambda: not moves(console))
    page.keyboard.up("Meta")
    assert rests(console)


def test_a_control_that_is_disabled_gives_up_the_focus(open_page) -> None:
    """Chromium does that by itself; in Firefox it would swallow every key."""
    page = open_page()
    page.evaluate(
        "window.focused = {disabled: true, blur() { this.isBlurred = true }};"
        "Object.defineProperty(document, 'activeElement', {get: () => focused})"
    )
    wait(lambda: page.evaluate("focused.isBlurred"))


def test_a_control_shows_the_state_after_a_refusal(
    console: RunningConsole, open_page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = open_page()
    take(page)
    refusal = console.control.lease.refusal

    def refuse(client: int, command: Any, now: float, *, needs_image: bool) -> str:
        found = refusal(client, command, now, needs_image=needs_image)
        return "late" if isinstance(command, Setting) else found

    monkeypatch.setattr(console.control.lease, "refusal", refuse)
    clutch = page.get_by_role("checkbox", name="clutch of rotation")
    clutch.click()
    expect(page.locator("#reply")).to_have_text("clutch: refused, late", timeout=TIMEOUT)
    expect(page.locator("#message")).to_contain_text("clutch: refused, late", timeout=TIMEOUT)
    expect(clutch).to_be_checked(timeout=TIMEOUT)


def test_a_page_without_a_connection_says_that_stop_was_not_sent(
    browser: Browser, tmp_path: Path
) -> None:
    context = browser.new_context()
    context.set_default_timeout(TIMEOUT)
    with running_console(tmp_path) as console:
        page = context.new_page()
        page.goto(console.url)
        expect(page.locator("body")).to_have_attribute("data-motion", "ready", timeout=TIMEOUT)
        os.kill(console.server.pid, signal.SIGKILL)
        expect(page.locator("#motion")).to_have_text("NO DATA", timeout=TIMEOUT)
        expect(page.locator("#message")).to_contain_text("another page may steer")
        page.keyboard.press("Escape")
        expect(page.locator("#reply")).to_have_text(
            "STOP was NOT sent: no connection. Use the emergency stop."
        )
    context.close()


@contextmanager
def holding_image(page: Page, device: str, *at: float) -> Iterator[Callable[..., None]]:
    """Hold a place of the image, in shares of its size, and move to others; at last let go."""
    page.locator("#image").scroll_into_view_if_needed()
    session = page.context.new_cdp_session(page)

    def move(across: float, down: float, kind: str = "touchMove") -> None:
        box = page.locator("#image").bounding_box()
        width, height = page.evaluate("[image.width, image.height]")
        assert box is not None
        scale = min(box["width"] / width, box["height"] / height)
        x = box["x"] + box["width"] / 2 + (across - 0.5) * width * scale
        y = box["y"] + box["height"] / 2 + (down - 0.5) * height * scale
        if device == "mouse":
            page.mouse.move(x, y)
        else:
            touch(kind, [{"x": x, "y": y}])

    def touch(kind: str, points: list[dict[str, float]]) -> None:
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    move(*at, "touchStart")
    if device == "mouse":
        page.mouse.down()
    yield move
    if device == "mouse":
        page.mouse.up()
    else:
        touch("touchEnd", [])
    session.detach()


@pytest.mark.parametrize("device", ["mouse", "touch"])
def test_the_tip_moves_to_a_place_of_the_image_while_it_is_held(
    console: RunningConsole, open_page, device: str
) -> None:
    page = open_page()
    page.set_viewport_size({"width": 390 if device == "touch" else 1280, "height": 800})
    operator, camera = console.control.operator, console.control.config.camera
    model = build_feature_model(console.control.config)
    with holding_image(page, device, 0.4, 0.4):  # without the lease
        assert rests(console)
    take(page)
    expect(page.locator("#image.offered")).to_be_visible(timeout=TIMEOUT)
    insertion = operator.reference[0]
    for turn in (0.2, -0.2):
        u, v = model.predict(operator.reference + np.array([0, turn, turn]))[0][2:]
        with holding_image(page, device, u / camera.width, v / camera.height):
            wait(lambda: moves(console))
            wait(lambda: not moves(console))
            reached = model.predict(operator.reference)[0][2:]
            assert np.hypot(*(reached - (u, v))) < 2
    with holding_image(page, device, 0.1, 0.5):
        wait(lambda: moves(console))
    wait(lambda: not moves(console))  # released
    assert rests(console)
    with holding_image(page, device, 0.9, 0.5) as move:
        wait(lambda: moves(console))
        move(0.9, 1.2)
        wait(lambda: not moves(console))
        move(0.1, 0.5)  # back, without a new press
        assert rests(console)
        move(0.9, 1.2)  # and released beyond the image
    with holding_image(page, device, 0.1, 0.5):
        wait(lambda: moves(console))
        page.evaluate("dispatchEvent(new Event('blur'))")
        wait(lambda: not moves(console))
        assert rests(console)
    assert operator.reference[0] == insertion


def test_a_stop_while_the_image_is_held_needs_a_new_press(
    console: RunningConsole, open_page
) -> None:
    page, other = open_page(), open_page()
    page.bring_to_front()
    take(page)
    for by in ("Escape", "another page"):
        expect(page.locator("#image.offered")).to_be_visible(timeout=TIMEOUT)
        with holding_image(page, "mouse", 0.1, 0.1):
            wait(lambda: moves(console))
            if by == "Escape":
                page.keyboard.press("Escape")
            else:
                other.locator("#stop").dispatch_event("pointerdown")
            expect(page.locator("#motion"), by).to_have_text("STOPPED", timeout=TIMEOUT)
            expect(page.locator("#image.offered")).to_have_count(0, timeout=TIMEOUT)
            page.locator("#enable").press("Enter")
            expect(page.locator("#motion")).to_have_text("READY", timeout=TIMEOUT)
            assert rests(console), by
        with holding_image(page, "mouse", 0.9, 0.9):
            wait(lambda: moves(console))


def test_two_tabs_and_a_stop_by_the_one_that_watches(console: RunningConsole, open_page) -> None:
    first, second = open_page(), open_page()
    take(first)
    expect(second.locator("#lease")).to_contain_text("you watch", timeout=TIMEOUT)
    assert second.is_disabled("#gain")
    first.bring_to_front()
    first.keyboard.down("ArrowDown")
    wait(lambda: moves(console))
    second.keyboard.press("Escape")
    expect(first.locator("#motion")).to_have_text("STOPPED", timeout=TIMEOUT)
    assert rests(console)
    first.keyboard.up("ArrowDown")
    first.click("#enable")
    expect(first.locator("#motion")).to_have_text("READY", timeout=TIMEOUT)
    second.click("#take")
    expect(first.locator("#lease")).to_contain_text("you watch", timeout=TIMEOUT)


def test_warnings_stay_until_acknowledged_and_the_most_urgent_says_what_to_do(
    console: RunningConsole, open_page
) -> None:
    page = open_page()
    take(page)
    console.control.run.loop.raise_flag("tremor")
    expect(page.locator("#warnings")).to_contain_text("tremor", timeout=TIMEOUT)
    console.control.run.loop.raise_flag("merged")
    expect(page.locator("#warnings")).to_contain_text("merged", timeout=TIMEOUT)
    shown = page.locator("#warnings p").inner_text()
    (first,) = re.findall(r"\((\w+)\)", shown)
    others = re.findall(r"\w+", shown.partition("Also: ")[2])
    assert by_urgency([first, *others])[0] == first
    assert REMEDIES[first][1:] in shown
    wait(lambda: "tremor" not in console.control.run.loop.supervision.flags)
    page.wait_for_timeout(300)
    expect(page.locator("#warnings")).to_contain_text("tremor")
    page.click("#acknowledge")
    expect(page.locator("#warnings")).not_to_contain_text("tremor", timeout=TIMEOUT)


def test_controls_reach_the_loop(console: RunningConsole, open_page) -> None:
    page = open_page()
    take(page)
    page.keyboard.press("c")
    wait(lambda: console.control.compensation == 0)

    def is_on_again() -> bool:
        page.check("#compensate")  # which an older state may have checked for a moment
        return console.control.compensation == 1

    wait(is_on_again)
    page.fill("#mark", "here, with wasd")
    page.click("#set_mark")
    expect(page.locator("#reply")).to_have_text("mark: done", timeout=TIMEOUT)
    page.click("[data-action=sweep]")
    wait(lambda: console.control.operator.program is not None)
    page.click("[data-action=end_program]")
    wait(lambda: console.control.operator.program is None)
    expect(page.locator("#program")).to_contain_text("sweep ended early, at", timeout=TIMEOUT)
    page.reload()
    expect(page.locator("#program")).to_contain_text("sweep ended early, at", timeout=TIMEOUT)
    take(page)
    page.locator("[aria-label='scale of bending']").press("End")
    wait(lambda: console.control.operator.scale[2] == 1)
    assert rests(console, 0.1)


def test_the_wall_view_has_no_controls(console: RunningConsole, open_page) -> None:
    page = open_page("?view")
    assert page.locator("button:visible, input:visible, select:visible").count() == 0
    page.keyboard.press("Escape")  # a stop is possible everywhere
    expect(page.locator("#motion")).to_have_text("STOPPED", timeout=TIMEOUT)


def test_commands_delivered_all_at_once_move_nothing(console: RunningConsole, open_page) -> None:
    page = open_page()
    take(page)
    page.keyboard.down("ArrowUp")
    wait(lambda: moves(console))
    os.kill(console.server.pid, signal.SIGSTOP)
    try:
        wait(lambda: not moves(console))
        page.wait_for_timeout(1000 * (AGE + 0.5))
    finally:
        os.kill(console.server.pid, signal.SIGCONT)
    assert rests(console, 1.0)


def test_a_killed_browser_stops_motion(console: RunningConsole, open_page, browser) -> None:
    assert open_page  # leaves the console as it found it
    with_processes = browser.browser_type.launch(executable_path=CHROMIUM, args=FLAGS)
    try:
        page = with_processes.new_page()
        page.goto(console.url)
        expect(page.locator("#stale")).to_be_hidden(timeout=TIMEOUT)
        take(page)
        page.keyboard.down("ArrowDown")
        wait(lambda: moves(console))
        session = with_processes.new_browser_cdp_session()
        processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
        os.kill(next(p["id"] for p in processes if p["type"] == "browser"), signal.SIGKILL)
        wait(lambda: not moves(console))
        assert rests(console)
    finally:
        with_processes.close()


SIZES = ((1440, 900), (1024, 768), (3840, 2160), (768, 1024), (390, 844), (844, 390), (320, 480))


def test_stop_is_always_on_top_nothing_is_cut_off_and_axe_finds_no_fault(
    console: RunningConsole, open_page
) -> None:
    page = open_page()
    take(page)
    if AXE.exists():
        page.evaluate(AXE.read_text(encoding="utf-8"))
    for scheme, (width, height) in product(("light", "dark"), SIZES):
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": height})
        sides = ("right",) if height < 700 or width < 1000 else ()
        assert overflow(page, *sides) == [], (width, height)
        assert page.evaluate("document.documentElement.scrollWidth") == width
        for place in (0, 10_000):
            on_top = page.locator("#stop").evaluate(
                "(stop, place) => { scrollTo(0, place); const box = stop.getBoundingClientRect();"
                " return [[5, 5], [box.width / 2, box.height / 2], [box.width - 5, box.height - 5]]"
                " .map(([x, y]) => document.elementFromPoint(box.x + x, box.y + y)?.id) }",
                place,
            )
            assert on_top == ["stop"] * 3, (width, height, place)
        if AXE.exists() and width in (1440, 768, 390):
            found = page.evaluate("axe.run(document)")["violations"]
            assert [(each["id"], each["nodes"][0]["html"]) for each in found] == []
    if not AXE.exists():
        pytest.skip(f"no {AXE}: `npm pack axe-core`, unpacked there, as .ci/run does")


@pytest.mark.parametrize(("width", "height"), [(1024, 640), (1280, 720), (1440, 900)])
def test_charts_can_be_read_below_a_warning(
    width: int, height: int, open_page: Callable[..., Page]
) -> None:
    page = open_page()
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate(
        "text => { document.getElementById('warnings').hidden = false;"
        " document.getElementById('latched').textContent = text }",
        REMEDIES["slack_changed"],
    )
    seen = page.locator(".chart:visible")
    boxes = [each.bounding_box() for each in seen.all()]
    assert len(boxes) in (3, 9)
    assert min(box["height"] for box in boxes if box) > 60


def test_each_device_steers_after_every_control_was_used_and_a_touch_stops(
    console: RunningConsole, open_page
) -> None:
    page = open_page(script=GAMEPAD)
    take(page)
    use_all_controls(page)
    page.set_viewport_size({"width": 390, "height": 844})
    for device in DEVICES:
        for dof in range(3):
            wait(lambda: not console.control.operator.must_release)
            before = console.control.operator.reference
            forwards = before[dof] < load_config().experiment[Dof(dof)].centre
            with holding(page, device, dof, 1 if forwards else -1):
                wait(lambda: moves(console))
                expect(page.locator(".dof.moved b").first).to_have_text(
                    Dof(dof).label, timeout=TIMEOUT
                )
                assert page.locator(".dof:visible").count() == 1
            wait(lambda: not moves(console))
            moved = console.control.operator.reference - before
            assert [k for k in range(3) if moved[k]] == [dof], device
            assert (moved[dof] > 0) == forwards
    page.locator("#stop").dispatch_event("pointerdown")
    expect(page.locator("#motion")).to_have_text("STOPPED", timeout=TIMEOUT)


@pytest.mark.parametrize("count", [1, 8])
def test_any_number_of_axes_is_drawn_and_steered_without_an_image(
    browser: Browser, tmp_path: Path, count: int
) -> None:
    config = tautscope.axes(count, width_limit=1.0, unit="rad")
    arm = Arm(count)
    rig = PacedRig(lambda: arm, config.control.period, is_simulated=True)
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(TIMEOUT)
    with running_console(tmp_path, config, rig) as console:
        page = context.new_page()
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(console.url)
        take(page)
        expect(page.locator(".dof canvas")).to_have_count(3 * count)
        expect(page.locator("#view")).to_be_hidden()  # no image is no error
        expect(page.locator("[data-action=experiment]")).to_be_hidden()
        assert overflow(page) == []
        keys = [("ArrowUp", 0), ("Digit8", 7), ("KeyW", 7)] if count == 8 else [("ArrowUp", 0)]
        for key, axis in keys:
            before = console.control.operator.reference
            page.keyboard.down(key)
            if not key.startswith("Digit"):
                wait(lambda: moves(console))
                page.keyboard.up(key)
                wait(lambda: not moves(console))
                moved = console.control.operator.reference - before
                assert list(moved.nonzero()[0]) == [axis]
        with pytest.MonkeyPatch.context() as patch:
            # Without slack, or before it is estimated.
            patch.setattr(Score, "errors", [(1e-3, 0.0)] * count)
            expect(page.locator("#score")).to_contain_text("Last minute: –", timeout=TIMEOUT)
        page.set_viewport_size({"width": 400, "height": 800})
        expect(page.locator("#stop")).to_be_in_viewport()
        assert page.evaluate("document.documentElement.scrollWidth") == 400
        assert overflow(page, "right") == []
        button = page.get_by_label(f"axis_{count} backwards")
        before = console.control.operator.reference
        button.hover()
        page.mouse.down()
        wait(lambda: moves(console))
        expect(page.locator("#stop")).to_be_in_viewport()
        page.mouse.up()
        wait(lambda: not moves(console))
        moved = console.control.operator.reference - before
        assert list((moved < 0).nonzero()[0]) == [count - 1]
        if count == 1:
            arm.picture = np.full((config.camera.height, config.camera.width, 3), 128, np.uint8)
            expect(page.locator("#image")).to_be_visible(timeout=TIMEOUT)
            arm.picture = arm.picture[1:]
            text = "image: got 'uint8 array (575, 720, 3)'"
            expect(page.locator("#message")).to_contain_text(text, timeout=TIMEOUT)
        assert problems == []
    context.close()


@contextmanager
def recording(folder: Path, duration: float) -> Iterator[RunningConsole]:
    """The address of a recording that is shown: of an axis that moves, without images."""
    path, config = folder / "run.mcap", tautscope.axes(1, width_limit=1.0, unit="rad")
    with LogWriter(path, config, wait=True) as log:
        for now in np.arange(0, duration, 0.02):
            moved = np.array([np.sin(now) * now])
            log.tick(Sample(now, moved), moved, moved)
    ended = threading.Event()
    with web_server(config, 0) as (server, channels, url):
        player = LogPlayer(read_log(path), channels)

        def show() -> None:
            while not ended.wait(0.05):
                player.run(lambda: not ended.is_set())
                player.publish()

        thread = threading.Thread(target=show)
        thread.start()
        try:
            yield RunningConsole(url, None, server)  # type: ignore[arg-type]
        finally:
            ended.set()
            thread.join()
            player.close()


SHOWN = "[parseFloat(seek.value), parseFloat(at.textContent)]"


def test_the_timeline_follows_after_a_click_and_keys_move_it(
    browser: Browser, tmp_path: Path
) -> None:
    context = browser.new_context()
    context.set_default_timeout(TIMEOUT)
    with recording(tmp_path, 60.0) as shown:
        page = context.new_page()
        page.goto(shown.url)
        box = page.locator("#seek").bounding_box()
        assert box is not None
        page.locator("#seek").click(position={"x": 0.2 * box["width"], "y": box["height"] / 2})

        def follows(after: float, before: float) -> bool:
            value, at = page.evaluate(SHOWN)
            return bool(after < value < before and abs(value - at) < 0.15)

        wait(lambda: follows(14, 30))
        page.click("#play")
        expect(page.locator("#play")).to_have_text("Play", timeout=TIMEOUT)
        page.focus("#seek")
        _, before = page.evaluate(SHOWN)
        for _ in range(10):
            page.keyboard.press("ArrowRight")
        wait(lambda: follows(before, before + 1.2))
        page.keyboard.press("Home")
        wait(lambda: page.evaluate(SHOWN) == [0, 0])
    context.close()


def test_charts_show_no_other_time_than_that_of_a_paused_recording(
    browser: Browser, tmp_path: Path
) -> None:
    drawn = "document.querySelector('.chart canvas').toDataURL()"
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(TIMEOUT)
    with recording(tmp_path, 60.0) as shown:
        page = context.new_page()
        page.goto(shown.url)
        wait(lambda: page.evaluate(SHOWN)[1] > 1)
        page.click("#play")
        expect(page.locator("#play")).to_have_text("Play", timeout=TIMEOUT)
        page.wait_for_timeout(500)
        before = page.evaluate(drawn)
        page.wait_for_timeout(300)
        assert page.evaluate(drawn) == before
        page.evaluate("seek.value = 20; seek.dispatchEvent(new Event('input'))")
        wait(lambda: page.evaluate(SHOWN)[1] == 20)
        wait(lambda: page.evaluate(drawn) != before)
    context.close()


def test_an_address_without_a_valid_token_says_so(console: RunningConsole, browser) -> None:
    for address in ("/", "/#token=of-another-console"):
        context = browser.new_context()
        page = context.new_page()
        page.goto(console.origin + address)
        expect(page.locator("#message")).to_contain_text("no valid token", timeout=TIMEOUT)
        context.close()
    assert rests(console, 0.1)


def test_a_rig_that_is_off_has_no_numbers_and_keeps_its_charts_and_log(
    browser: Browser, tmp_path: Path
) -> None:
    config = tautscope.axes(1, width_limit=1.0, unit="rad")
    rig = PacedRig(lambda: Arm(1), config.control.period, is_simulated=False)
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(TIMEOUT)
    drawn = "document.querySelector('.chart canvas').toDataURL()"
    with running_console(tmp_path, config, rig) as console, pytest.MonkeyPatch.context() as patch:
        patch.setattr(ControlRun, "tip", property(lambda run: run.reference + 1e-4))
        page = context.new_page()
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(console.url)
        error, facts = page.locator(".error"), page.locator("#facts")
        expect(error).to_have_text("–", timeout=TIMEOUT)
        expect(facts).not_to_contain_text("MB")
        page.click("#take")
        page.click("#enable")
        expect(page.locator("#motion")).to_have_text("READY", timeout=TIMEOUT)
        expect(error).to_have_text("0.0 °", timeout=TIMEOUT)  # it is -0.006
        expect(facts).to_contain_text("console-1.mcap", timeout=TIMEOUT)
        page.keyboard.down("ArrowUp")
        wait(lambda: moves(console))
        page.keyboard.up("ArrowUp")
        page.locator("#stop").dispatch_event("pointerdown")
        expect(page.locator("#motion")).to_have_text("STOPPED", timeout=TIMEOUT)
        expect(error).to_have_text("–", timeout=TIMEOUT)
        expect(page.locator("p.score")).to_have_text("–")
        expect(page.locator(".offsets")).to_have_text("tip ± –, slack –")
        expect(facts).to_contain_text("console-1.mcap")
        page.wait_for_timeout(300)
        before = page.evaluate(drawn)
        page.wait_for_timeout(300)
        assert page.evaluate("charts.querySelector('canvas').width") > 300
        assert page.evaluate(drawn) == before
        assert problems == []
    context.close()
