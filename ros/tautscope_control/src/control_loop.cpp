#include "tautscope_control/control_loop.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tautscope_control {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
/// Longest time without positions from the drives, as `DRIVER_TIMEOUT` of tautscope.ros2.driver [s].
constexpr double driver_timeout = 0.1;

bool contains(std::uint32_t requests, Request request) noexcept {
    return (requests & static_cast<std::uint32_t>(request)) != 0;
}

} // namespace

static_assert(std::atomic<double>::is_always_lock_free && std::atomic<std::uint32_t>::is_always_lock_free);

std::optional<Request> parse_state_command(std::string_view text) noexcept {
    for (const StateCommand &command : state_commands) {
        if (text == command.name) {
            return command.request;
        }
    }
    return text == "acknowledge" ? std::optional(Request::acknowledge) : std::nullopt;
}

std::string flag_names(std::uint32_t flags) {
    std::string names;
    for (std::uint32_t flag = 0; flag < 32; ++flag) {
        const char *name = (flags >> flag) & 1U ? tautscope_flag_name(flag) : nullptr;
        if (name != nullptr) {
            names += names.empty() ? name : std::string(", ") + name;
        }
    }
    return names;
}

ControlLoop::ControlLoop(const std::string &toml)
    : loop_(toml), start_tolerance_(loop_.dofs()), period_(loop_.period()), measured_(loop_.dofs(), unknown), reference_(measured_),
      used_(measured_), command_(measured_), measured_at_(unknown), made_at_(unknown), engaged_at_(unknown) {
    for (std::size_t dof = 0; dof < loop_.dofs(); ++dof) {
        const char *name = "", *unit = "";
        tautscope::check(tautscope_loop_dof(loop_.handle(), dof, &name, &unit));
        dofs_.emplace_back(name);
        start_tolerance_[dof] = std::string_view(unit) == "m" ? 1e-3 : 0.05;
    }
    // With `[[dof]]` no bands can be predicted.
    TautscopeStatePrediction bands;
    has_bands_ = tautscope_loop_predict_state(loop_.handle(), 0.0, &bands) == TAUTSCOPE_RESULT_OK;
}

bool ControlLoop::is_finite(Numbers values) const noexcept {
    return values.size() == dofs_.size() &&
           std::all_of(values.data(), values.data() + values.size(), [](double value) { return std::isfinite(value); });
}

bool ControlLoop::set_measured(Numbers position, double time) noexcept {
    const bool is_known = is_finite(position);
    if (is_known) {
        measured_ = Values(position);
        measured_at_ = time;
    }
    return is_known;
}

bool ControlLoop::is_measured(double time) const noexcept { return std::abs(time - measured_at_) <= driver_timeout; }

bool ControlLoop::set_reference(Numbers position, double made_at) noexcept {
    const bool is_new = is_finite(position);
    if (is_new) {
        reference_ = Values(position);
        made_at_ = made_at;
        has_new_reference_ = true;
    }
    return is_new;
}

Tick ControlLoop::step(double time) noexcept {
    apply_requests(time);
    // An old reference must not begin a motion, nor stop one that has not begun.
    has_new_reference_ = has_new_reference_ && !(made_at_ < engaged_at_);
    const double share = wanted_share_.load(std::memory_order_relaxed);
    if (share != share_ && tautscope_loop_set_compensation(loop_.handle(), share) == TAUTSCOPE_RESULT_OK) {
        share_ = share;
    }
    if (!is_measured(time)) {
        raise_drive_fault();
    }
    if (state_ == OperatingState::disabled) {
        has_new_reference_ = false;
        return {command_, false, state_};
    }
    double made_at = made_at_;
    const bool is_resting = goal_ == OperatingState::paused || goal_ == OperatingState::fault;
    if (is_resting || is_clutching_) {
        if (is_clutching_ && !is_resting && has_new_reference_ && is_finite(command_)) {
            // Where the operator is now is where the motion continues.
            tautscope_loop_engage(loop_.handle());
            is_clutching_ = false;
            used_ = reference_;
        } else {
            made_at = unknown;
        }
    } else if (has_new_reference_) {
        used_ = reference_;
    }
    has_new_reference_ = false;
    if (is_finite(used_)) {
        tautscope_loop_step(loop_.handle(), used_.size(), used_.data(), made_at, time, command_.data());
    }
    update_state();
    return {command_, is_finite(command_) && state_ != OperatingState::fault, state_};
}

