"""Any rig in real time, opened as often as the operator enables it."""

import math
import time
from collections.abc import Callable
from typing import TypeVar

from numpy.typing import ArrayLike

from tautscope.errors import DriveError, TautscopeError
from tautscope.loop.rig import Rig, Sample, disable

T = TypeVar("T")


class Pace:
    """Waits for the ends of control periods [s]; who comes late does not catch up."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._due = time.monotonic()

    def wait(self) -> None:
        """Wait for the end of the period that follows the last one."""
        self._due += self._period
        late = math.floor((time.monotonic() - self._due) / self._period)
        self._due += max(late, 0) * self._period
        time.sleep(max(0.0, self._due - time.monotonic()))


class PacedRig:
    """A rig that is made anew at each `reset`, in real time also where its `step` does not wait.

    A simulated one moves no motors. Errors of the rig that are none of this package become a
    `DriveError`.
    """

    def __init__(
        self, make: Callable[[], Rig], control_period: float, *, is_simulated: bool
    ) -> None:
        self._make, self.control_period, self.is_simulated = make, control_period, is_simulated
        self._rig: Rig | None = None

    def reset(self) -> Sample:
        """Make a rig, and go to its start."""
        self.close()
        self._rig = self._checked(self._make)
        sample = self._checked(self._rig.reset)
        self._pace = Pace(self.control_period)
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """Send a command (n,) [m or rad], and wait for the end of the control period."""
        rig = self._rig
        assert rig is not None
        sample = self._checked(lambda: rig.step(command))
        self._pace.wait()
        return sample

    def interrupt(self) -> None:
        """Quick-stop a rig that can be interrupted, as a `MotorRig`; for any thread."""
        self._checked(getattr(self._rig, "interrupt", lambda: None))

    def close(self) -> None:
        """Stop the motors; the next `reset` makes another rig."""
        self._end(lambda rig: rig.close())

    def disable(self) -> None:
        """Like `close`, and disable the motors of a rig that can, as a `MotorRig`."""
        self._end(disable)

    def _end(self, end: Callable[[Rig], None]) -> None:
        rig, self._rig = self._rig, None
        if rig is not None:
            self._checked(lambda: end(rig))

    @staticmethod
    def _checked(call: Callable[[], T]) -> T:
        try:
            return call()
        except TautscopeError:
            raise
        except Exception as error:
            raise DriveError("rig", f"{type(error).__name__}: {error}", "See to the rig") from error
