"""The speed benchmark times a loop that compensates."""

from typing import Any

import pytest
from speed import __main__ as speed
from tautscope import axes
from tautscope.config import Config, load_config


@pytest.mark.parametrize(
    "config",
    [load_config(profile="paper"), load_config(profile="best"), axes(8, width_limit=1.2)],
    ids=["paper", "best", "8 DOFs"],
)
def test_every_repeat_of_the_tick_is_compensated(
    config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    loops: list[Any] = []
    build = speed.construction.build_loop

    def keep(config: Config) -> Any:
        loops.append(build(config))
        return loops[-1]

    monkeypatch.setattr(speed.construction, "build_loop", keep)
    monkeypatch.setattr(speed, "REPEATS", 3)
    times = speed.control_tick(config)
    assert len(times) == 3
    for loop in loops:
        reaction, flags, *_ = loop.supervision
        assert (reaction, flags) == ("none", [])