void ControlLoop::exchange() noexcept {
    if (exchange_.serve(loop_, state_ != OperatingState::disabled)) {
        update_state();
    }
}

void ControlLoop::post(Request request) noexcept {
    requests_.fetch_or(static_cast<std::uint32_t>(request), std::memory_order_relaxed);
}

bool ControlLoop::set_compensation(double share) noexcept {
    const bool is_share = share >= 0.0 && share <= 1.0;
    if (is_share) {
        wanted_share_.store(share, std::memory_order_relaxed);
    }
    return is_share;
}

Status ControlLoop::status() const noexcept {
    return {published_state_.load(std::memory_order_relaxed), reaction_.load(std::memory_order_relaxed),
            flags_.load(std::memory_order_relaxed), latched_.load(std::memory_order_relaxed),
            published_misplaced_.load(std::memory_order_relaxed), published_unmeasured_.load(std::memory_order_relaxed)};
}

void ControlLoop::apply_requests(double time) noexcept {
    const std::uint32_t requests = requests_.exchange(0, std::memory_order_relaxed);
    if (contains(requests, Request::acknowledge)) {
        tautscope_loop_acknowledge(loop_.handle());
    }
    for (const StateCommand &command : state_commands) {
        if (command.request == Request::disable && contains(requests, Request::drive_fault)) {
            raise_drive_fault();
        }
        if (contains(requests, command.request) && ((command.states >> static_cast<unsigned>(state_)) & 1U) != 0) {
            goal_ = command.goal;
            is_unmeasured_ = false;
            if (command.request == Request::enable) {
                enable(time);
                engaged_at_ = time;
            } else if (command.request == Request::resume) {
                engage();
                engaged_at_ = time;
            }
            update_state();
        }
    }
    if (requests != 0) {
        update_state();
    }
}

void ControlLoop::raise_drive_fault() noexcept {
    // Drives repeat it; a flag that is raised again after `safety.hold_time` could not be cleared any more.
    constexpr std::uint32_t flag = TAUTSCOPE_FLAG_DRIVE_FAULT;
    TautscopeSupervision now{};
    if (state_ != OperatingState::disabled && tautscope_loop_supervision(loop_.handle(), &now) == TAUTSCOPE_RESULT_OK &&
        ((now.flags >> flag) & 1U) == 0) {
        tautscope_loop_raise_flag(loop_.handle(), flag);
    }
}

void ControlLoop::enable(double time) noexcept {
    if (!is_measured(time)) {
        goal_ = OperatingState::disabled;
        is_unmeasured_ = true;
        return;
    }
    for (std::size_t i = 0; i < command_.size() && is_finite(command_); ++i) {
        if (std::abs(measured_[i] - command_[i]) > start_tolerance_[i]) {
            goal_ = OperatingState::fault;
            return;
        }
    }
    if (!is_finite(command_)) {
        // The loop passes its first reference: the command begins where the drives are.
        used_ = measured_;
    }
    engage();
}

void ControlLoop::engage() noexcept {
    tautscope_loop_engage(loop_.handle());
    is_clutching_ = true;
}

void ControlLoop::update_state() noexcept {
    TautscopeSupervision now{};
    if (tautscope_loop_supervision(loop_.handle(), &now) != TAUTSCOPE_RESULT_OK) {
        now.reaction = TAUTSCOPE_REACTION_DISABLE;
    }
    state_ = goal_ == OperatingState::disabled ? goal_ : std::max(goal_, state_by_reaction[now.reaction]);
    published_state_.store(state_, std::memory_order_relaxed);
    reaction_.store(now.reaction, std::memory_order_relaxed);
    flags_.store(now.flags, std::memory_order_relaxed);
    latched_.store(now.latched, std::memory_order_relaxed);
    published_misplaced_.store(goal_ == OperatingState::fault, std::memory_order_relaxed);
    published_unmeasured_.store(is_unmeasured_, std::memory_order_relaxed);
}

} // namespace tautscope_control
