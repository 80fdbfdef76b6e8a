"""A log on the console's page."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import tautscope
from drawn import short_experiment
from recorded import record
from running import Arm, play_all, player_of
from tautscope.console import messages as msg
from tautscope.console.rig_control import RigControl
from tautscope.log.reader import Tick, read_log
from tautscope.log.writer import LogWriter
from tautscope.loop.rig import Sample


def test_the_player_shows_the_recorded_states_and_images(tmp_path: Path, monkeypatch) -> None:
    config = short_experiment()
    path = tmp_path / "run.mcap"
    record(path, config, 0.6)
    log = read_log(path)
    monkeypatch.setattr("tautscope.console.log_player.STATE_PERIOD", 0.0)
    with player_of(log) as (player, shown):
        shown.inbound.write(msg.encode(msg.Received(5, 0.0, msg.Take())))
        seen = play_all(player, shown)
    ticks = [event for event in log.events.values() if isinstance(event, Tick)]
    by_time = {tick.sample.time: tick for tick in ticks}
    assert len(seen) > 50
    for state in seen:
        assert state["mode"] == "replay"
        if state["time"] in by_time and state["time"] > 0:
            assert np.allclose(state["command"], by_time[state["time"]].command)
    found = shown.images.newest()
    assert found is not None
    image, overlay = found
    assert image.shape == (config.camera.height, config.camera.width, 3)
    assert overlay.tip is not None
    reply = shown.replies.following()
    assert reply is not None
    assert not msg.decode_reply(reply[1]).is_accepted


def test_a_timeline_seeks_and_pauses(tmp_path: Path) -> None:
    config = short_experiment()
    path = tmp_path / "run.mcap"
    record(path, config, 0.6)
    log = read_log(path)
    ticks = [event for event in log.events.values() if isinstance(event, Tick)]

    def seek(time: float | None, is_playing: bool) -> dict[str, Any]:
        request = msg.Received(1, 0.0, msg.Seek(time, is_playing))
        shown.inbound.write(msg.encode(request))
        player.publish()  # which reads it
        player.publish()
        found = shown.state.newest()
        assert found is not None
        return msg.decode_state(found[1])

    with player_of(log) as (player, shown):
        for time in (0.4, 0.1, 1e9):
            state = seek(time, is_playing=False)
            shows = min(ticks[0].sample.time + time, ticks[-1].sample.time)
            nearest = min(ticks, key=lambda tick: abs(tick.sample.time - shows))
            assert state["command"] == nearest.command.tolist()
            length = ticks[-1].sample.time - ticks[0].sample.time
            assert state["replay"] == [nearest.sample.time - ticks[0].sample.time, length, False]
            player.run(lambda: True)
            assert seek(None, is_playing=False)["time"] == state["time"]  # it stays
        seek(0.5, is_playing=True)
        player.run(lambda: True)
        assert seek(None, is_playing=False)["time"] == ticks[-1].sample.time


def test_the_page_is_answered_while_the_recording_has_a_gap(tmp_path: Path) -> None:
    config = tautscope.axes(2, width_limit=1.0)
    path = tmp_path / "run.mcap"
    with LogWriter(path, config) as writer:
        for time in (0.0, 0.005, 1e6):  # the disk was too slow for those in between
            writer.tick(Sample(time, np.zeros(2)), np.zeros(2), np.zeros(2))
    states = []

    def look() -> bool:
        if (found := shown.state.newest()) is not None:
            states.append(msg.decode_state(found[1]))
            pause = msg.Received(1, 0.0, msg.Seek(None, is_playing=False))
            shown.inbound.write(msg.encode(pause))
        return len(states) < 5

    with player_of(read_log(path)) as (player, shown):
        player.run(look)
    assert states
    assert not player._is_playing


def test_a_time_before_a_change_shows_the_compensation_then(tmp_path: Path) -> None:
    config = tautscope.axes(2, width_limit=1.0)
    with ThreadPoolExecutor(1) as executor:
        control = RigControl(config, Arm(2), tmp_path, executor)
        control.open()
        assert control.run is not None
        for tick in range(200):
            if tick == 100:
                control.run.set_compensation(0.0)
            control.run.tick()
            control.run.step()
        control.shut_down()
    found = []
    with player_of(read_log(tmp_path / "console-1.mcap")) as (player, _):
        for time in (0.0, 0.9, 0.1):
            player._seek(time)
            found.append(player._state.compensation)
    assert found == [1.0, 0.0, 1.0]
