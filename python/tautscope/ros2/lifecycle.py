"""States and transitions of a managed node, as lifecycle_msgs and design.ros2.org define them."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from tautscope.ros2.session import Node


class State(IntEnum):
    """Primary states."""

    UNCONFIGURED = 1
    INACTIVE = 2
    ACTIVE = 3
    FINALIZED = 4

    @property
    def label(self) -> str:
        """Name of the state in ROS."""
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition between primary states."""

    number: int
    label: str
    start: State
    goal: State


CONFIGURE = Transition(1, "configure", State.UNCONFIGURED, State.INACTIVE)
CLEANUP = Transition(2, "cleanup", State.INACTIVE, State.UNCONFIGURED)
ACTIVATE = Transition(3, "activate", State.INACTIVE, State.ACTIVE)
DEACTIVATE = Transition(4, "deactivate", State.ACTIVE, State.INACTIVE)
TRANSITIONS = (
    CONFIGURE,
    CLEANUP,
    ACTIVATE,
    DEACTIVATE,
    Transition(5, "shutdown", State.UNCONFIGURED, State.FINALIZED),
    Transition(6, "shutdown", State.INACTIVE, State.FINALIZED),
    Transition(7, "shutdown", State.ACTIVE, State.FINALIZED),
)
Change = Callable[[Transition], bool]
"""Carries a transition out; whether it succeeded."""


class Lifecycle:
    """The state of a node, and the services by which it is read and changed."""

    def __init__(self, node: Node, change: Change) -> None:
        self.state = State.UNCONFIGURED
        self._change = change
        self._events = node.publisher("~/transition_event", "lifecycle_msgs/msg/TransitionEvent")
        states = {"available_states": [_state(state) for state in State]}
        transitions = "GetAvailableTransitions"
        for name, kind, handler in (
            ("change_state", "ChangeState", self._change_state),
            ("get_state", "GetState", lambda _: {"current_state": _state(self.state)}),
            ("get_available_states", "GetAvailableStates", lambda _: states),
            ("get_available_transitions", transitions, lambda _: _descriptions(self.state)),
            ("get_transition_graph", transitions, lambda _: _descriptions(*State)),
        ):
            node.add_service(f"~/{name}", f"lifecycle_msgs/srv/{kind}", handler)

    def trigger(self, transition: Transition) -> bool:
        """Carry a transition out, if the node is in its start state; whether it succeeded."""
        if self.state is not transition.start or not self._change(transition):
            return False
        self.state = transition.goal
        self._events.publish(_description(transition))
        return True

    def _change_state(self, request: Any) -> dict[str, Any]:
        asked = request.transition
        for each in TRANSITIONS:
            # As in rclcpp_lifecycle, a label has priority over the number.
            is_asked = each.label == asked.label if asked.label else each.number == asked.id
            if is_asked and each.start is self.state:
                return {"success": self.trigger(each)}
        return {"success": False}


def _descriptions(*starts: State) -> dict[str, Any]:
    """The transitions from some states."""
    found = [_description(each) for each in TRANSITIONS if each.start in starts]
    return {"available_transitions": found}


def _description(transition: Transition) -> dict[str, Any]:
    return {
        "transition": {"id": transition.number, "label": transition.label},
        "start_state": _state(transition.start),
        "goal_state": _state(transition.goal),
    }


def _state(state: State) -> dict[str, Any]:
    return {"id": int(state), "label": state.label}
