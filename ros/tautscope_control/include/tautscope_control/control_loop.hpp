/* The loop with operating states, requests of other threads, and detection in a thread of its own, without ROS. */

#ifndef TAUTSCOPE_CONTROL__CONTROL_LOOP_HPP_
#define TAUTSCOPE_CONTROL__CONTROL_LOOP_HPP_

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <tautscope.hpp>

#include "tautscope_control/detection_exchange.hpp"
#include "tautscope_control/operating_state.hpp"

namespace tautscope_control {

using tautscope::Numbers;
using tautscope::Values;

/// The name in a message.
inline const char *name(OperatingState state) noexcept { return operating_state_names[static_cast<std::size_t>(state)]; }

/// The request of a CRTK `state_command`; none for any other text.
std::optional<Request> parse_state_command(std::string_view text) noexcept;

/// Result of a control tick.
struct Tick {
    /// (n,) [m or rad]; NaN before it was enabled.
    Values command;
    /// Whether the command is to be sent to the drives.
    bool is_sent;
    OperatingState state;
};

/// State for other threads; each member is from one of the last ticks.
struct Status {
    OperatingState state;
    TautscopeReaction reaction;
    /// A bit `1 << TautscopeFlag` each.
    std::uint32_t flags;
    /// Flags raised since the last acknowledgement.
    std::uint32_t latched;
    /// Whether enabling was refused: the drives were not where the last command was.
    bool is_misplaced;
    /// Whether enabling was refused: it is not known where the drives are.
    bool is_unmeasured;
};

/// The names of flags, separated by commas.
std::string flag_names(std::uint32_t flags);

/// Control loop of any robot: reference in, command out, in operating states.
///
/// All functions are for the control thread, but for `post`, `set_compensation` and `status`. None but the constructor allocates,
/// blocks or reads a clock. Times are seconds on one clock, the same for references, ticks and images.
class ControlLoop {
public:
    /// From a configuration, whose missing keys have their defaults. Throws `tautscope::Error`.
    explicit ControlLoop(const std::string &toml);

    /// Names of the degrees of freedom.
    const std::vector<std::string> &dofs() const noexcept { return dofs_; }

    /// Whether images measure the tip; with `[[dof]]` what is offered does.
    bool has_bands() const noexcept { return has_bands_; }

    /// The control period [s].
    double period() const noexcept { return period_; }

    /// Position of the drives (n,) [m or rad] at `time` [s], where the command begins; without one of the last 0.1 s `enable` is
    /// refused, and later their silence is a drive fault. Ignored unless n numbers are finite, and then false.
    bool set_measured(Numbers position, double time) noexcept;

    /// The newest reference (n,) [m or rad], made at `made_at` [s], NaN if that is not known; ignored likewise, and then false.
    bool set_reference(Numbers position, double made_at) noexcept;

    /// One control tick at `time` [s]: applies requests, then steps the loop.
    Tick step(double time) noexcept;

    /// After the command of a tick has been sent: hands predictions to the detection, and results and measurements to the loop.
    void exchange() noexcept;

    /// Requests an operation for the next tick.
    void post(Request request) noexcept;

    /// Share of the compensation from the next tick on, 0 to 1. Returns false for any other number, and changes nothing.
    bool set_compensation(double share) noexcept;

    Status status() const noexcept;

    /// The newest reference that went into the loop (n,) [m or rad]; NaN before the first.
    const Values &reference() const noexcept { return used_; }

    /// For the thread that detects, or that receives measurements.
    DetectionExchange &detection() noexcept { return exchange_; }

    /// The loop itself, for features from a detector of your own.
    tautscope::Loop &loop() noexcept { return loop_; }

private:
    void apply_requests(double time) noexcept;
    void enable(double time) noexcept;
    void raise_drive_fault() noexcept;
    bool is_measured(double time) const noexcept;
    void engage() noexcept;
    void update_state() noexcept;
    bool is_finite(Numbers values) const noexcept;

    tautscope::Loop loop_;
    std::vector<std::string> dofs_;
    bool has_bands_;
    /// Largest distance of the drives from the last command when they are enabled again.
    Values start_tolerance_;
    DetectionExchange exchange_;
    double period_;
    Values measured_, reference_, used_, command_;
    double measured_at_, made_at_;
    /// When motion was last enabled or resumed [s].
    double engaged_at_;
    bool has_new_reference_ = false;
    /// The next new reference after a command is where the motion begins, wherever it is.
    bool is_clutching_ = false;
    /// The state that was asked for; `fault` if the drives were elsewhere when they should have been enabled.
    OperatingState goal_ = OperatingState::disabled;
    bool is_unmeasured_ = false;
    /// The state, which the supervisor may require to be a later one.
    OperatingState state_ = OperatingState::disabled;
    double share_ = 1.0;
    std::atomic<std::uint32_t> requests_{0};
    std::atomic<double> wanted_share_{1.0};
    std::atomic<OperatingState> published_state_{OperatingState::disabled};
    std::atomic<TautscopeReaction> reaction_{TAUTSCOPE_REACTION_NONE};
    std::atomic<std::uint32_t> flags_{0}, latched_{0};
    std::atomic<bool> published_misplaced_{false}, published_unmeasured_{false};
};

} // namespace tautscope_control

#endif
