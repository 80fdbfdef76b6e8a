/* Detection of the newest image in a thread of its own, without ROS. */

#ifndef TAUTSCOPE_CONTROL__DETECTION_WORKER_HPP_
#define TAUTSCOPE_CONTROL__DETECTION_WORKER_HPP_

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <tautscope.hpp>

#include "tautscope_control/detection_exchange.hpp"

namespace tautscope_control {

/// An image, and what keeps its pixels in memory.
struct OwnedImage {
    TautscopeImage view;
    /// Time of capture on the clock of the ticks [s].
    double captured_at;
    std::shared_ptr<const void> owner;
};

/// Images by what became of them.
struct ImageCounts {
    std::uint64_t arrived, replaced, used, refused;
};

/// Thread that detects the bands in the newest image, with the prediction of the control thread.
///
/// An image that arrives during a detection replaces the one that waits.
class DetectionWorker {
public:
    /// Called in the detection thread with the report on an image.
    using OnReport = std::function<void(const TautscopeReport &)>;
    /// Called in the detection thread when an image cannot be used.
    using OnError = std::function<void(const std::string &)>;

    /// From the configuration. `exchange` must outlive the worker. Throws `tautscope::Error`.
    DetectionWorker(const std::string &toml, DetectionExchange &exchange, OnReport on_report, OnError on_error);

    ~DetectionWorker();

    DetectionWorker(const DetectionWorker &) = delete;
    DetectionWorker &operator=(const DetectionWorker &) = delete;

    /// The newest image, from any thread.
    void offer(OwnedImage image);

    /// Ends the thread, after the detection that runs: no callback is called any more.
    void end();

    ImageCounts counts() const noexcept;

private:
    void run();
    void detect(const OwnedImage &image);
    /// Waits until a condition holds. Returns false if the thread has to end.
    template <class Condition> bool wait_for(Condition condition) const;

    tautscope::Detector detector_;
    DetectionExchange &exchange_;
    OnReport on_report_;
    OnError on_error_;
    std::mutex mutex_;
    std::condition_variable has_image_;
    std::optional<OwnedImage> newest_;
    std::atomic<bool> is_ending_{false};
    std::atomic<std::uint64_t> arrived_{0}, replaced_{0}, used_{0}, refused_{0};
    std::thread thread_;
};

} // namespace tautscope_control

#endif
