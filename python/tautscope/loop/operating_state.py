"""Operating states of the collaborative robotics toolkit (CRTK), one machine for all of ROS 2."""

from enum import StrEnum

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


_DISABLED, _ENABLED, _PAUSED, _FAULT = OperatingState
STATE_COMMANDS = {
    "resume": ({_PAUSED}, _ENABLED),
    "enable": ({_DISABLED, _PAUSED, _FAULT}, _ENABLED),
    "pause": ({_ENABLED}, _PAUSED),
    "disable": (set(OperatingState), _DISABLED),
}
"""Value of ``state_command`` -> the states in which it is accepted, and the state that it asks for;
of simultaneous commands what stops comes last."""


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
        return max(self.goal, state_by_reaction(reaction), key=list(OperatingState).index)

    def accept(self, command: str, reaction: Reaction) -> bool:
        """Ask for the goal of one of `STATE_COMMANDS`; whether the present state allows it."""
        states, goal = STATE_COMMANDS[command]
        is_allowed = self.state(reaction) in states
        if is_allowed:
            self.goal = goal
        return is_allowed
