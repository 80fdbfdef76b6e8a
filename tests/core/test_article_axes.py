"""The article's scheme for several axes: each is by itself, and as Eqs. (1)-(6) say."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope import (
    Camera,
    Compensator,
    Estimator,
    HysteresisReduction,
    Instrument,
    Play,
    axes,
)
from tautscope.errors import ConfigError, SignalError

Floats = NDArray[np.float64]
MINUS, PLUS = np.array([-0.2, -0.1, -0.35]), np.array([0.1, 0.3, 0.15])
GAINS = np.array([5.0, 3.0, 1.5])
TAUS = np.array([0.02, 0.03, 0.025])


def references(count: int = 4000) -> Floats:
    """Sines of three periods, with a rest."""
    ticks = np.arange(count)
    time = np.where(ticks < 1000, ticks, np.maximum(ticks - 100, 1000)) / 200
    waves: Floats = np.sin(time[:, None] * [1.0, 0.7, 1.9]) * [1.0, 0.8, 1.4]
    return waves


def compensator() -> Compensator:
    return Compensator(free_gain=GAINS, gain_limit=5.0, delta_minus=MINUS, delta_plus=PLUS)


def estimator() -> Estimator:
    return Estimator(
        update_distance=TAUS,
        contact_tolerance=0.4,
        smoothing_factor=0.25,
        delta_minus=np.zeros(3),
        delta_plus=0.0,
    )


def crossing(u: Floats, minus: Floats, plus: Floats, gain: Floats) -> Floats:
    """Eqs. (1)-(3) by increments, split where the slack ends, for all axes at once."""
    c = u[0].copy()
    p = np.clip(0.0, minus, plus)
    commands = [c.copy()]
    for du in np.diff(u, axis=0):
        room = np.where(du > 0, plus - p, minus - p)
        free = np.where(np.abs(gain * du) < np.abs(room), gain * du, room)
        p += free
        c += free + du - free / gain
        commands.append(c.copy())
    return np.array(commands)


def offsets(c: Floats, m: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Eqs. (4)-(6), for all axes at once."""
    minus, plus = np.zeros(c.shape[1]), np.zeros(c.shape[1])
    last_c, last_m = c[0].copy(), m[0].copy()
    for now_c, now_m in zip(c, m, strict=True):
        dc, dm, offset = now_c - last_c, now_m - last_m, now_c - now_m
        due = np.abs(dc) >= TAUS
        contact = np.abs(dc - dm) < 0.4 * np.abs(dc)
        up, down = (contact & (dc > 0)) | (offset > plus), (contact & (dc < 0)) | (offset < minus)
        a = 1 - 0.75 ** (np.abs(dc) / TAUS)
        plus = np.where(due & up, (1 - a) * plus + a * offset, plus)
        minus = np.where(due & down, (1 - a) * minus + a * offset, minus)
        last_c, last_m = np.where(due, now_c, last_c), np.where(due, now_m, last_m)
        yield minus, plus


def tips(commands: Floats) -> Floats:
    tip, seen = np.zeros(3), []
    for command in commands:
        tip = np.clip(tip, command - PLUS, command - MINUS)
        seen.append(tip)
    return np.array(seen)


def test_commands_are_those_of_the_equations() -> None:
    u = references()
    np.testing.assert_allclose(
        compensator().run(u), crossing(u, MINUS, PLUS, GAINS), rtol=0, atol=1e-12
    )


