"""A log on the console's page, at the pace of its recording."""

import math
import time
from bisect import bisect_left
from collections.abc import Callable
from os import PathLike

import numpy as np

from tautscope.console import messages as msg
from tautscope.console.publisher import Bands, Publisher
from tautscope.console.shared import Channels
from tautscope.console.start import web_server
from tautscope.console.state import STATE_PERIOD, ImageState, LogState, blank_state, known, values
from tautscope.console.uncompensated import MODEL, PlayTip, Score
from tautscope.hardware.signals import exit_on_signals
from tautscope.log.reader import Log, Request, Tick, Update, read_log
from tautscope.loop.kinematics import build_kinematics

_IDLE_PERIOD = 0.1
"""Time between two states while the log does not play [s]."""
_LEAD_IN = 0.5
"""Time of the log that is read, and not shown, before the one that was chosen [s]."""


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
            while server.is_alive():
                player.run(server.is_alive)
                player.publish()
                time.sleep(_IDLE_PERIOD)
        except KeyboardInterrupt:
            return 0
        finally:
            player.close()
    return 1


class LogPlayer:
    """Publishes the events of a log as the control process would."""

    def __init__(self, log: Log, channels: Channels) -> None:
        self._log, self._channels = log, channels
        self._publisher = Publisher(log.config, channels.images)
        config = log.config
        self._kinematics = build_kinematics(config) if config.dof else None
        self._state = blank_state("replay", config)
        self._state.motion, self._state.drives = "replay", "recorded"
        self._state.must_release = False
        self._state.log = LogState(str(log.path), log.path.stat().st_size)
        self._state.uncompensated_by = MODEL
        self._published_at = 0.0
        self._images = 0
        self._events = list(log.events.items())
        ticks = [(k, each) for k, (_, each) in enumerate(self._events) if isinstance(each, Tick)]
        self._times, self._indices = [each.sample.time for _, each in ticks], [k for k, _ in ticks]
        self._is_playing = True
        self._next = 0
        self._offset: float | None = None
        self._seek(0.0)

    def run(self, may_continue: Callable[[], bool]) -> None:
        """Publish the events from the present one on, at the pace of the recording."""
        while self._is_playing and self._next < len(self._events) and may_continue():
            index, event = self._events[self._next]
            if isinstance(event, Tick):
                now = event.sample.time
                self._offset = time.monotonic() - now if self._offset is None else self._offset
                left = self._offset + now - time.monotonic()
                time.sleep(min(max(0.0, left), _IDLE_PERIOD))
                if left > _IDLE_PERIOD:  # a gap in the recording
                    self.publish()
                    continue
            self._next += 1
            self._add(index, event)
            if time.monotonic() - self._published_at >= STATE_PERIOD:
                self.publish()
        if self._next == len(self._events):
            self._is_playing = False
            self._state.message = f"End of the recording {self._log.path.name}."

    def publish(self) -> None:
        """Publish the state."""
        self._answer()
        state, times = self._state, self._times or [0.0]
        state.replay = state.time - times[0], times[-1] - times[0], self._is_playing
        state.now = self._published_at = time.monotonic()
        self._channels.state.write(msg.encode(state))

    def close(self) -> None:
        """End the thread of the images."""
        self._publisher.close()

    def _answer(self) -> None:
        while (found := self._channels.inbound.following()) is not None:
            inbound = msg.decode_inbound(found[1])
            if isinstance(inbound, msg.Gone):
                continue
            if isinstance(seek := inbound.message, msg.Seek):
                if seek.time is not None:
                    self._seek(seek.time)
                self._is_playing, self._offset = seek.is_playing, None
            else:
                reply = msg.Reply(inbound.client, "request", False, "this is a recording")
                self._channels.replies.write(msg.encode(reply))

    def _seek(self, time: float) -> None:
        """Go to a time from the begin of the log [s], with the states shortly before it."""
        self._offset = None
        self._model: PlayTip | None = None
        self._score = Score(len(self._log.config.dofs), self._log.config.control.period)
        self._state.compensation = 1.0  # unless a request before that time changed it
        self._state.message = f"Recording {self._log.path.name}. Nothing is steered."
        if not self._times:
            return

        def tick_at(time: float) -> int:
            at = bisect_left(self._times, self._times[0] + time)
            return self._indices[min(at, len(self._times) - 1)]

        self._next, begin = tick_at(time), self._events[tick_at(time - _LEAD_IN)][0]
        for index, event in self._events[: self._next + 1]:
            if index >= begin or isinstance(event, Request):
                self._add(index, event)

    def _add(self, index: int, event: Tick | Update | Request) -> None:
        if isinstance(event, Tick):
            self._add_tick(event)
        elif isinstance(event, Update):
            self._add_update(index, event)
        else:
            name, _, value = event.text.partition(" ")
            if name == "set_compensation":
                self._state.compensation = float(value)
            if name == "note":
                self._state.message = f"Recording {self._log.path.name}: {value}"

    def _add_tick(self, tick: Tick) -> None:
        state = self._state
        truth = tick.sample.true_state
        if self._model is None:
            self._model = PlayTip(tick.reference if truth is None else truth)
        offsets = np.array(state.delta_minus), np.array(state.delta_plus)
        without = self._model.step(tick.reference, *offsets)
        state.uncompensated = values(without)
        tip = np.array(state.tip if truth is None else truth, np.float64)
        if state.compensation > 0:
            self._score.add(tick.reference, tip, without)
        state.score = self._score.errors
        state.time = tick.sample.time
        state.reference, state.command = values(tick.reference), values(tick.command)
        state.applied = values(tick.sample.applied)
        if self._log.config.dof:
            state.show_truth(tick.sample.true_state, self._kinematics)

    def _add_update(self, index: int, update: Update) -> None:
        row, state, dofs = update.row, self._state, self._log.config.dofs
        estimate = np.array([row[f"estimate_{dof.label}"] for dof in dofs], np.float64)
        predicted = np.array([row[f"predicted_{dof.label}"] for dof in dofs], np.float64)
        if self._log.config.profile == "paper":  # as in `session_state`
            tip = np.where([bool(row[f"observable_{dof.label}"]) for dof in dofs], estimate, np.nan)
        else:
            tip = np.where(np.isfinite(estimate), estimate, predicted)
        state.tip = known(tip)
        state.delta_minus, state.delta_plus = values(update.delta_minus), values(update.delta_plus)
        self._images += 1
        age, status = float(row["arrived_at"] - row["captured_at"]), str(row["status"])
        nothing, number = (None,) * len(dofs), self._images
        state.image = ImageState(number, status, age, updates=number, deviation=nothing)
        if self._log.has_image(index):
            a, b = (math.isfinite(row[f"features_{band}_x"]) for band in "ab")
            shown = np.array(state.reference), np.array(state.uncompensated, np.float64)
            bands = Bands(estimate, predicted, *shown, (a, b))
            self._publisher.submit(number, self._log.image(index), time.monotonic(), bands)
