/* Images and measurements between the control thread and another one, without locks. */

#ifndef TAUTSCOPE_CONTROL__DETECTION_EXCHANGE_HPP_
#define TAUTSCOPE_CONTROL__DETECTION_EXCHANGE_HPP_

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include <tautscope.hpp>

namespace tautscope_control {

/// Up to N items from the one thread that calls `push` to the one that calls `pop`. Both return whether they did.
template <class Item, std::size_t N> class Queue {
public:
    bool push(const Item &item) noexcept {
        const bool has_place = end_ - begin_ < N;
        if (has_place) {
            items_[end_ % N] = item;
            ++end_;
        }
        return has_place;
    }

    bool pop(Item &item) noexcept {
        const bool has_item = begin_ != end_;
        if (has_item) {
            item = items_[begin_ % N];
            ++begin_;
        }
        return has_item;
    }

private:
    std::array<Item, N> items_{};
    std::atomic<std::size_t> begin_{0}, end_{0};
};

/// The tip (n,) [m or rad] as a sensor, 0 to 3, of a robot with `[[dof]]` measured it; NaN for what was not measured.
struct Measurement {
    tautscope::Values values;
    double captured_at = 0.0;
    std::uint32_t sensor = 0;
};

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

    /// Control thread: does what is its turn, or drops it. Returns true if the loop was updated.
    bool serve(tautscope::Loop &loop, bool is_used = true) noexcept;

    /// Measurements from one thread, and the reports on them back to it.
    Queue<Measurement, 64> measurements;
    Queue<TautscopeTipReport, 64> reports;
    /// Measurements that the loop did not use.
    std::atomic<std::size_t> refused{0};

private:
    bool serve_image(tautscope::Loop &loop, bool is_used) noexcept;

    enum class Phase : std::uint8_t { free, requested, serving, predicted, detected, reported };

    std::atomic<Phase> phase_{Phase::free};
    double captured_at_ = 0.0;
    TautscopeStatePrediction prediction_{};
    TautscopeDetection detection_{};
    TautscopeReport report_{};
};

} // namespace tautscope_control

#endif
