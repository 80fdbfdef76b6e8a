/* One image at a time between the control thread and the thread that detects, without locks. */

#ifndef TAUTSCOPE_CONTROL__DETECTION_EXCHANGE_HPP_
#define TAUTSCOPE_CONTROL__DETECTION_EXCHANGE_HPP_

#include <atomic>
#include <cstdint>

#include <tautscope.hpp>

namespace tautscope_control {

/// Exchange of one image's prediction, detection and report.
///
/// ```text
/// detection thread   request -> ........ -> prediction, detect, submit -> ....... -> report
/// control thread                serve                                     serve
/// ```
///
/// `phase_` is the thread whose turn it is; only that thread uses the rest, so that neither ever waits for the other.
class DetectionExchange {
public:
    /// Detection thread: asks for the prediction at a capture time [s]. Returns false while another image is under way.
    bool request(double captured_at) noexcept;

    /// Detection thread: the prediction, once the control thread has made it; else null.
    const TautscopeStatePrediction *prediction() const noexcept;

    /// Detection thread: withdraws a request that no tick has served. Returns false if one has.
    bool withdraw() noexcept;

    /// Detection thread: the result of a prediction; null if the image could not be used.
    void submit(const TautscopeDetection *detection) noexcept;

    /// Detection thread: the report on the result; null until the control thread has used it. Ends the exchange.
    const TautscopeReport *take_report() noexcept;

    /// Detection thread: whether no image is under way.
    bool is_free() const noexcept;

    /// Control thread: does what is its turn. Returns true if an image has updated the loop.
    bool serve(tautscope::Loop &loop) noexcept;

private:
    enum class Phase : std::uint8_t { free, requested, serving, predicted, detected, reported };

    std::atomic<Phase> phase_{Phase::free};
    double captured_at_ = 0.0;
    TautscopeStatePrediction prediction_{};
    TautscopeDetection detection_{};
    TautscopeReport report_{};
};

} // namespace tautscope_control

#endif
