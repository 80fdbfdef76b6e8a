"""A tip behind backlash passes; the tip of a wrongly configured motor does not."""

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware.plausibility import PlausibilityMonitor, check_experiment

CONFIG = Config()
START = np.array([CONFIG.experiment[dof].centre for dof in Dof])
SLACK = np.array([10e-3, 1.84, 1.1])
"""Table 1 of the article."""
dofs = pytest.mark.parametrize("dof", Dof, ids=lambda dof: dof.label)


def run_sine(
    dof: Dof,
    tip_of: Callable[[float, float], float],
    *,
    is_measured: bool = True,
    noise: float = 0.0,
    config: Config = CONFIG,
    delay: int = 0,
) -> None:
    """Run five periods of a sine; `tip_of` computes the tip from its last position and the motor.

    The report on a frame comes ``delay`` frames of 0.04 s after its capture.
    """
    sine, random = config.experiment[dof], np.random.default_rng(0)
    monitor, tip = PlausibilityMonitor(CONFIG, START), float(START[dof])
    pending: deque[tuple[float, Any]] = deque()
    for time in np.arange(0, 5 * sine.period, 0.04):
        motor = START.copy()
        motor[dof] += sine.amplitude * np.sin(2 * np.pi * time / sine.period)
        monitor.add_sample(float(time), motor)
        tip = tip_of(tip, motor[dof])
        estimate = START.copy()
        estimate[dof] = tip + noise * random.standard_normal()
        report: Any = SimpleNamespace(state_estimate=estimate, observable=np.full(3, is_measured))
        pending.append((float(time), report))
        if len(pending) > delay:
            monitor.check_frame(*pending.popleft())


def play(width: float) -> Callable[[float, float], float]:
    return lambda tip, motor: min(max(tip, motor - width / 2), motor + width / 2)


@dofs
@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_tip_behind_slack_passes(dof: Dof, fraction: float) -> None:
    run_sine(dof, play(fraction * SLACK[dof]), noise=0.05 * CONFIG[dof].update_distance)


@dofs
def test_fast_motor_with_delayed_frames_passes(dof: Dof) -> None:
    """The tip is compared with the motor position at capture."""
    faster = {"safety.reference_speed": [0.1, 10.0, 10.0]}
    quick = CONFIG.replace(**faster, **{f"experiment.{dof.label}.period": 2.0})
    run_sine(dof, play(SLACK[dof]), config=quick, delay=5)


@dofs
def test_strokes_inside_the_slack_pass(dof: Dof) -> None:
    """A tip behind larger slack does not move."""
    small = CONFIG.replace(**{f"experiment.{dof.label}.amplitude": float(0.4 * SLACK[dof])})
    run_sine(dof, play(SLACK[dof]), config=small, noise=0.5 * CONFIG[dof].update_distance)


@dofs
def test_tip_that_moves_against_its_motor(dof: Dof) -> None:
    follow = play(SLACK[dof])
    with pytest.raises(ConfigError, match=f"drives.{dof.label}.sign"):
        run_sine(dof, lambda tip, motor: follow(tip, 2 * START[dof] - motor))


@dofs
def test_tip_that_moves_too_far(dof: Dof) -> None:
    with pytest.raises(ConfigError, match=f"drives.{dof.label}.counts_per_unit.*too large"):
        run_sine(dof, lambda tip, motor: START[dof] + 57.3 * (motor - START[dof]))


@dofs
def test_tip_that_does_not_move(dof: Dof) -> None:
    far = CONFIG.replace(
        **{f"experiment.{dof.label}.amplitude": 1.5 * CONFIG.experiment[dof].amplitude}
    )
    with pytest.raises(ConfigError, match=f"drives.{dof.label}.counts_per_unit.*too small"):
        run_sine(dof, lambda tip, motor: tip, config=far)


@dofs
def test_tip_that_is_never_measured(dof: Dof) -> None:
    with pytest.raises(ConfigError, match=f"drives.{dof.label}: .*no frame measured it"):
        run_sine(dof, play(0.0), is_measured=False)


@dofs
def test_drives_that_cannot_make_the_commands_of_the_experiment_are_refused(dof: Dof) -> None:
    config = load_config("bench")
    sine = config.experiment[dof]
    check_experiment(config)
    # The compensated motor lags behind and leads by half of the slack, and crosses it K_b times as
    # fast as the reference.
    extremes = sine.centre + np.array([-1, 1]) * (sine.amplitude + SLACK[dof] / 2)
    speed = CONFIG[dof].free_gain * 2 * np.pi * sine.amplitude / sine.period
    for key, value in {
        "travel": [float(extremes[0]) + 1e-6, float(extremes[1])],
        "speed_limit": 0.99 * speed,
    }.items():
        with pytest.raises(ConfigError, match=f"{dof.key}.{key}.*experiment"):
            check_experiment(config.replace(**{f"{dof.key}.{key}": value}))


def test_a_rotation_moves_as_fast_as_an_insertion_with_which_it_shares_a_friction() -> None:
    slow = load_config("bench").replace(**{"drives.rotation.speed_limit": 9.0})
    # On a rig drawn at random rotation reached 9.09 rad/s while insertion moved.
    with pytest.raises(ConfigError, match=r"drives\.rotation\.speed_limit.*experiment\.insertion"):
        check_experiment(slow)
    check_experiment(slow.replace(**{"experiment.insertion.period": 12.0}))
    check_experiment(slow.replace(profile="paper"))
