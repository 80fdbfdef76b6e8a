"""The operator's share of the compensation: bumpless, and off is off."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import OperatorMotion

PROFILES = ("paper", "best")


def loop(profile: str) -> HysteresisReduction:
    offsets = {f"{dof.label}.delta_minus": -2e-3 for dof in Dof} | {
        f"{dof.label}.delta_plus": 2e-3 for dof in Dof
    }
    return HysteresisReduction(load_config().replace(profile=profile, **offsets))


@pytest.mark.parametrize("profile", PROFILES)
@settings(max_examples=50, deadline=None)
@given(shares=st.lists(st.floats(0, 1), min_size=1, max_size=20), seed=st.integers(0, 99))
def test_a_change_moves_nothing_while_the_reference_rests(profile, shares, seed) -> None:
    reduction = loop(profile)
    motion = OperatorMotion(load_config().experiment, seed)
    ticks = 0
    for share in shares:
        for _ in range(40):
            ticks += 1
            moving = motion(ticks * 0.005)
            command = reduction.step(moving)
        before = reduction.step(moving)
        reduction.set_compensation(share)
        assert (reduction.step(moving) == before).all()
        assert np.isfinite(command).all()


@pytest.mark.parametrize("profile", PROFILES)
def test_off_follows_the_reference_and_all_is_as_never_changed(profile: str) -> None:
    motion = OperatorMotion(load_config().experiment, 3)
    times = np.arange(0, 6, 0.005)
    off, full, plain = loop(profile), loop(profile), loop(profile)
    first = motion(0.0)
    for each in (off, full, plain):
        each.step(first)
    off.set_compensation(0)
    full.set_compensation(1)
    for time in times[1:]:
        reference = motion(time)
        assert np.allclose(off.step(reference) - first, reference - first, atol=1e-12)
        assert (full.step(reference) == plain.step(reference)).all()


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan, np.inf])
def test_a_share_out_of_range_is_refused(share: float) -> None:
    with pytest.raises(ConfigError, match=r"compensation.*0 to 1"):
        loop("best").set_compensation(share)


def test_it_is_notified_for_the_log() -> None:
    events: list[str] = []
    reduction = loop("best")
    reduction.on_event = events.append
    reduction.set_compensation(0.25)
    assert events == ["set_compensation 0.25"]
