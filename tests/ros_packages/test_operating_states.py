"""The operating states of the package in C++ are those of Python."""

import itertools
import os
from pathlib import Path

from tautscope.loop.operating_state import (
    STATE_COMMANDS,
    OperatingState,
    StateMachine,
    state_by_reaction,
)
from tautscope.loop.safety import Reaction

HEADER = (
    Path(__file__).resolve().parents[2]
    / "ros/tautscope_control/include/tautscope_control/operating_state.hpp"
)
REQUESTS = (*STATE_COMMANDS, "acknowledge", "drive_fault")


def header() -> str:
    """The header, from `tautscope.loop.operating_state`."""

    def goal(state: OperatingState) -> str:
        return f"OperatingState::{state.lower()}"

    states = ", ".join(state.lower() for state in OperatingState)
    names = ", ".join(f'"{state}"' for state in OperatingState)
    requests = ", ".join(f"{name} = {1 << bit}" for bit, name in enumerate(REQUESTS))
    commands = "\n".join(
        f'    {{"{name}", Request::{name}, 0b'
        + "".join(str(int(state in accepting)) for state in reversed(OperatingState))
        + f", {goal(asked)}}},"
        for name, (accepting, asked) in STATE_COMMANDS.items()
    )
    reactions = "\n".join(
        f"    {goal(state_by_reaction(reaction))}, // {reaction}" for reaction in Reaction
    )
    return f"""\
/* Operating states of CRTK. Generated from python/tautscope/loop/operating_state.py by
   TAUTSCOPE_WRITE_HEADER=1 uv run pytest tests/ros_packages/test_operating_states.py */

#ifndef TAUTSCOPE_CONTROL__OPERATING_STATE_HPP_
#define TAUTSCOPE_CONTROL__OPERATING_STATE_HPP_

#include <cstdint>
#include <string_view>

namespace tautscope_control {{

/// A later state has priority, except over the first.
enum class OperatingState : std::uint8_t {{ {states} }};

constexpr const char *operating_state_names[] = {{{names}}};

/// What an operator or a drive asks of the loop.
enum class Request : std::uint32_t {{ {requests} }};

/// A value of `state_command`: bits of the states in which it is accepted, and its goal.
struct StateCommand {{
    std::string_view name;
    Request request;
    unsigned states;
    OperatingState goal;
}};

/// In the order in which simultaneous ones are executed.
constexpr StateCommand state_commands[] = {{
{commands}
}};

/// The state that a `TautscopeReaction` requires of an enabled instrument.
constexpr OperatingState state_by_reaction[] = {{
{reactions}
}};

}} // namespace tautscope_control

#endif
"""


def test_the_header_of_the_package_is_this_one() -> None:
    if "TAUTSCOPE_WRITE_HEADER" in os.environ:
        HEADER.write_text(header(), encoding="utf-8")
    assert HEADER.read_text(encoding="utf-8") == header(), (
        f"write it: TAUTSCOPE_WRITE_HEADER=1 uv run pytest {__file__}"
    )


def test_motion_needs_enable_and_stops_by_disable_pause_and_the_supervisor() -> None:
    for *commands, reaction in itertools.product(*[STATE_COMMANDS] * 3, Reaction):
        machine = StateMachine()
        accepted = [command for command in commands if machine.accept(command, Reaction.NONE)]
        state = machine.state(reaction)
        is_enabled = "enable" in accepted and accepted[-1] != "disable"
        assert (state is not OperatingState.DISABLED) == is_enabled
        if state is OperatingState.ENABLED:
            assert accepted[-1] in ("enable", "resume")
            assert reaction.rank < Reaction.HOLD_MOTION.rank
        if is_enabled and reaction.rank >= Reaction.QUICK_STOP.rank:
            assert state is OperatingState.FAULT
            assert not machine.accept("resume", reaction)
