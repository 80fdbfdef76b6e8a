"""Signals: a process that is told to end stops its motors first, and only then ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest
from tautscope.hardware.signals import exit_on_signals, signals_deferred


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """What was there before is there afterwards."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    assert [signal.getsignal(number) for number in numbers] == before


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_every_with(number: int) -> None:
    left = []
    with pytest.raises(SystemExit) as found, exit_on_signals():
        try:
            os.kill(os.getpid(), number)
            signal.pause()
        finally:
            left.append(number)
    assert left == [number]
    assert found.value.code == 128 + number


def test_sigint_that_a_shell_had_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), exit_on_signals():
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_second_ctrl_c_waits_for_the_stop() -> None:
    stopped = []
    with pytest.raises(KeyboardInterrupt), exit_on_signals():
        try:
            raise KeyboardInterrupt
        finally:
            with signals_deferred():
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
                stopped.append(True)
    assert stopped == [True]


def test_a_signal_during_the_stop_still_ends_the_program() -> None:
    with pytest.raises(SystemExit), exit_on_signals(), signals_deferred():
        os.kill(os.getpid(), signal.SIGTERM)


def test_other_threads_are_left_alone() -> None:
    went = []

    def work() -> None:
        with exit_on_signals(), signals_deferred():
            went.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert went == [True]