def test_offsets_are_those_of_the_equations() -> None:
    commands = compensator().run(references())
    _, minus, plus = estimator().run(commands, tips(commands))
    expected = np.array(list(offsets(commands, tips(commands))))
    np.testing.assert_allclose(minus, expected[:, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(plus, expected[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(plus[-1] - minus[-1], PLUS - MINUS, atol=0.02)


def test_axes_do_not_influence_each_other() -> None:
    u, several, found = references(2000), compensator(), estimator()
    commands = several.run(u)
    results = found.run(commands, tips(commands))
    assert isinstance(results, tuple)
    stepwise = estimator()
    for axis in range(3):
        alone = Compensator(
            free_gain=GAINS[axis], gain_limit=5, delta_minus=MINUS[axis], delta_plus=PLUS[axis]
        )
        np.testing.assert_array_equal(alone.run(u[:, axis]), commands[:, axis])
        assert alone.command == several.command[axis]
        one = Estimator(
            update_distance=TAUS[axis],
            contact_tolerance=0.4,
            smoothing_factor=0.25,
            delta_minus=0.0,
            delta_plus=0.0,
        )
        for own, of_all in zip(
            one.run(commands[:, axis], tips(commands)[:, axis]), results, strict=True
        ):
            np.testing.assert_array_equal(own, of_all[:, axis])
    for command, tip in zip(commands, tips(commands), strict=True):
        triggers = stepwise.update(command, tip)
    assert len(triggers) == 3
    np.testing.assert_array_equal(stepwise.delta_plus, found.delta_plus)


def test_one_axis_takes_and_gives_numbers() -> None:
    one = Compensator(free_gain=5, gain_limit=5, delta_minus=-1, delta_plus=1)
    assert isinstance(one.step(1), float)
    assert isinstance(one.step(np.float32(2)), float)
    one.set_offsets([-2.0], 2.0)
    assert one.delta_plus == 2.0
    listed = Compensator(free_gain=5, gain_limit=5, delta_minus=[-1], delta_plus=1)
    np.testing.assert_array_equal(listed.step([1.0]), [1.0])


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"free_gain": [5.0, 0.5, 5.0]}, "free_gain"),
        ({"free_gain": [5.0, 5.0]}, "delta_minus"),
        ({"free_gain": []}, "free_gain"),
        ({"free_gain": np.full(9, 5.0), "delta_minus": 0.0, "delta_plus": 0.0}, "free_gain"),
    ],
)
def test_wrong_settings_are_named(settings: dict[str, object], field: str) -> None:
    defaults = {"free_gain": 5.0, "gain_limit": 5.0, "delta_minus": MINUS, "delta_plus": PLUS}
    with pytest.raises((ConfigError, SignalError)) as caught:
        Compensator(**(defaults | settings))  # type: ignore[arg-type]
    assert caught.value.field == field


LENGTHS = {"bending_length": 0.02, "marker_a": 0.004, "marker_b": 0.016}
NUMBERS: list[tuple[type, dict[str, object]]] = [
    (Play, {"delta_minus": -1.0, "delta_plus": 1.0, "output": 0.0}),
    (Instrument, LENGTHS | {"radius": 0.00175, "band_length": 0.004}),
    (Camera, {"fx": 424.0, "fy": 454.0, "cx": 349.6, "cy": 285.0}),
]


@pytest.mark.parametrize(
    ("kind", "settings", "field"),
    [(kind, settings, field) for kind, settings in NUMBERS for field in settings],
)
def test_an_argument_that_is_no_number_is_named(
    kind: type, settings: dict[str, object], field: str
) -> None:
    others = {"distortion": np.zeros(8)} if kind is Camera else {}
    kind(**settings, **others)
    for wrong in ("a", [1.0, 2.0], 10**400):
        with pytest.raises(SignalError, match=f"{field}: got .*, expected a number"):
            kind(**settings | {field: wrong}, **others)
    with pytest.raises(SignalError, match="input: got 'x', expected a number"):
        Play(delta_minus=-1.0, delta_plus=1.0).step("x")  # type: ignore[arg-type]


def test_a_wrong_number_of_axes_changes_nothing() -> None:
    several = compensator()
    first = several.step([0.1, 0.2, 0.3])
    for wrong in (0.1, [0.1, 0.2], np.zeros((3, 3))):
        with pytest.raises(SignalError):
            several.step(wrong)
    with pytest.raises(SignalError, match="references"):
        several.run(np.zeros(3))
    with pytest.raises(ConfigError, match="delta"):
        several.set_offsets([-1.0, 1.0, -1.0], [1.0, 0.0, 1.0])
    np.testing.assert_array_equal(several.step([0.1, 0.2, 0.3]), first)
    np.testing.assert_array_equal(several.delta_plus, PLUS)


