"""Every control of the page used, and each input device that holds one degree of freedom."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Page as BrowserPage

DEVICES = ("keyboard", "mouse", "touch", "gamepad")
GAMEPAD = """
window.pad = {connected: true, id: "simulated", index: 0, mapping: "standard"};
Object.assign(pad, {axes: [0, 0, 0, 0], buttons: []});
for (let k = 0; k < 17; k++) pad.buttons.push({pressed: false});
navigator.getGamepads = () => [pad];
"""
_KEYS = (("ArrowDown", "ArrowUp"), ("ArrowLeft", "ArrowRight"), ("KeyS", "KeyW"))
_STICKS = ((1, -1), (0, 1), (3, -1))
"""Axis of the gamepad, and its sign, per DOF."""


def use_all_controls(page: BrowserPage) -> None:
    """Use every control, one after the other, so that all are as they were at the end."""

    def accepted(what: str) -> None:
        page.wait_for_function(
            "what => document.querySelector('#reply').textContent.startsWith(`${what}: done`)",
            arg=what,
        )

    for control in page.locator("#dofs [type=checkbox], #compensate").all():
        control.click()
        page.wait_for_timeout(150)
        control.click()
        page.wait_for_timeout(150)
    for key in ("c", "c"):
        page.keyboard.press(key)
        page.wait_for_timeout(150)
    accepted("compensation")
    for slider in page.locator("#dofs [type=range], #gain").all():
        slider.press("End")
        page.wait_for_timeout(100)
    for profile in ("paper", "best"):
        page.select_option("#profile", profile)
        page.wait_for_timeout(300)
    accepted("profile")
    for button in ("record", "record", "still"):
        page.click(f"[data-action={button}]")
        accepted(button)
    page.fill("#mark", "all controls")
    page.click("#set_mark")
    accepted("mark")
    page.click("#sound")
    page.click("#sound")
    for program in ("home", "sweep", "experiment"):
        page.click(f"[data-action={program}]")
        accepted(program)
        page.click("[data-action=end_program]")
        accepted("end_program")


@contextmanager
def holding(page: BrowserPage, device: str, dof: int, sign: int) -> Iterator[None]:
    """Hold a DOF with a device during the block; forwards with sign 1, backwards with -1."""
    button = page.locator("#dofs .touch").nth(dof).locator("button").nth(int(sign > 0))
    if device == "keyboard":
        key = _KEYS[dof][sign > 0]
        page.keyboard.down(key)
        yield
        page.keyboard.up(key)
    elif device == "gamepad":
        axis, up = _STICKS[dof]
        page.evaluate(f"pad.axes[{axis}] = {sign * up}; pad.buttons[5].pressed = true")
        yield
        page.evaluate("pad.axes = [0, 0, 0, 0]; pad.buttons[5].pressed = false")
    else:
        button.scroll_into_view_if_needed()
        box = button.bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        if device == "mouse":
            page.mouse.move(x, y)
            page.mouse.down()
            yield
            page.mouse.up()
        else:
            session = page.context.new_cdp_session(page)

            def touch(kind: str, points: list[dict[str, Any]]) -> None:
                session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

            touch("touchStart", [{"x": x, "y": y}])
            yield
            touch("touchEnd", [])
            session.detach()
