/* Operating states of CRTK. Generated from python/tautscope/loop/operating_state.py by
   TAUTSCOPE_WRITE_HEADER=1 uv run pytest tests/ros_packages/test_operating_states.py */

#ifndef TAUTSCOPE_CONTROL__OPERATING_STATE_HPP_
#define TAUTSCOPE_CONTROL__OPERATING_STATE_HPP_

#include <cstdint>
#include <string_view>

namespace tautscope_control {

/// A later state has priority, except over the first.
enum class OperatingState : std::uint8_t { disabled, enabled, paused, fault };

constexpr const char *operating_state_names[] = {"DISABLED", "ENABLED", "PAUSED", "FAULT"};

/// What an operator or a drive asks of the loop.
enum class Request : std::uint32_t { resume = 1, enable = 2, pause = 4, disable = 8, acknowledge = 16, drive_fault = 32 };

/// A value of `state_command`: bits of the states in which it is accepted, and its goal.
struct StateCommand {
    std::string_view name;
    Request request;
    unsigned states;
    OperatingState goal;
};

/// In the order in which simultaneous ones are executed.
constexpr StateCommand state_commands[] = {
    {"resume", Request::resume, 0b0100, OperatingState::enabled},
    {"enable", Request::enable, 0b1101, OperatingState::enabled},
    {"pause", Request::pause, 0b0010, OperatingState::paused},
    {"disable", Request::disable, 0b1111, OperatingState::disabled},
};

/// The state that a `TautscopeReaction` requires of an enabled instrument.
constexpr OperatingState state_by_reaction[] = {
    OperatingState::enabled, // none
    OperatingState::enabled, // warn
    OperatingState::enabled, // hold_estimate
    OperatingState::enabled, // fade
    OperatingState::enabled, // pass_through
    OperatingState::paused, // hold_motion
    OperatingState::fault, // quick_stop
    OperatingState::fault, // disable
};

} // namespace tautscope_control

#endif
