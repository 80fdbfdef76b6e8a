"""The dead man's switch: what may move the reference, for any sequence of events."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tautscope.config import load_config
from tautscope.console.lease import COMMAND_AGE, ImageTimes, Lease
from tautscope.console.messages import Action, Received, Servo
from tautscope.console.operator_input import (
    COMMAND_TIMEOUT,
    DEAD_BAND,
    IDLE_TIMEOUT,
    LARGEST_SPEED,
    OperatorInput,
)
from tautscope.console.programs import PROGRAMS, program
from tautscope.dof import Dof

CONFIG = load_config().replace(
    **{"experiment.periods": 3} | {f"experiment.{dof.label}.period": 4.0 for dof in Dof}
)
PERIOD = CONFIG.control.period
SPEED = LARGEST_SPEED * np.array(CONFIG.safety.reference_speed)
START = np.array([CONFIG.experiment[dof].centre for dof in Dof])


class Desk:
    """An operator's input at a time of its own, with one image published at each tick."""

    def __init__(self) -> None:
        self.now = 10.0
        self.images = ImageTimes()
        self.lease = Lease(self.images)
        self.input = OperatorInput(CONFIG, self.lease)
        self.sequence = 0

    def tick(self, *, is_held: bool = False) -> np.ndarray:
        self.now += PERIOD
        self.images.add(self.now)
        before = self.input.reference.copy()
        after = self.input.update(self.now, PERIOD, before, is_held=is_held)
        return after - before

    def servo(
        self,
        axes: tuple[float, float, float] | None = None,
        *,
        is_holding: bool = True,
        client: int = 1,
        lease: int | None = None,
        sequence: int | None = None,
        image: int | None = None,
        point: tuple[float, float] | None = None,
    ) -> None:
        self.sequence += 1
        if axes is None:
            axes = (1.0 * is_holding, 0.0, 0.0)
        servo = Servo(
            self.lease.number if lease is None else lease,
            self.sequence if sequence is None else sequence,
            self.images.newest if image is None else image,
            axes,
            is_holding,
            point,
        )
        self.input.receive(Received(client, self.now, servo), self.now)

    def engage(self) -> None:
        """Take the lease, let go, and hold."""
        self.lease.take(1)
        self.tick()
        self.press()

    def press(self, client: int = 1) -> None:
        """Let go, and hold."""
        self.servo(is_holding=False, client=client)
        self.servo(client=client)


def test_a_held_key_moves_its_dof_alone() -> None:
    desk = Desk()
    desk.engage()
    moved = sum(desk.tick() for _ in range(10))
    assert moved[Dof.INSERTION] > 0
    assert not moved[1:].any()


@settings(deadline=None)
@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-1, 1)] * 3))
def test_only_axes_that_have_rested_move_and_none_within_the_dead_band(
    rest: tuple[float, ...], held: tuple[float, ...]
) -> None:
    desk = Desk()
    desk.lease.take(1)
    desk.tick()
    desk.servo(rest, is_holding=False)
    desk.servo(held)
    moved = desk.tick()
    has_rested = max(map(abs, rest)) <= DEAD_BAND
    assert desk.input.is_off_centre is not has_rested
    for dof in range(3):
        assert (moved[dof] != 0) == (has_rested and abs(held[dof]) > DEAD_BAND)
        assert moved[dof] * held[dof] >= 0


@pytest.mark.parametrize("client", [2, 3])
def test_nobody_else_moves_anything(client: int) -> None:
    desk = Desk()
    for _ in range(50):
        desk.press(client)
        assert not desk.tick().any()
    desk.lease.take(1)
    for _ in range(50):
        desk.press(client)
        assert not desk.tick().any()
    assert sum(desk.input.refused.values()) == 200


def test_motion_stops_when_no_command_comes_and_needs_a_new_press() -> None:
    desk = Desk()
    desk.engage()
    desk.tick()
    last = desk.now
    while desk.now - last <= COMMAND_TIMEOUT + 0.02:
        is_moving = desk.tick().any()
    assert not is_moving
    for _ in range(20):
        desk.servo()  # the same key, still held
        assert not desk.tick().any()
    desk.press()
    assert desk.tick().any()


