"""A loop that several threads use."""

import sys
from collections.abc import Iterator
from threading import Thread
from time import sleep

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope import HysteresisReduction, axes


@pytest.fixture
def frequent_switches() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("frequent_switches")
def test_a_thread_measures_while_another_one_steps() -> None:
    loop, errors, calls, time = HysteresisReduction(axes(1, width_limit=1.0)), [], 0, 0.0

    def predict(q: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal calls
        calls += 1
        sleep(1e-4)  # another thread is due
        return q

    def measure() -> None:
        try:
            while calls < 30:
                loop.on_measurement([0.0], time, [[1e-4]], predict)
        except RuntimeError as error:
            errors.append(error)

    sensor = Thread(target=measure)
    sensor.start()
    try:
        while sensor.is_alive():
            loop.step([0.0], time)
            assert loop.supervision.lead == 1.0
            assert loop.delta_plus - loop.delta_minus > 0
            time += 0.005
    finally:
        calls = 30
        sensor.join()
    assert not errors
