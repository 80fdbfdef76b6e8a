"""Motion towards a pixel that is held in the image."""

from collections.abc import Callable

import numpy as np
import pytest
import tautscope
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tautscope.console.lease import ImageTimes, Lease
from tautscope.console.operator_input import COMMAND_TIMEOUT, RAMP_TIME, OperatorInput
from tautscope.console.pointing import Pointing
from tautscope.console.programs import motion_limits
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from test_operator_input import CONFIG, PERIOD, SPEED, START, Desk

MODEL = build_feature_model(CONFIG)
LIMITS = motion_limits(CONFIG)
SIZE = CONFIG.camera.width, CONFIG.camera.height
NEAR = 1.0
"""Distance to a pixel that counts as reached [px]."""
ELSEWHERE = (100.0, 100.0)
SHARES = st.tuples(*[st.floats(0.02, 0.98)] * 3)
PIXELS = st.tuples(*[st.floats(0, size) for size in SIZE])


def state_at(shares: tuple[float, float, float]) -> np.ndarray:
    """A state at shares of the travels."""
    return LIMITS.least + np.array(shares) * (LIMITS.most - LIMITS.least)


def pixel(state: np.ndarray) -> np.ndarray | None:
    """The image of a tip."""
    found = MODEL.predict(state)
    return None if found is None else found[0][2:]


def desk_at(state: np.ndarray, point: tuple[float, float], scale: float = 1.0) -> Desk:
    """A desk whose operator has let go once, and now holds a pixel."""
    desk = Desk()
    desk.input.reset(state)
    desk.input.scale[:] = scale
    desk.lease.take(1)
    desk.tick()
    desk.servo(is_holding=False)
    hold(desk, point)
    return desk


def hold(desk: Desk, point: tuple[float, float]) -> None:
    desk.servo((0, 0, 0), point=point)


def until_rest(desk: Desk, point: tuple[float, float], each: Callable[[], object]) -> None:
    """Hold a pixel until the reference rests, which it then does to the bit."""
    resting = 0
    for _ in range(6000):
        hold(desk, point)
        # A degree of freedom that turns back, as another has come to its end, rests for a tick.
        resting = 0 if desk.tick().any() else resting + 1
        each()
        if resting == 3:
            break
    for _ in range(100):
        hold(desk, point)
        assert not desk.tick().any()


@settings(max_examples=40, deadline=None)
@given(SHARES, PIXELS, st.floats(0.2, 1), st.sets(st.sampled_from(list(Dof))))
def test_the_distance_falls_within_speed_and_travel_until_nothing_more_is_gained(
    shares: tuple[float, float, float],
    point: tuple[float, float],
    scale: float,
    uncoupled: set[Dof],
) -> None:
    start = state_at(shares)
    assume(pixel(start) is not None)
    desk = desk_at(start, point, scale)
    for dof in uncoupled:
        desk.input.is_coupled[dof] = False
    before = start, np.zeros(3), np.hypot(*(pixel(start) - point))
    most = scale * SPEED * PERIOD

    def check() -> None:
        nonlocal before
        last, step, distance = before
        state = desk.input.reference
        found = pixel(state)
        assert found is not None
        before = state, state - last, np.hypot(*(found - point))
        assert before[2] <= distance + 1e-6
        assert (np.abs(before[1]) <= most * (1 + 1e-9)).all()
        faster = np.abs(before[1]) - np.abs(step)
        assert (faster <= SPEED * PERIOD * PERIOD / RAMP_TIME * (1 + 1e-6)).all()
        assert (state >= LIMITS.least - most).all()
        assert (state <= LIMITS.most + most).all()

    until_rest(desk, point, check)
    moved = desk.input.reference - start
    assert not moved[[Dof.INSERTION, *uncoupled]].any()
    if not is_beside_the_last_image(desk.input.reference, most):
        gained, rate = gain(desk.input.reference, point, uncoupled)
        assert gained <= 2 or rate <= SIZE[0] / 100


