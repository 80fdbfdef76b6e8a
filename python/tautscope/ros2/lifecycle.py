"""States and transitions of a managed node, as lifecycle_msgs and design.ros2.org define them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from tautscope.ros2 import types
from tautscope.ros2.endpoints import Publisher, Service
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
    """The state of a node, and the services by which it is read and changed.

    Args:
        node: Has the services.
        change: Carries a transition out.
    """

    def __init__(self, node: Node, change: Change) -> None:
        self.state = State.UNCONFIGURED
        self._change = change
        self._events: Publisher = node.publisher(
            "~/transition_event", "lifecycle_msgs/msg/TransitionEvent"
        )
        handlers = {
            "change_state": ("ChangeState", self._change_state),
            "get_state": ("GetState", self._get_state),
            "get_available_states": ("GetAvailableStates", self._get_states),
            "get_available_transitions": ("GetAvailableTransitions", self._get_transitions),
            "get_transition_graph": ("GetAvailableTransitions", self._get_graph),
        }
        self._services: list[Service] = [
            node.service(f"~/{name}", f"lifecycle_msgs/srv/{kind}", handler)
            for name, (kind, handler) in handlers.items()
        ]

    def serve(self) -> None:
        """Answer requests."""
        for service in self._services:
            service.serve()

    def trigger(self, transition: Transition) -> bool:
        """Carry a transition out, if the node is in its start state; whether it succeeded."""
        if self.state is not transition.start or not self._change(transition):
            return False
        self.state = transition.goal
        self._events.publish(
            types.make(
                "lifecycle_msgs/msg/TransitionEvent",
                timestamp=0,
                transition=_transition(transition),
                start_state=_state(transition.start),
                goal_state=_state(transition.goal),
            )
        )
        return True

    def _change_state(self, request: Any) -> Any:
        asked = request.transition
        # As in rclcpp_lifecycle, a label has priority over the number.
        found = [
            each
            for each in TRANSITIONS
            if each.start is self.state
            and (each.label == asked.label if asked.label else each.number == asked.id)
        ]
        success = bool(found) and self.trigger(found[0])
        return types.make("lifecycle_msgs/srv/ChangeState_Response", success=success)

    def _get_state(self, request: Any) -> Any:
        return types.make("lifecycle_msgs/srv/GetState_Response", current_state=_state(self.state))

    def _get_states(self, request: Any) -> Any:
        return types.make(
            "lifecycle_msgs/srv/GetAvailableStates_Response",
            available_states=[_state(state) for state in State],
        )

    def _get_transitions(self, request: Any) -> Any:
        return _descriptions(each for each in TRANSITIONS if each.start is self.state)

    def _get_graph(self, request: Any) -> Any:
        return _descriptions(TRANSITIONS)


def _descriptions(transitions: Any) -> Any:
    return types.make(
        "lifecycle_msgs/srv/GetAvailableTransitions_Response",
        available_transitions=[
            types.make(
                "lifecycle_msgs/msg/TransitionDescription",
                transition=_transition(each),
                start_state=_state(each.start),
                goal_state=_state(each.goal),
            )
            for each in transitions
        ],
    )


def _state(state: State) -> Any:
    return types.make("lifecycle_msgs/msg/State", id=int(state), label=state.label)


def _transition(transition: Transition) -> Any:
    return types.make("lifecycle_msgs/msg/Transition", id=transition.number, label=transition.label)
