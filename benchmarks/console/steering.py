"""Every control of the page used, and each input device that holds one degree of freedom."""

from collections.abc import Callable, Iterator
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
SET = "(each, value) => { each.value = value; each.dispatchEvent(new Event('change')) }"
"""Sets a slider or a list as a person does."""
_KEYS = (("ArrowDown", "ArrowUp"), ("ArrowLeft", "ArrowRight"), ("KeyS", "KeyW"))
_STICKS = ((1, -1), (0, 1), (3, -1))
"""Axis of the gamepad, and its sign, per DOF."""


def use_all_controls(page: BrowserPage) -> None:
    """Use every control, one after the other, so that all are as they were at the end."""

    def use(what: str, act: Callable[[], object]) -> None:
        """Use a control until it is accepted: a busy computer may be late with the state."""
        for _ in range(10):
            page.evaluate("document.querySelector('#reply').textContent = ''")
            act()
            page.wait_for_function("() => document.querySelector('#reply').textContent")
            reply = page.inner_text("#reply")
            if reply.startswith(f"{what}: done"):
                return
            page.wait_for_timeout(300)
        raise RuntimeError(reply)

    for clutch in page.locator("#dofs [type=checkbox]").all():
        use("clutch", clutch.click)
        use("clutch", clutch.click)
    use("compensation", lambda: page.click("#compensate"))
    page.wait_for_timeout(300)
    use("compensation", lambda: page.keyboard.press("c"))
    for slider in page.locator("#dofs [type=range]").all():
        use("scale", lambda slider=slider: slider.evaluate(SET, "1"))
    use("compensation", lambda: page.locator("#gain").evaluate(SET, "1"))
    for profile in ("paper", "best"):
        use("profile", lambda profile=profile: page.locator("#profile").evaluate(SET, profile))
    for button in ("record", "record", "still"):
        use(button, lambda button=button: page.click(f"[data-action={button}]"))
    page.fill("#mark", "all controls")
    use("mark", lambda: page.click("#set_mark"))
    page.click("#sound")
    page.click("#sound")
    for program in ("home", "sweep", "experiment"):
        use(program, lambda program=program: page.click(f"[data-action={program}]"))
        use("end_program", lambda: page.click("[data-action=end_program]"))


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
