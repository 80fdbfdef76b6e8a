"""Figures of the console with a browser: latency of images, control ticks, operator motion."""

import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from console.pages import Address, Page, sized
from console.steering import DEVICES, GAMEPAD, holding, use_all_controls
from playwright.sync_api import Page as BrowserPage
from playwright.sync_api import sync_playwright
from tautscope.config import Config
from tautscope.console.live_twin import LiveTwin
from tautscope.console.operator_input import DEAD_BAND, LARGEST_SPEED
from tautscope.console.rig_control import RigControl
from tautscope.console.session import Session
from tautscope.console.start import web_server
from tautscope.dof import Dof
from tautscope.hardware.realtime import (
    LOOP,
    VISION,
    limited_garbage_collection,
    locked_memory,
    realtime,
    realtime_executor,
)
from tautscope.log.reader import read_log
from tautscope.loop.references import OperatorMotion
from tautscope.report.operator_motion import FIRST_SEED, evaluate_operator_motion
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording, per_dof
from tautscope.twin.rig import Twin

FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-quic", "--disable-sync",
         "--disable-background-networking", "--disable-component-update"]  # fmt: skip
SCREEN = {"width": 1280, "height": 800}
START_TIME = 8.0
"""Time after which a measurement begins [s]."""
HAND_SIZE = "360x288"
"""Size of the images of the operator motion, which runs twice in one process too."""
FOLLOWING_GAMEPAD = """
window.pad = {connected: true, id: "simulated", mapping: "standard", axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({pressed: false}))};
navigator.getGamepads = () => {
  if (window.motion) {
    const elapsed = (performance.now() - motion.start) / 1000;
    const row = motion.rows[Math.floor(elapsed / motion.period)] ?? [0, 0, 0, 0];
    pad.axes = row;
    // After a late command the page asks to let go; then the operator presses again.
    const mustRelease = !document.querySelector("#hint").textContent.startsWith("Hold");
    pad.buttons[5].pressed = !mustRelease && elapsed < motion.rows.length * motion.period;
  }
  return [pad];
};
"""


@dataclass
class LiveConsole:
    """A console whose control loop is in this process, as in use, with what it measured."""

    address: Address
    control: RigControl


@contextmanager
def live_console(folder: Path, config: Config) -> Iterator[LiveConsole]:
    """A console of the twin; the control loop is a thread with real-time priority."""
    ending = threading.Event()
    with (
        web_server(config, 0) as (_, channels, url),
        realtime_executor("vision", VISION) as executor,
        limited_garbage_collection(),
        locked_memory(),
    ):
        control = RigControl(config, LiveTwin(config), folder, executor)
        session = Session(control, channels, ending.is_set)

        def main() -> None:
            with realtime(LOOP):
                session.main()

        thread = threading.Thread(target=main)
        thread.start()
        try:
            while control.images.newest < 3:
                time.sleep(0.05)
            yield LiveConsole(Address(url), control)
        finally:
            ending.set()
            thread.join()


@contextmanager
def browser_page(script: str = "") -> Iterator[BrowserPage]:
    """An empty page of Debian's chromium."""
    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        page = browser.new_page(viewport=SCREEN)  # type: ignore[arg-type]
        if script:
            page.add_init_script(script)
        yield page
        browser.close()


def images(folder: Path, size: str, seconds: float) -> dict[str, float]:
    """Images per second, and latency from the loop to the screen [ms]."""
    with live_console(folder, sized(size)) as console, browser_page() as page:
        page.goto(console.address.url)
        page.wait_for_timeout(1e3 * START_TIME)
        watcher = Page(console.address)
        latencies: list[tuple[float, float]] = []
        watcher.on_latency = latencies.append
        first, began = console.control.images.newest, time.monotonic()
        rates = []
        for _ in range(max(1, round(seconds / 2))):
            page.wait_for_timeout(2000)
            rates.append(_rate(page))
        lasted = time.monotonic() - began
        watcher.close()
        median, p95 = np.median(np.array(latencies), axis=0) * 1e3
        worst = max(each for _, each in latencies) * 1e3
        return {
            "published per s": (console.control.images.newest - first) / lasted,
            "drawn per s": float(np.median(rates)),
            "p50 [ms]": float(median),
            "p95 [ms]": float(p95),
            "p95 of the worst 250 images [ms]": worst,
            "load": os.getloadavg()[0],
        }


def _rate(page: BrowserPage) -> float:
    """Images drawn per second, of the last 50, as the page shows it."""
    found = re.search(r"images\s+([\d.]+)/s", page.inner_text("#facts"))
    return float(found[1]) if found else 0.0


def ticks(folder: Path, size: str, seconds: float, *, is_watched: bool) -> dict[str, float]:
    """Computing time of control ticks [us], with a page in a browser or without."""

    def measure(console: LiveConsole, wait: Callable[[float], object]) -> dict[str, float]:
        wait(START_TIME)
        run = console.control.run
        assert run is not None
        run.times.clear()
        wait(seconds)
        times = 1e6 * np.array(run.times)
        cuts = np.percentile(times, [50, 99, 99.9, 99.99])
        names = ("p50", "p99", "p99.9", "p99.99")
        return {"ticks": len(times), **dict(zip(names, cuts, strict=True)), "max": times.max()}

    with live_console(folder, sized(size)) as console:
        if not is_watched:
            return measure(console, time.sleep)
        with browser_page() as page:
            page.goto(console.address.url)
            return measure(console, lambda duration: page.wait_for_timeout(1e3 * duration))


