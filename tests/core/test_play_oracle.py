"""The play operator, Eq. (1), against the centred backlash of python-control."""

import control
import numpy as np
import pytest
from tautscope import _core


@pytest.mark.parametrize("seed", range(5))
def test_play_equals_the_backlash_of_python_control(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width = rng.uniform(0.1, 3.0)
    offset = rng.uniform(-2.0, 2.0)
    inputs = np.cumsum(rng.normal(0.0, 0.5, 5000))
    backlash = control.friction_backlash_nonlinearity(width)
    expected = [backlash(value - offset) for value in inputs]

    play = _core.Play(delta_minus=offset - width / 2, delta_plus=offset + width / 2)
    np.testing.assert_allclose(play.run(inputs), expected, atol=1e-12, err_msg=f"seed {seed}")
    assert play.width == pytest.approx(width, abs=1e-15)


def test_step_and_run_agree() -> None:
    inputs = np.sin(np.linspace(0.0, 20.0, 400))
    one, other = (_core.Play(delta_minus=-0.3, delta_plus=0.1, output=0.2) for _ in range(2))
    np.testing.assert_array_equal(one.run(inputs), [other.step(value) for value in inputs])
    assert one.output == other.output


def test_input_may_be_anything_numpy_takes() -> None:
    play = _core.Play(delta_minus=0, delta_plus=1)
    np.testing.assert_array_equal(play.run([0, 2, 2, 1]), [0.0, 1.0, 1.0, 1.0])
