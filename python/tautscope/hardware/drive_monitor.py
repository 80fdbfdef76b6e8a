"""Checks of what drives report, whatever their protocol: timeliness, following error."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig
from tautscope.config.drives import waiver_hint
from tautscope.dof import Motor
from tautscope.errors import FollowingError, SilentDriveError
from tautscope.hardware.drive_group import Feedback
from tautscope.hardware.following_error import FollowingErrorMonitor
from tautscope.hardware.scale import Scale


@dataclass(slots=True)
class BusStatistics:
    """Timing of the bus since the motors were enabled.

    Attributes:
        late: Per motor, cycles that ended before the answer of the drive came.
        lost: Per motor, answers that never came; a pending answer counts until it comes.
        longest_pause: Longest time between two cycles, or of the one that failed [s].
    """

    late: list[int]
    lost: list[int]
    cycles: int = 0
    longest_pause: float = 0.0


class DriveMonitor:
    """Checks the feedback of drives in each cycle; `names` and `pending` are of `DriveGroup`."""

    def __init__(self, config: DrivesConfig, names: Sequence[str], pending: int) -> None:
        self._config = config
        self._names = names
        self._scales = [Scale(config[dof], dof) for dof in config.all_motors]
        self._following = FollowingErrorMonitor(config, config.cycle, pending)
        self._last_cycle = 0.0
        self.reset([Feedback()] * len(self._scales))

    def begin_cycle(self) -> None:
        """Count a cycle, and the time since the one before."""
        self.note_pause()
        self._last_cycle = time.monotonic()
        self.statistics.cycles += 1

    def note_pause(self) -> None:
        """Count the time since the last cycle began, in which drives may have appeared silent."""
        if self.statistics.cycles:
            pause = time.monotonic() - self._last_cycle
            self.statistics.longest_pause = max(self.statistics.longest_pause, pause)

    def reset_statistics(self) -> None:
        """Begin to count anew: the time since the last run is no pause."""
        count = len(self._scales)
        self.statistics = BusStatistics([0] * count, [0] * count)

    def reset(self, feedback: Sequence[Feedback]) -> NDArray[np.float64]:
        """Start from motors that are enabled and at rest; their positions (n,) [m or rad]."""
        self._answers = [one.answers for one in feedback]
        self.reset_statistics()
        start = self.positions(feedback)
        self._before = [(at, 0) for at in start]
        """Position [m or rad] and age of each motor in the last cycle."""
        self._late = [0] * len(feedback)
        """Cycles in a row that ended before the answer of each motor came: it is not checked."""
        self._following.reset(start)
        return start

    def positions(self, feedback: Sequence[Feedback]) -> NDArray[np.float64]:
        """Position actual values (n,) [m or rad]."""
        counts = (one.position for one in feedback)
        return np.array(
            [scale.to_position(count) for scale, count in zip(self._scales, counts, strict=True)]
        )

    def check(
        self, command: NDArray[np.float64], feedback: Sequence[Feedback]
    ) -> NDArray[np.float64]:
        """Check one cycle; position actual values (n,) [m or rad].

        Raises:
            SilentDriveError: A drive has not answered in time for `heartbeat_timeout`.
            FollowingError: The following error is too large, or the position jumped.
        """
        self._count(feedback)
        positions, fresh = self.positions(feedback), [one.age == 0 for one in feedback]
        exceeded = self._following.update(command, positions, fresh)
        for dof in self._config.all_motors:
            self._late[dof] = 0 if fresh[dof] else self._late[dof] + 1
            self._check_silence(dof, feedback[dof])
            if fresh[dof]:
                self._check_position(dof, feedback[dof], positions[dof], bool(exceeded[dof]))
        self._before = [(at, one.age) for at, one in zip(positions, feedback, strict=True)]
        return positions

    def check_start_positions(self, counts: Sequence[int]) -> None:
        """Raise the error for a motor outside its travel, before the motors are enabled.

        Raises:
            FollowingError: A motor is outside.
        """
        for dof, scale in zip(self._config.all_motors, self._scales, strict=True):
            position = scale.to_position(counts[dof])
            if not scale.is_inside(position):
                lower, upper = self._config[dof].travel
                raise FollowingError(
                    self._names[dof],
                    f"position {position:.6g} is outside its travel {lower:g} to {upper:g}",
                    f"Move it inside by hand, or check {dof.key}.home, sign and counts_per_unit",
                )

    @property
    def pause_note(self) -> str:
        """A note for errors if this computer paused for longer than the drives tolerate."""
        pause = self.statistics.longest_pause
        if pause <= self._config.heartbeat_timeout:
            return ""
        return (
            f"This computer paused for {pause * 1e3:.0f} ms between two set-points: check its load "
            "and its real-time priority (tautscope doctor)"
        )

    def _count(self, feedback: Sequence[Feedback]) -> None:
        for dof, one in enumerate(feedback):
            self.statistics.late[dof] += one.age > 0
            self.statistics.lost[dof] = self.statistics.cycles - (one.answers - self._answers[dof])

    def _check_silence(self, dof: Motor, feedback: Feedback) -> None:
        # Late answers are as bad as none: no position is checked meanwhile.
        silence = max(feedback.silence, self._late[dof] * self._config.cycle)
        if silence > self._config.heartbeat_timeout:
            raise SilentDriveError(
                self._names[dof],
                f"no answer to {self._late[dof]} set-points in time, {silence * 1e3:.0f} ms",
                "Check its supply, the bus, and the load of this computer",
            )

    def _check_position(
        self, dof: Motor, feedback: Feedback, position: float, has_exceeded: bool
    ) -> None:
        axis, name, (last, age) = self._config[dof], self._names[dof], self._before[dof]
        is_flagged = feedback.reports_following_error
        if has_exceeded or is_flagged:
            following = self._following
            note = " (the drive reports it too)" if is_flagged else ""
            if not has_exceeded:
                raise FollowingError(
                    name,
                    f"it reports a following error at {position:.6g}; recent commands are "
                    f"{following.lower[dof]:.6g} to {following.upper[dof]:.6g}, within the limits",
                    "Check its own limits. " + waiver_hint("6041.13"),
                )
            raise FollowingError(
                name,
                f"following error: position {position:.6g}, recent commands "
                f"{following.lower[dof]:.6g} to {following.upper[dof]:.6g}{note}",
                "Check whether something blocks the motor or it turns against its encoder, then "
                f"{dof.key}.counts_per_unit, following_error, following_window and drives.lag",
            )
        jump = abs(position - last)
        elapsed = (age + 2) * self._config.cycle
        if jump > 2 * axis.speed_limit * elapsed + axis.following_error:
            raise FollowingError(
                name, f"its position jumped by {jump:.6g} in a cycle", "Check the encoder cable"
            )