def warnings(folder: Path, count: int) -> dict[str, float]:
    """Time from a flag in the loop until the page shows its warning [ms]."""
    shown = "name => document.querySelector('#warnings').textContent.includes(`(${name})`)"
    found = []
    with live_console(folder, sized("720x576")) as console, browser_page() as page:
        page.goto(console.address.url)
        page.wait_for_timeout(3000)
        page.click("#take")
        for _ in range(count):
            run = console.control.run
            assert run is not None
            began = time.monotonic()
            run.loop.raise_flag("tremor")
            page.wait_for_function(shown, arg="tremor")
            found.append(time.monotonic() - began)
            page.wait_for_timeout(1000)
            page.click("#acknowledge")
            page.wait_for_function(f"name => !({shown})(name)", arg="tremor")
    times = 1e3 * np.array(found)
    return {"n": count, "p50": float(np.median(times)), "max": float(times.max())}


class Recorded:
    """The reference of a recording."""

    segments = ()

    def __init__(self, recording: Recording) -> None:
        self._time = recording.trace["time"] - recording.trace["time"][0]
        self._values = per_dof(recording.trace, "reference")
        self.duration = float(self._time[-1])

    def __call__(self, time: float) -> np.ndarray:
        """(3,) [m, rad, rad] at a time [s]."""
        index = int(np.searchsorted(self._time, time - 1e-6))
        found: np.ndarray = self._values[min(index, len(self._time) - 1)]
        return found


def steer(folder: Path, seconds: float) -> dict[str, dict[str, float]]:
    """Steering with each device after every control was used.

    A stroke is a DOF held for 0.5 s; where nothing moves, because a command was late, the operator
    lets go and holds again, five times at most.
    """
    found: dict[str, dict[str, float]] = {}
    with live_console(folder, sized(HAND_SIZE)) as console, browser_page(GAMEPAD) as page:
        operator = console.control.operator
        page.goto(console.address.url)
        page.wait_for_timeout(3000)
        page.click("#take")
        page.wait_for_timeout(500)
        use_all_controls(page)
        for device in DEVICES:
            strokes = presses = still = wrong = 0
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                dof, sign = strokes % 3, 1 - strokes // 3 % 2 * 2
                before = operator.reference.copy()
                for _ in range(5):
                    with holding(page, device, dof, sign):
                        page.wait_for_timeout(500)
                    page.wait_for_timeout(200)
                    presses += 1
                    moved = operator.reference - before
                    if moved[dof] * sign > 0:
                        break
                strokes += 1
                still += not moved[dof] * sign > 0
                wrong += bool(np.delete(moved, dof).any())
            counts = {"strokes": strokes, "presses": presses, "no motion": still}
            found[device] = {**counts, "other motion": wrong}
        found["refused"] = {key: float(value) for key, value in operator.refused.items()}
    return found


def hand(folder: Path, seconds: float) -> dict[str, dict[str, float]]:
    """Reduction of the tracking error by gamepad and page, and in one process [%]."""
    config = sized(HAND_SIZE)
    motion = OperatorMotion(config.experiment, FIRST_SEED, seconds)
    with live_console(folder, config) as console, browser_page(FOLLOWING_GAMEPAD) as page:
        page.goto(console.address.url)
        page.wait_for_timeout(3000)
        page.click("#take")
        page.wait_for_timeout(500)
        for dof in Dof:
            page.locator(f"[aria-label='scale of {dof.label}']").press("End")
        page.wait_for_timeout(1000)
        page.evaluate(
            "rows => { window.motion = {rows, period: 0.01, start: performance.now() + 500} }",
            _axes(config, motion),
        )
        page.wait_for_timeout(1e3 * seconds + 1500)
        refused = dict(console.control.operator.refused)
        late = console.control.run.late if console.control.run is not None else 0
    recording = read_log(next(folder.glob("*.mcap"))).recording()
    reference = Recorded(recording)
    free = run_experiment(Twin(config), reference, config, compensate=False)
    inside = run_experiment(Twin(config), reference, config)
    free.trace.resize(len(inside.trace), refcheck=False)
    through = Recording(recording.trace[: len(inside.trace)], recording.frames, config, True, ())
    by_page = evaluate_operator_motion(free, through)
    by_process = evaluate_operator_motion(free, inside)
    found = {
        dof.label: {
            "page [%]": 100 * by_page[dof].reduction,
            "process [%]": 100 * by_process[dof].reduction,
            "points": 100 * (by_page[dof].reduction - by_process[dof].reduction),
            "travel of the reference": float(
                np.abs(np.diff(per_dof(recording.trace, "reference")[:, dof])).sum()
            ),
        }
        for dof in Dof
    }
    return {
        **found,
        "refused": {key: float(value) for key, value in refused.items()},
        "late": {"ticks": late},
    }


def _axes(config: Config, motion: OperatorMotion) -> list[list[float]]:
    """Rows of a gamepad's axes, every 10 ms, for the speeds of a motion."""
    times = np.arange(0, motion.duration, 0.01)
    positions = np.array([motion(time) for time in (*times, motion.duration)])
    speeds = np.diff(positions, axis=0) / 0.01
    shares = speeds / (LARGEST_SPEED * np.array(config.safety.reference_speed))
    raw = np.sign(shares) * (np.abs(shares) * (1 - DEAD_BAND) + DEAD_BAND)
    rows = np.zeros((len(raw), 4))
    rows[:, 1], rows[:, 0], rows[:, 3] = -raw[:, 0], raw[:, 1], -raw[:, 2]
    return rows.round(5).tolist()