@pytest.mark.parametrize(("pause", "moves"), [(0.4, True), (0.6, False)])
def test_a_pause_at_rest_needs_a_new_press_only_if_it_is_long(pause: float, moves: bool) -> None:
    """A browser holds the page's timers back for a moment when a touch begins."""
    desk = Desk()
    desk.engage()
    desk.tick()
    desk.servo(is_holding=False)
    for _ in range(round(pause / PERIOD)):
        assert not desk.tick().any()
    desk.servo()
    assert desk.tick().any() == moves


def test_commands_held_back_by_the_network_move_nothing() -> None:
    desk = Desk()
    desk.engage()
    desk.tick()
    image, sequence = desk.images.newest, desk.sequence
    for _ in range(400):  # 2 s without any
        desk.tick()
    for k in range(100):  # then all at once
        desk.servo(is_holding=k % 10 != 0, image=image + k, sequence=sequence + k + 1)
        assert not desk.tick().any()
    assert desk.input.refused == {"the page shows no recent image": 100}


@pytest.mark.parametrize(
    ("newest", "age", "reason"),
    [
        (True, 0.6, "no new image came: for 0.60 s, at most 0.25 s"),
        (
            False,
            0.6,
            "the page shows an old image, or its commands are late: for 0.60 s, at most 0.25 s",
        ),
        (True, 0.2, ""),
    ],
)
def test_a_refusal_says_what_is_late_and_by_how_much(newest: bool, age: float, reason: str) -> None:
    images = ImageTimes()
    lease = Lease(images)
    lease.take(1)
    shown = images.add(10.0)
    if not newest:
        images.add(10.0 + age)
    command = Action(lease=1, sequence=1, image=shown, name="experiment")
    assert lease.refusal(1, command, 10.0 + age, needs_image=True) == reason
    unseen = Action(lease=1, sequence=2, image=0, name="experiment")
    assert lease.refusal(1, unseen, 10.0, needs_image=True) == "the page shows no recent image"


def test_replayed_commands_move_nothing_and_do_not_use_up_sequences() -> None:
    desk = Desk()
    desk.engage()
    desk.servo(is_holding=False)
    desk.servo(sequence=1)  # repeated
    desk.servo(sequence=10**9, image=10**9)  # refused for its image: its sequence must not count
    assert not desk.tick().any()
    desk.servo()
    assert desk.tick().any()


def test_a_stop_lasts_until_it_is_ended() -> None:
    desk = Desk()
    desk.engage()
    desk.input.stop("STOP")
    for _ in range(10):
        desk.press()
        assert not desk.tick().any()
    desk.input.enable()
    desk.servo()
    assert not desk.tick().any()
    desk.press()
    assert desk.tick().any()


def test_a_new_holder_starts_at_rest() -> None:
    desk = Desk()
    desk.engage()
    assert desk.tick().any()
    old = desk.lease.number
    desk.input.interrupt()
    desk.lease.take(2)
    desk.servo(lease=old)
    desk.servo(lease=old, client=2)
    assert not desk.tick().any()
    desk.servo(client=2)  # holds, but has never let go
    assert not desk.tick().any()


def test_acceleration_passes_the_reference_gate_and_release_stops_at_once() -> None:
    desk = Desk()
    desk.input.scale[:] = 1
    desk.engage()
    desk.servo((1, 1, 1))
    steps = []
    for _ in range(60):
        steps.append(desk.tick())
        desk.servo((1, 1, 1))
    changes = np.abs(np.diff(steps, axis=0, prepend=np.zeros((1, 3))))
    assert (changes <= np.array(CONFIG.safety.reference_count)).all()
    assert np.allclose(steps[-1], SPEED * PERIOD)
    desk.servo(is_holding=False)
    assert not desk.tick().any()


def test_clutch_scale_and_travel() -> None:
    desk = Desk()
    desk.input.is_coupled[Dof.ROTATION] = False
    desk.input.scale[Dof.BENDING] = 0
    desk.engage()
    for _ in range(4000):
        desk.servo((1, 1, 1))
        desk.tick()
    moved = desk.input.reference - START
    sine = CONFIG.experiment.insertion
    assert moved[Dof.INSERTION] == pytest.approx(4 / 3 * sine.amplitude, abs=SPEED[0] * PERIOD)
    assert not moved[1:].any()


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_ends_where_it_should_and_only_runs_with_the_page(name: str) -> None:
    desk = Desk()
    desk.engage()
    for _ in range(100):
        desk.servo()
        desk.tick()
    desk.servo(is_holding=False)
    desk.input.program = program(name, CONFIG, desk.input.reference)
    largest = np.zeros(3)
    while desk.input.program is not None:
        desk.servo(is_holding=False)
        largest = np.maximum(largest, np.abs(desk.tick()))
    assert desk.input.program_ended.endswith(": done")
    assert np.allclose(desk.input.reference, START, atol=SPEED * PERIOD)
    assert (largest <= np.array(CONFIG.safety.reference_speed) * PERIOD).all()
    desk.input.program = program(name, CONFIG, START + 0.01)
    desk.servo(is_holding=False)
    last = desk.now
    while desk.input.program is not None:
        desk.tick()
    assert IDLE_TIMEOUT < desk.now - last <= IDLE_TIMEOUT + 1.5 * PERIOD
    assert "ended early, at " in desk.input.program_ended
    assert "no accepted command for 0.5 s" in desk.input.program_ended


