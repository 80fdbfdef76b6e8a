"""POSIX signals end a process only after its motors have stopped."""

import os
import signal
import threading
from collections.abc import Iterator

import pytest
from tautscope.hardware.signals import defer_signals, exit_on_signals


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Check that the handlers are restored; SIGHUP is not ignored, as it is below nohup."""
    ours = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    assert [signal.getsignal(number) for number in numbers] == before
    signal.signal(signal.SIGHUP, ours)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signal_leaves_every_with(number: int) -> None:
    left = []
    with pytest.raises(SystemExit) as found, exit_on_signals():
        try:
            os.kill(os.getpid(), number)
            signal.pause()
        finally:
            left.append(number)
    assert left == [number]
    assert found.value.code == 128 + number


def test_nohup_keeps_a_process_that_is_not_terminated() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as found, exit_on_signals():
            os.kill(os.getpid(), signal.SIGHUP)
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert found.value.code == 128 + signal.SIGTERM


def test_sigint_ignored_by_the_shell_is_restored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), exit_on_signals():
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_second_ctrl_c_is_deferred_until_the_stop() -> None:
    stopped = []
    with pytest.raises(KeyboardInterrupt), exit_on_signals():
        try:
            raise KeyboardInterrupt
        finally:
            with defer_signals():
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
                stopped.append(True)
    assert stopped == [True]


def test_deferred_signal_still_ends_the_program() -> None:
    with pytest.raises(SystemExit), exit_on_signals(), defer_signals():
        os.kill(os.getpid(), signal.SIGTERM)


def test_other_threads_are_unaffected() -> None:
    entered = []

    def work() -> None:
        with exit_on_signals(), defer_signals():
            entered.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert entered == [True]
