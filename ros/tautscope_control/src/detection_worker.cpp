#include "tautscope_control/detection_worker.hpp"

#include <chrono>
#include <exception>
#include <utility>

namespace tautscope_control {

namespace {

using Clock = std::chrono::steady_clock;

/// The control thread cannot wake this one without a system call.
constexpr std::chrono::microseconds poll_interval{500};
/// Without a tick for this long nothing controls, and the image is dropped.
constexpr std::chrono::milliseconds serve_timeout{100};

} // namespace

DetectionWorker::DetectionWorker(const std::string &toml, DetectionExchange &exchange, OnReport on_report, OnError on_error)
    : detector_(toml), exchange_(exchange), on_report_(std::move(on_report)), on_error_(std::move(on_error)),
      thread_([this] { run(); }) {}

DetectionWorker::~DetectionWorker() { end(); }

void DetectionWorker::end() {
    {
        const std::lock_guard lock(mutex_);
        is_ending_ = true;
    }
    has_image_.notify_one();
    if (thread_.joinable()) {
        thread_.join();
    }
}

void DetectionWorker::offer(OwnedImage image) {
    {
        const std::lock_guard lock(mutex_);
        ++arrived_;
        replaced_ += newest_.has_value() ? 1 : 0;
        newest_ = std::move(image);
    }
    has_image_.notify_one();
}

ImageCounts DetectionWorker::counts() const noexcept { return {arrived_, replaced_, used_, refused_}; }

void DetectionWorker::run() {
    while (true) {
        std::optional<OwnedImage> image;
        {
            std::unique_lock lock(mutex_);
            has_image_.wait(lock, [this] { return newest_.has_value() || is_ending_; });
            if (is_ending_) {
                return;
            }
            image.swap(newest_);
        }
        detect(*image);
    }
}

template <class Condition> bool DetectionWorker::wait_for(Condition condition) const {
    while (!condition()) {
        if (is_ending_) {
            return false;
        }
        std::this_thread::sleep_for(poll_interval);
    }
    return true;
}

void DetectionWorker::detect(const OwnedImage &image) {
    if (!exchange_.request(image.captured_at)) {
        ++refused_;
        return;
    }
    const auto until = Clock::now() + serve_timeout;
    const TautscopeStatePrediction *prediction = nullptr;
    const bool goes_on = wait_for([&] {
        prediction = exchange_.prediction();
        return prediction != nullptr || (Clock::now() > until && exchange_.withdraw());
    });
    if (!goes_on || prediction == nullptr) {
        ++refused_;
        return;
    }
    try {
        const TautscopeDetection detection = detector_.detect(image.view, *prediction);
        exchange_.submit(&detection);
    } catch (const std::exception &error) {
        exchange_.submit(nullptr);
        ++refused_;
        on_error_(error.what());
        return;
    }
    const TautscopeReport *report = nullptr;
    wait_for([&] {
        report = exchange_.take_report();
        return report != nullptr || exchange_.is_free();
    });
    if (report == nullptr) {
        ++refused_;
        return;
    }
    ++used_;
    on_report_(*report);
}

} // namespace tautscope_control