def is_beside_the_last_image(state: np.ndarray, step: np.ndarray) -> bool:
    """Whether the instrument points at the camera after a step, where the model has no image."""
    turns = [(0, a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    return any(pixel(state + step * np.array(turn)) is None for turn in turns)


def gain(state: np.ndarray, point: tuple[float, float], uncoupled: set[Dof]) -> tuple[float, float]:
    """What the DOF that moves the image most could gain, of those that may move.

    Returns:
        Distance [px] along its motion; speed at which the pixel comes nearer [px/s].
    """
    motions = []
    predicted = MODEL.predict(state)
    assert predicted is not None
    error = point - predicted[0][2:]
    for dof in {Dof.ROTATION, Dof.BENDING} - uncoupled:
        motion = predicted[1][2:, dof] * SPEED[dof]
        may_move = state < LIMITS.most if motion @ error > 0 else state > LIMITS.least
        motions += [motion] * bool(may_move[dof])
    best = max(motions, key=np.linalg.norm, default=np.zeros(2))
    product = abs(best @ error)
    return product / max(np.linalg.norm(best), 1e-9), product / max(np.linalg.norm(error), 1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.7, 0.7), st.floats(0.4, 1.6))
def test_a_pixel_within_reach_is_reached(rotation: float, bending: float) -> None:
    point = pixel(np.array([START[0], rotation, bending]))
    assume(point is not None)
    desk = desk_at(START, tuple(point))
    until_rest(desk, tuple(point), lambda: None)
    state = desk.input.reference
    assert np.hypot(*(pixel(state) - point)) < NEAR or is_beside_the_last_image(
        state, SPEED * PERIOD
    )


def test_no_tick_covers_more_than_a_twentieth_of_what_is_left() -> None:
    point = pixel(START + np.array([0, 0.4, 0.3]))
    desk = desk_at(START, tuple(point))
    before = pixel(START)

    def check() -> None:
        nonlocal before
        found = pixel(desk.input.reference)
        assert np.hypot(*(found - before)) <= np.hypot(*(before - point)) / 20
        before = found

    until_rest(desk, tuple(point), check)


def test_no_state_without_an_image_is_entered() -> None:
    """Between both states the instrument points at the camera."""
    start, end = (np.array([0.025, rotation, 0.53]) for rotation in (0.6, 1.04))
    assert pixel((start + end) / 2) is None
    desk = desk_at(start, tuple(pixel(end)))
    until_rest(desk, tuple(pixel(end)), lambda: pixel(desk.input.reference).shape)


def test_a_pause_after_arrival_needs_a_new_press() -> None:
    point = tuple(pixel(START))
    desk = desk_at(START, point)
    until_rest(desk, point, lambda: None)
    for _ in range(round(COMMAND_TIMEOUT / PERIOD) + 2):
        desk.tick()
    hold(desk, ELSEWHERE)
    assert not desk.tick().any()


def test_from_rest_all_speed_up_by_one_factor_so_that_the_direction_stays() -> None:
    point = tuple(pixel(START + np.array([0, 0.5, 0.2])))
    desk = desk_at(START, point)
    shares = []
    while not shares or (shares[-1] < 0.9 and len(shares) < 1000):
        wanted = Pointing(CONFIG).velocity(
            desk.input.reference, point, SPEED, PERIOD, lambda direction: np.zeros(3, bool)
        )
        hold(desk, point)
        share = desk.tick()[1:] / (PERIOD * wanted[1:])
        assert share[0] == pytest.approx(share[1])
        shares.append(share[0])
    assert len(shares) > 2
    assert np.all(np.diff(shares) > 0)


def test_a_pixel_that_moves_is_followed() -> None:
    goals = [
        pixel(START + np.array([0, 0.4 * np.sin(angle), 0.3 * np.cos(angle)])) for angle in range(7)
    ]
    desk = desk_at(START, tuple(goals[0]))
    for goal in goals:
        until_rest(desk, tuple(goal), lambda: None)
        assert np.hypot(*(pixel(desk.input.reference) - goal)) < NEAR


@pytest.mark.parametrize(
    "interrupt",
    [
        lambda desk: desk.input.stop("STOP") or desk.tick() is None or desk.input.enable(),
        lambda desk: desk.input.interrupt("control was taken"),
        lambda desk: desk.tick(is_held=True),
        lambda desk: [desk.tick() for _ in range(round(COMMAND_TIMEOUT / PERIOD) + 2)],
        lambda desk: desk.lease.take(2) or desk.tick() is None or desk.lease.take(1),
    ],
    ids=["STOP", "taken", "held", "silence", "lease"],
)
def test_after_anything_unusual_it_rests_until_a_new_press(interrupt) -> None:
    desk = desk_at(START, ELSEWHERE)
    assert desk.tick().any()
    interrupt(desk)
    if desk.input.must_release is False:  # the lease's end alone: as for keys, commands are refused
        desk.input.interrupt()
    for _ in range(50):
        hold(desk, ELSEWHERE)
        assert not desk.tick().any()
    desk.servo(is_holding=False)
    hold(desk, ELSEWHERE)
    assert desk.tick().any()


def test_release_rests_at_once_and_silence_within_a_tenth_of_a_second() -> None:
    desk = desk_at(START, ELSEWHERE)
    assert desk.tick().any()
    desk.servo(is_holding=False)
    assert not desk.tick().any()
    hold(desk, ELSEWHERE)
    last = desk.now
    while desk.tick().any():
        assert desk.now - last <= COMMAND_TIMEOUT + PERIOD
    assert desk.input.rested_by


BEYOND = [(np.nan, 1.0), (1.0, np.nan), (-0.1, 1.0), (1.0, SIZE[1] + 0.1), (np.inf, 1.0)]


@pytest.mark.parametrize("point", BEYOND)
def test_a_point_that_is_none_of_the_image_is_refused(point: tuple[float, float]) -> None:
    desk = desk_at(START, point)
    for _ in range(20):
        hold(desk, point)
        assert not desk.tick().any()
    assert desk.input.refused == {"no point in an image of the bands": 21}


@pytest.mark.parametrize(
    "wrong", [{"lease": 0}, {"client": 2}, {"sequence": 0}, {"image": 0}], ids=str
)
def test_it_needs_what_every_command_needs(wrong: dict[str, int]) -> None:
    desk = desk_at(START, ELSEWHERE)
    desk.servo(is_holding=False)
    for _ in range(20):
        desk.servo((0, 0, 0), point=ELSEWHERE, **wrong)
        assert not desk.tick().any()
    assert desk.input.refused.total() == 20


def test_a_robot_without_bands_refuses_a_point() -> None:
    desk = Desk()
    desk.images = ImageTimes()
    desk.lease = Lease(desk.images)
    desk.input = OperatorInput(tautscope.axes(3, width_limit=1.0, unit="rad"), desk.lease)
    desk.lease.take(1)
    desk.tick()
    desk.servo(is_holding=False)
    hold(desk, ELSEWHERE)
    assert not desk.tick().any()
    assert desk.input.refused == {"no point in an image of the bands": 1}
