"""What drives say, against what they were told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import FollowingError, SilentDriveError, StateError
from tautscope.hardware import cia402
from tautscope.hardware.cia402 import Mode, Scale, State
from tautscope.hardware.following import Following
from tautscope.hardware.link import Feedback


@dataclass(slots=True)
class Traffic:
    """How punctual the bus was since the motors were enabled.

    Attributes:
        cycles: Set-points sent.
        late: Cycles that ended without the answer of a drive, per DOF; it may have come later.
        lost: Answers that never came, per DOF; one that is still under way counts until it comes.
        longest_pause: Longest time between two cycles [s].
    """

    cycles: int = 0
    late: list[int] = field(default_factory=lambda: [0, 0, 0])
    lost: list[int] = field(default_factory=lambda: [0, 0, 0])
    longest_pause: float = 0.0


def outside_travel(
    name: str, dof: Dof, position: float, travel: tuple[float, float]
) -> FollowingError:
    """The error of a motor that stands where it may not be [m or rad]."""
    return FollowingError(
        name,
        f"it stands at {position:.6g}, outside its travel {travel[0]:g} to {travel[1]:g}",
        f"Move it there by hand, or check drives.{dof.label}.home, sign and counts_per_unit",
    )


class Watch:
    """Judges what three drives say in each cycle.

    Args:
        config: Limits and times.
        names: The drives as a person finds them.
        modes: The modes they took.
    """

    def __init__(
        self, config: DrivesConfig, names: Sequence[str], modes: Mapping[Dof, Mode]
    ) -> None:
        self._config = config
        self._names = names
        self._modes = modes
        self._scales = [Scale(config[dof], dof.label) for dof in Dof]
        self._said: list[Feedback] = []
        self._answers = [0, 0, 0]
        # An answer says where the motor was as the set-point came; those in a buffer wait longer.
        buffered = Mode.INTERPOLATED_POSITION in modes.values()
        pending = 1 + (config.lead_points if buffered else 0)
        self._following = Following(config, config.cycle, pending)
        self.traffic = Traffic()

    def begin(self, said: list[Feedback]) -> NDArray[np.float64]:
        """The motors are enabled and at rest; where they are (3,) [m, rad, rad]."""
        self._said = said
        self._answers = [one.answers for one in said]
        self.traffic = Traffic()
        start = self.positions(said)
        self._following.begin(start)
        return start

    def positions(self, said: Sequence[Feedback]) -> NDArray[np.float64]:
        """Where the drives say that the motors are (3,) [m, rad, rad]."""
        counts = (one.position for one in said)
        return np.array(
            [scale.to_position(count) for scale, count in zip(self._scales, counts, strict=True)]
        )

    def check(self, command: NDArray[np.float64], said: list[Feedback]) -> NDArray[np.float64]:
        """Judge a cycle; where the motors are (3,) [m, rad, rad].

        Raises:
            SilentDriveError: A drive has not answered for `heartbeat_timeout`.
            StateError: A drive left operation enabled, its mode, or ignores set-points.
            FollowingError: A motor is not where it was told to be, or jumped.
        """
        self._count(said)
        positions, fresh = self.positions(said), [one.age == 0 for one in said]
        strays = self._following.strays(command, positions, fresh)
        for dof in Dof:
            self._check_state(dof, said[dof])
            if fresh[dof]:
                self._check_position(dof, said[dof], positions[dof], strays=bool(strays[dof]))
        self._said = said
        return positions

    def check_start(self, counts: Sequence[int]) -> None:
        """Whether motors stand inside their travel, before they are enabled.

        Raises:
            FollowingError: One does not.
        """
        for dof, scale in zip(Dof, self._scales, strict=True):
            position = scale.to_position(counts[dof])
            lower, upper = self._config[dof].travel
            slack = self._config[dof].following_error
            if not lower - slack <= position <= upper + slack:
                raise outside_travel(self._names[dof], dof, position, (lower, upper))

    @property
    def own_pause(self) -> str:
        """What to know if set-points stayed away so long that the drives stopped by themselves."""
        pause = self.traffic.longest_pause
        if pause <= self._config.heartbeat_timeout:
            return ""
        return (
            f"This computer paused for {pause * 1e3:.0f} ms between two set-points: see what else "
            "loads it, and its real-time priority (tautscope doctor)"
        )

    def stuck(self, dof: Dof, said: Feedback) -> SilentDriveError | StateError:
        """The error of a drive that does not reach the next state."""
        if said.age:
            return SilentDriveError(
                self._names[dof],
                f"no answer to {said.age} set-points",
                "Check its supply, and whether it takes synchronous PDOs",
            )
        return self.wrong_state(dof, said, "it stays in {}")

    def wrong_state(
        self, dof: Dof, said: Feedback, what: str = "it is in {}, not operation enabled"
    ) -> StateError:
        """The error of a drive that is not in the state it should be in."""
        state = cia402.state_of(said.statusword)
        shown = "a state CiA 402 does not have" if state is None else state.value
        if state in (State.FAULT, State.FAULT_REACTION):
            remedy = "Find the fault's cause in its manual (0x603F), then start with reset_faults"
        else:
            remedy = "Check its supply, its enable input and its limits"
        return StateError(
            self._names[dof],
            f"{what.format(shown)} (statusword 0x{said.statusword:04X})",
            remedy,
        )

    def _count(self, said: list[Feedback]) -> None:
        for dof, one in enumerate(said):
            self.traffic.late[dof] += one.age > 0
            self.traffic.lost[dof] = self.traffic.cycles - (one.answers - self._answers[dof])

    def _check_state(self, dof: Dof, said: Feedback) -> None:
        name, mode = self._names[dof], self._modes[dof]
        if said.silence > self._config.heartbeat_timeout:
            raise SilentDriveError(
                name,
                f"no answer to {said.age} set-points, {said.silence * 1e3:.0f} ms",
                "Check its supply and the bus, and what else loads this computer",
            )
        if cia402.state_of(said.statusword) is not State.OPERATION_ENABLED:
            raise self.wrong_state(dof, said)
        if said.mode != mode:
            raise StateError(
                name,
                f"it changed from mode {mode.value} to {said.mode}",
                "Let nobody else command it",
            )
        if not said.statusword & cia402.FOLLOWS:
            raise StateError(
                name,
                f"it ignores set-points (statusword 0x{said.statusword:04X}, bit 12)",
                "See its limits and inputs; it may be halted",
            )

    def _check_position(self, dof: Dof, said: Feedback, position: float, *, strays: bool) -> None:
        axis, name, before = self._config[dof], self._names[dof], self._said[dof]
        cyclic = self._modes[dof] is Mode.CYCLIC_SYNCHRONOUS_POSITION
        flagged = cyclic and bool(said.statusword & cia402.FOLLOWING_ERROR)
        if strays or flagged:
            following = self._following
            own = " (the drive says so itself)" if flagged else ""
            raise FollowingError(
                name,
                f"it is at {position:.6g} and was told to be within {following.least[dof]:.6g} and "
                f"{following.largest[dof]:.6g}{own}",
                "See whether something blocks the motor, then "
                f"drives.{dof.label}.counts_per_unit, following_error and following_window, and "
                "drives.lag",
            )
        jump = abs(position - self._scales[dof].to_position(before.position))
        elapsed = (before.age + 2) * self._config.cycle
        if jump > 2 * axis.speed_limit * elapsed + axis.following_error:
            raise FollowingError(
                name, f"its position jumped by {jump:.6g} in a cycle", "Check the encoder's cable"
            )
