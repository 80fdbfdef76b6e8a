"""A log on the console's page, at the pace of its recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from tautscope.console import messages as msg
from tautscope.console.publisher import Bands, Publisher, Update
from tautscope.console.shared import Channels
from tautscope.console.start import web_server
from tautscope.console.state import ImageState, LogState, blank_state, known, show_truth, values
from tautscope.hardware.signals import exit_on_signals
from tautscope.log.reader import Log, Request, Tick, read_log
from tautscope.log.reader import Update as LoggedUpdate
from tautscope.loop.kinematics import build_kinematics
from tautscope.loop.rig import Frame

Floats = NDArray[np.float64]
STATE_PERIOD = 0.02
"""Time between two states for the page [s]."""
_END_PERIOD = 0.2
"""The same after the end of the log."""


def play(path: str | PathLike[str], port: int, announce: Callable[[str], None]) -> int:
    """Show a log on the page until Ctrl-C; the exit status.

    Raises:
        MissingPathError: There is no such file.
        RecordError: It is not a log.
        ConfigError: The port is taken.
    """
    log = read_log(path)
    with exit_on_signals(), web_server(log.config, port) as (server, channels, url):
        announce(url)
        player = LogPlayer(log, channels)
        try:
            player.run(server.is_alive)
            while server.is_alive():
                player.publish()
                time.sleep(_END_PERIOD)
        except KeyboardInterrupt:
            return 0
        finally:
            player.close()
    return 1


class LogPlayer:
    """Publishes the events of a log as the control process would.

    Args:
        log: The log.
        channels: This process's views of the shared memory.
    """

    def __init__(self, log: Log, channels: Channels) -> None:
        self._log, self._channels = log, channels
        self._publisher = Publisher(log.config, channels.images)
        config = log.config
        message = f"Recording {log.path.name}. Nothing is steered."
        self._kinematics = build_kinematics(config) if config.dof else None
        self._state = blank_state("replay", config)
        self._state.motion, self._state.message = "replay", message
        self._state.must_release = False
        self._state.drives = "recorded"
        self._state.log = LogState(str(log.path), log.path.stat().st_size)
        self._published_at = 0.0
        self._images = 0

    def run(self, may_continue: Callable[[], bool]) -> None:
        """Publish all events at the pace of the recording."""
        offset: float | None = None
        for index, event in self._log.events.items():
            if not may_continue():
                return
            if isinstance(event, Tick):
                now = event.sample.time
                offset = time.monotonic() - now if offset is None else offset
                time.sleep(max(0.0, offset + now - time.monotonic()))
                self._add_tick(event)
            elif isinstance(event, LoggedUpdate):
                self._add_update(index, event)
            else:
                self._add_request(event)
            if time.monotonic() - self._published_at >= STATE_PERIOD:
                self.publish()
        self._state.message = f"End of the recording {self._log.path.name}."

    def publish(self) -> None:
        """Publish the state."""
        self._answer()
        self._state.now = self._published_at = time.monotonic()
        self._channels.state.write(msg.encode(self._state))

    def close(self) -> None:
        """End the thread of the images."""
        self._publisher.close()

    def _answer(self) -> None:
        while (found := self._channels.inbound.following()) is not None:
            inbound = msg.decode_inbound(found[1])
            if isinstance(inbound, msg.Received):
                reply = msg.Reply(inbound.client, "request", False, "this is a recording")
                self._channels.replies.write(msg.encode(reply))

    def _add_tick(self, tick: Tick) -> None:
        state = self._state
        state.time = tick.sample.time
        state.reference, state.command = values(tick.reference), values(tick.command)
        state.applied = values(tick.sample.applied)
        if self._log.config.dof:
            show_truth(state, tick.sample.true_state, self._kinematics)

    def _add_update(self, index: int, update: LoggedUpdate) -> None:
        row = dict(zip(self._log.update_names, update.row, strict=True))
        state, dofs = self._state, self._log.config.dofs
        estimate = np.array([row[f"estimate_{dof.label}"] for dof in dofs], np.float64)
        predicted = np.array([row[f"predicted_{dof.label}"] for dof in dofs], np.float64)
        if self._log.config.profile == "paper":  # as in `session_state`
            tip = np.where([bool(row[f"observable_{dof.label}"]) for dof in dofs], estimate, np.nan)
        else:
            tip = np.where(np.isfinite(estimate), estimate, predicted)
        state.tip = known(tip)
        state.delta_minus, state.delta_plus = values(update.delta_minus), values(update.delta_plus)
        self._images += 1
        captured_at, arrived_at = float(row["captured_at"]), float(row["arrived_at"])  # type: ignore[arg-type]
        age, status = arrived_at - captured_at, str(row["status"])
        state.image = ImageState(self._images, status, age, updates=self._images)
        state.image.deviation = (None,) * len(dofs)
        if self._log.has_image(index):
            frame = Frame(self._log.image(index), captured_at, int(row["sequence"]))  # type: ignore[call-overload]
            found = tuple(np.isfinite(row[f"features_{band}_x"]) for band in "ab")  # type: ignore[call-overload]
            reference = np.array(state.reference)
            bands = Bands(estimate, predicted, reference, (bool(found[0]), bool(found[1])))
            self._publisher.submit(Update(self._images, frame, time.monotonic(), bands))

    def _add_request(self, request: Request) -> None:
        self._state.message = f"Recording {self._log.path.name}: {request.text}"