@dataclass
class Oracle:
    """When motion is allowed, stated independently: the last instant of each condition."""

    held_at: float = -np.inf
    """Arrival of the newest acceptable command, which holds."""
    has_released: bool = False
    stopped: bool = False
    sequence: int = -1
    log: list[str] = field(default_factory=list)

    def interrupt(self) -> None:
        self.has_released, self.held_at = False, -np.inf


EVENTS = st.lists(
    st.one_of(
        st.tuples(
            st.just("servo"),
            st.sampled_from([1, 1, 1, 2]),
            st.sampled_from([0, 0, 0, -1, 1]),
            st.sampled_from([1, 1, 1, 0, -3, 7]),
            st.sampled_from([0, 0, 0, 0, 30, 45, 51, 60, 400, -1]),
            st.booleans(),
        ),
        st.tuples(st.sampled_from(["take 1", "take 1", "take 2", "release", "stop", "enable"])),
        st.tuples(st.just("wait"), st.sampled_from([1, 3, 18, 19, 20, 21, 22, 60])),
        st.tuples(st.just("held")),
    ),
    max_size=120,
)


@settings(max_examples=500, deadline=None)
@given(EVENTS)
def test_any_sequence_of_events_moves_only_what_is_held(events) -> None:  # noqa: PLR0912
    desk, oracle = Desk(), Oracle()
    accepted_at = -np.inf
    desk.lease.take(1)
    for event in events:
        kind, is_held = event[0], False
        if kind == "servo":
            _, client, lease, sequence, age, is_holding = event
            number, image = oracle.sequence + sequence, desk.images.newest - age
            is_acceptable = (
                client == desk.lease.holder
                and lease == 0
                and sequence > 0
                and 0 < image <= desk.images.newest
                and age * PERIOD <= COMMAND_AGE + 1e-9
            )
            if number >= 0 and image >= 0 and desk.lease.number + lease >= 0:
                desk.servo(
                    is_holding=is_holding,
                    client=client,
                    lease=desk.lease.number + lease,
                    sequence=number,
                    image=image,
                )
                if is_acceptable:
                    oracle.sequence = number
                    accepted_at = desk.now
                    if is_holding:
                        oracle.held_at = desk.now if oracle.has_released else -np.inf
                    else:
                        oracle.has_released, oracle.held_at = True, -np.inf
        elif kind.startswith("take"):
            desk.input.interrupt()
            desk.lease.take(int(kind[-1]))
            oracle.interrupt()
            oracle.sequence = -1
        elif kind == "release":
            desk.input.interrupt()
            if desk.lease.holder is not None:
                desk.lease.release(desk.lease.holder)
            oracle.interrupt()
            oracle.sequence = -1
        elif kind == "stop":
            desk.input.stop("STOP")
            oracle.stopped = True
            oracle.interrupt()
        elif kind == "enable":
            desk.input.enable()
            oracle.stopped = False
            oracle.interrupt()
        is_held = kind == "held"
        for _ in range(event[1] if kind == "wait" else 1):
            moved = desk.tick(is_held=is_held)
            timeout = COMMAND_TIMEOUT if np.isfinite(oracle.held_at) else IDLE_TIMEOUT
            is_present = desk.now - accepted_at <= timeout
            if is_held or oracle.stopped or not is_present:
                oracle.interrupt()
            may_move = np.isfinite(oracle.held_at)
            assert not moved[1:].any()
            assert abs(moved[0]) <= SPEED[0] * PERIOD * (1 + 1e-9)
            if not may_move:
                assert not moved.any()
            else:
                at_limit = abs(desk.input.reference[0] - START[0]) > 0.0199
                assert moved[0] > 0 or at_limit
