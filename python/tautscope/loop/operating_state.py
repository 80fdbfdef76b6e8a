"""Operating states of the collaborative robotics toolkit (CRTK), one machine for all of ROS 2."""

from enum import StrEnum
from typing import NamedTuple

from tautscope.loop.safety import Reaction


class OperatingState(StrEnum):
    """State of an instrument; a later one has priority, except over the first."""

    DISABLED = "DISABLED"
    """The loop does not run, and no command is to be sent."""
    ENABLED = "ENABLED"
    """The reference is followed."""
    PAUSED = "PAUSED"
    """The command is held; `resume` continues where the reference then is."""
    FAULT = "FAULT"
    """The drives are to be stopped; `enable` clears it, unless the loop has to be created anew."""

    @property
    def rank(self) -> int:
        """0 to 3."""
        return list(OperatingState).index(self)


class Step(NamedTuple):
    """In which states a command is accepted, and the state that it asks for."""

    states: tuple[OperatingState, ...]
    goal: OperatingState


_DISABLED, _ENABLED, _PAUSED, _FAULT = OperatingState
STATE_COMMANDS = {
    "resume": Step((_PAUSED,), _ENABLED),
    "enable": Step((_DISABLED, _PAUSED, _FAULT), _ENABLED),
    "pause": Step((_ENABLED,), _PAUSED),
    "disable": Step(tuple(OperatingState), _DISABLED),
}
"""Values of ``state_command``; of simultaneous ones what stops comes last."""


def state_by_reaction(reaction: Reaction) -> OperatingState:
    """The state that a reaction of the supervisor requires of an enabled instrument."""
    if reaction.rank >= Reaction.QUICK_STOP.rank:
        return OperatingState.FAULT
    return OperatingState.PAUSED if reaction is Reaction.HOLD_MOTION else OperatingState.ENABLED


class StateMachine:
    """The operating state: what was asked for, unless the supervisor requires a later one.

    Attributes:
        goal: The state asked for; `FAULT` if something else than the supervisor found one.
    """

    def __init__(self) -> None:
        self.goal = OperatingState.DISABLED

    def state(self, reaction: Reaction) -> OperatingState:
        """The state while a reaction is in force."""
        if self.goal is OperatingState.DISABLED:
            return self.goal
        return max(self.goal, state_by_reaction(reaction), key=lambda state: state.rank)

    def accept(self, command: str, reaction: Reaction) -> bool:
        """Ask for the goal of one of `STATE_COMMANDS`; whether the present state allows it."""
        step = STATE_COMMANDS[command]
        is_allowed = self.state(reaction) in step.states
        if is_allowed:
            self.goal = step.goal
        return is_allowed