def test_profile_paper_of_measured_axes_is_compensator_and_estimator() -> None:
    """The measured tip is the state, so that the loop is both while no flag is raised."""
    config = axes(3, width_limit=1.0, gain_limit=4.0, speed=6.0).replace(profile="paper")
    loop = HysteresisReduction(config)
    both = Compensator(free_gain=[4, 4, 4], gain_limit=4, delta_minus=0, delta_plus=0)
    article = config.insertion
    found = Estimator(
        update_distance=[0.02, 0.02, 0.02],
        contact_tolerance=article.contact_tolerance,
        smoothing_factor=article.smoothing_factor,
        delta_minus=0.0,
        delta_plus=0.0,
    )
    tip, error = np.zeros(3), np.zeros(3)
    for tick, reference in enumerate(references()):
        time = 0.005 * tick
        command = loop.step(reference, time)
        np.testing.assert_allclose(command, both.step(reference), rtol=0, atol=1e-9)
        tip = np.clip(tip, command - PLUS, command - MINUS)
        if tick % 4 == 0:
            report = loop.on_tip(tip, time)
            found.update(command, tip)
            both.set_offsets(found.delta_minus, found.delta_plus)
            np.testing.assert_allclose(report.state_estimate, tip, rtol=0, atol=1e-12)
        if tick > 3000:
            error = np.maximum(error, np.abs(tip - reference))
    assert loop.supervision.latched == ()
    np.testing.assert_allclose(loop.delta_plus - loop.delta_minus, PLUS - MINUS, atol=0.03)
    # A gain of 4 leaves a quarter of the larger offset.
    assert (error < 0.3 * np.maximum(PLUS, -MINUS) + 0.02).all(), error
    assert loop.hysteresis is None


def test_profile_paper_holds_what_was_not_measured() -> None:
    loop = HysteresisReduction(axes(2, width_limit=1.0).replace(profile="paper"))
    for tick in range(400):
        loop.step([0.001 * tick, 0.001 * tick], tick * 0.005)
    held = loop.predicted_state[1]
    report = loop.on_tip([0.2, np.nan], 399 * 0.005)
    assert report.status == "partial"
    np.testing.assert_array_equal(report.observable, [True, False])
    np.testing.assert_allclose(report.state_estimate, [0.2, held], rtol=0, atol=1e-12)
    assert np.isnan(report.state_deviation).tolist() == [False, True]


def test_profile_paper_takes_any_sensor() -> None:
    """One linear step of least squares, Eq. (16), from three sums and one of them again."""
    rows = np.array([[20.0, 0.5, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    loop = HysteresisReduction(axes(3, width_limit=1.0).replace(profile="paper"))
    noise = np.diag([1e-4, 1e-5, 4e-5, 1e-5])
    loop.step([0.1, 0.2, 0.3], 0.0)
    z = rows @ [0.15, 0.12, 0.22] + [0.0, 0.0, 0.002, -0.001]
    report = loop.on_measurement(z, 0.0, noise, lambda q: rows @ q, jacobian=lambda _: rows)
    weights = np.linalg.inv(noise)
    normal = rows.T @ weights @ rows
    expected = np.linalg.solve(normal, rows.T @ weights @ z)
    np.testing.assert_allclose(report.state_estimate, expected, rtol=0, atol=1e-9)
    std = np.sqrt(np.diag(np.linalg.inv(normal)))
    np.testing.assert_allclose(report.state_deviation, std, rtol=1e-6)
    np.testing.assert_allclose(report.innovation, z - rows @ [0.1, 0.2, 0.3], atol=1e-12)
