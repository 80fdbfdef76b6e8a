#include "tautscope_control/detection_exchange.hpp"

namespace tautscope_control {

static_assert(std::atomic<std::uint8_t>::is_always_lock_free);

bool DetectionExchange::request(double captured_at) noexcept {
    if (phase_.load(std::memory_order_acquire) != Phase::free) {
        return false;
    }
    captured_at_ = captured_at;
    phase_.store(Phase::requested, std::memory_order_release);
    return true;
}

const TautscopeStatePrediction *DetectionExchange::prediction() const noexcept {
    return phase_.load(std::memory_order_acquire) == Phase::predicted ? &prediction_ : nullptr;
}

bool DetectionExchange::withdraw() noexcept {
    Phase expected = Phase::requested;
    return phase_.compare_exchange_strong(expected, Phase::free, std::memory_order_acq_rel);
}

void DetectionExchange::submit(const TautscopeDetection *detection) noexcept {
    if (detection == nullptr) {
        phase_.store(Phase::free, std::memory_order_release);
        return;
    }
    detection_ = *detection;
    phase_.store(Phase::detected, std::memory_order_release);
}

const TautscopeReport *DetectionExchange::take_report() noexcept {
    if (phase_.load(std::memory_order_acquire) != Phase::reported) {
        return nullptr;
    }
    // The control thread writes it again only after the next `submit`.
    phase_.store(Phase::free, std::memory_order_release);
    return &report_;
}

bool DetectionExchange::is_free() const noexcept { return phase_.load(std::memory_order_acquire) == Phase::free; }

bool DetectionExchange::serve(tautscope::Loop &loop, bool is_used) noexcept {
    bool is_updated = serve_image(loop, is_used);
    for (Measurement given; measurements.pop(given);) {
        const TautscopeMeasurement tip{given.values.data(), given.values.size(), nullptr, given.captured_at, given.sensor, 0};
        TautscopeTipReport report{};
        report.size = sizeof report;
        if (is_used && tautscope_loop_on_tip(loop.handle(), &tip, &report) == TAUTSCOPE_RESULT_OK) {
            reports.push(report);
            is_updated = true;
        } else {
            ++refused;
        }
    }
    return is_updated;
}

bool DetectionExchange::serve_image(tautscope::Loop &loop, bool is_used) noexcept {
    switch (phase_.load(std::memory_order_acquire)) {
    case Phase::requested: {
        if (!is_used) {
            return false; // The detection thread withdraws it.
        }
        // Taken before it is read: the request may be withdrawn at any time.
        Phase expected = Phase::requested;
        if (!phase_.compare_exchange_strong(expected, Phase::serving, std::memory_order_acq_rel)) {
            return false;
        }
        if (tautscope_loop_predict_state(loop.handle(), captured_at_, &prediction_) != TAUTSCOPE_RESULT_OK) {
            prediction_.is_known = 0;
        }
        phase_.store(Phase::predicted, std::memory_order_release);
        return false;
    }
    case Phase::detected: {
        report_ = TautscopeReport{};
        report_.size = sizeof report_;
        is_used = is_used && tautscope_loop_on_detection(loop.handle(), &detection_, captured_at_, &report_) == TAUTSCOPE_RESULT_OK;
        phase_.store(is_used ? Phase::reported : Phase::free, std::memory_order_release);
        return is_used;
    }
    default:
        return false;
    }
}

} // namespace tautscope_control
