/* C++17 wrapper of tautscope.h: handles that destroy themselves, errors as exceptions, views instead of pointers. */

#ifndef TAUTSCOPE_HPP
#define TAUTSCOPE_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "tautscope.h"

#ifdef TAUTSCOPE_WITH_OPENCV
#include <opencv2/core/mat.hpp>
#endif

namespace tautscope {

/// Insertion, rotation, bending [m, rad, rad].
using Vector = std::array<double, 3>;

/// A call that failed; `what` names the argument, the value and what it may be.
class Error : public std::runtime_error {
public:
    Error(TautscopeResult result, const std::string &message) : std::runtime_error(message), result_(result) {}

    TautscopeResult result() const noexcept { return result_; }

private:
    TautscopeResult result_;
};

/// Throws `Error` for any result but OK.
inline void check(TautscopeResult result) {
    if (result != TAUTSCOPE_RESULT_OK) {
        throw Error(result, tautscope_error_message());
    }
}

/// N numbers in the caller's memory: from an array, or anything with `data()` and `size()` (std::vector, std::span, Eigen).
template <std::size_t N> class View {
public:
    View(const double (&values)[N]) noexcept : data_(values) {}

    View(const std::array<double, N> &values) noexcept : data_(values.data()) {}

    /// For the call it is an argument of. Throws `Error` if there are not N numbers.
    View(std::initializer_list<double> values) : View(values.begin(), values.size()) {}

    /// Throws `Error` if there are not N numbers.
    template <class Container,
              class = std::enable_if_t<
                  std::is_convertible_v<decltype(std::declval<const Container &>().data()), const double *>>>
    View(const Container &values) : View(values.data(), static_cast<std::size_t>(values.size())) {}

    const double *data() const noexcept { return data_; }

private:
    View(const double *data, std::size_t size) : data_(data) {
        if (size != N) {
            throw Error(TAUTSCOPE_RESULT_SIZE,
                        "got " + std::to_string(size) + " numbers, expected " + std::to_string(N));
        }
    }

    const double *data_;
};

#ifdef TAUTSCOPE_WITH_OPENCV
/// An 8-bit cv::Mat as an image, without a copy; regions of interest too. Of NV12 and I420 the matrix has 3/2 of the rows.
inline TautscopeImage view(const cv::Mat &mat, TautscopePixelFormat format) {
    const bool is_planar = format == TAUTSCOPE_PIXEL_FORMAT_NV12 || format == TAUTSCOPE_PIXEL_FORMAT_I420;
    const bool is_packed = format == TAUTSCOPE_PIXEL_FORMAT_YUYV || format == TAUTSCOPE_PIXEL_FORMAT_UYVY;
    const bool has_unused = format == TAUTSCOPE_PIXEL_FORMAT_BGRA;
    const int channels = is_planar ? 1 : is_packed ? 2 : has_unused ? 4 : 3;
    if (mat.empty() || mat.dims != 2 || mat.type() != CV_8UC(channels)) {
        throw Error(TAUTSCOPE_RESULT_IMAGE,
                    "image: expected a matrix of type CV_8UC" + std::to_string(channels) + " that is not empty");
    }
    const auto rows = static_cast<std::size_t>(mat.rows);
    const auto columns = static_cast<std::size_t>(mat.cols);
    const std::size_t stride = mat.step[0];
    TautscopeImage image{};
    image.data = mat.data;
    image.length = stride * (rows - 1) + columns * mat.elemSize();
    image.stride = stride;
    image.width = static_cast<std::uint32_t>(columns);
    image.height = static_cast<std::uint32_t>(is_planar ? rows / 3 * 2 : rows);
    image.format = static_cast<std::uint32_t>(format);
    return image;
}
#endif

/// The text of a file. Throws `Error` if it cannot be read.
inline std::string read_file(const std::string &path) {
    std::ifstream file(path, std::ios::binary);
    std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    if (!file) {
        throw Error(TAUTSCOPE_RESULT_CONFIG, "File cannot be read: " + path);
    }
    return text;
}

namespace detail {

struct Destroy {
    void operator()(TautscopeLoop *loop) const noexcept { tautscope_loop_destroy(loop); }
    void operator()(TautscopeDetector *detector) const noexcept { tautscope_detector_destroy(detector); }
};

template <class Handle>
std::unique_ptr<Handle, Destroy> create(TautscopeResult (*function)(const std::uint8_t *, std::size_t, Handle **),
                                        std::string_view toml) {
    if (tautscope_abi_version() != TAUTSCOPE_ABI_VERSION) {
        throw Error(TAUTSCOPE_RESULT_INTERNAL,
                    "the library has version " + std::to_string(tautscope_abi_version()) +
                        " of the interface, the header " + std::to_string(TAUTSCOPE_ABI_VERSION));
    }
    // An empty view has a null pointer.
    static const char nothing = 0;
    const char *text = toml.empty() ? &nothing : toml.data();
    Handle *handle = nullptr;
    check(function(reinterpret_cast<const std::uint8_t *>(text), toml.size(), &handle));
    return std::unique_ptr<Handle, Destroy>(handle);
}

} // namespace detail

/// Finds the two marker bands in images; one thread at a time.
class Detector {
public:
    /// From the configuration with every key, as `tautscope config` prints it.
    explicit Detector(std::string_view toml) : handle_(detail::create(&tautscope_detector_create, toml)) {}

    /// Detects near a prediction, or in the whole workspace.
    TautscopeDetection detect(const TautscopeImage &image,
                              const std::optional<TautscopeStatePrediction> &prediction = std::nullopt) {
        TautscopeDetection detection;
        check(tautscope_detector_detect(handle_.get(), &image, prediction ? &*prediction : nullptr, &detection));
        return detection;
    }

    TautscopeDetector *handle() noexcept { return handle_.get(); }

private:
    std::unique_ptr<TautscopeDetector, detail::Destroy> handle_;
};

/// The loop: reference in, command out; one thread at a time.
class Loop {
public:
    /// From the configuration with every key, as `tautscope config` prints it.
    explicit Loop(std::string_view toml) : handle_(detail::create(&tautscope_loop_create, toml)) {}

    /// The control period [s].
    double period() {
        double period = 0.0;
        check(tautscope_loop_period(handle_.get(), &period));
        return period;
    }

    /// One control tick at `time` [s]: the command for a reference, made at `made_at` [s] if that is known.
    Vector step(View<3> reference, double time, double made_at = unknown) {
        Vector command;
        check(tautscope_loop_step(handle_.get(), reference.data(), made_at, time, command.data()));
        return command;
    }

    /// As `step`, without exceptions: with any result but OK, `command` is the last one.
    TautscopeResult try_step(View<3> reference, double time, Vector &command, double made_at = unknown) noexcept {
        return tautscope_loop_step(handle_.get(), reference.data(), made_at, time, command.data());
    }

    /// Image update with centroids u, v of both bands [px]; two NaN for a band that was not found.
    TautscopeReport on_features(View<4> features, double captured_at) {
        TautscopeReport report = empty_report();
        check(tautscope_loop_on_features(handle_.get(), features.data(), captured_at, &report));
        return report;
    }

    /// Image update without bands.
    TautscopeReport on_features(std::nullopt_t, double captured_at) {
        TautscopeReport report = empty_report();
        check(tautscope_loop_on_features(handle_.get(), nullptr, captured_at, &report));
        return report;
    }

    /// Image update: predicts, detects and updates, in this thread.
    TautscopeReport on_frame(Detector &detector, const TautscopeImage &image, double captured_at) {
        TautscopeReport report = empty_report();
        check(tautscope_loop_on_frame(handle_.get(), detector.handle(), &image, captured_at, &report));
        return report;
    }

    /// Where to detect in an image; first part of `on_frame`.
    TautscopeStatePrediction predict_state(double captured_at) {
        TautscopeStatePrediction prediction;
        check(tautscope_loop_predict_state(handle_.get(), captured_at, &prediction));
        return prediction;
    }

    /// Image update with the result of a `Detector`, which may run in another thread; last part of `on_frame`.
    TautscopeReport on_detection(const TautscopeDetection &detection, double captured_at) {
        TautscopeReport report = empty_report();
        check(tautscope_loop_on_detection(handle_.get(), &detection, captured_at, &report));
        return report;
    }

    /// Reaction and flags in force.
    TautscopeSupervision supervision() {
        TautscopeSupervision supervision;
        check(tautscope_loop_supervision(handle_.get(), &supervision));
        return supervision;
    }

    /// Resumes held motion, without a jump of the command.
    void engage() { check(tautscope_loop_engage(handle_.get())); }

    /// Acknowledges the warnings.
    void acknowledge() { check(tautscope_loop_acknowledge(handle_.get())); }

    /// Uses a share of the compensation, 0 to 1.
    void set_compensation(double share) { check(tautscope_loop_set_compensation(handle_.get(), share)); }

    /// Raises a flag that only the rig can detect.
    void raise_flag(TautscopeFlag flag) {
        check(tautscope_loop_raise_flag(handle_.get(), static_cast<std::uint32_t>(flag)));
    }

    TautscopeLoop *handle() noexcept { return handle_.get(); }

private:
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

    static TautscopeReport empty_report() noexcept {
        TautscopeReport report{};
        report.size = sizeof report;
        return report;
    }

    std::unique_ptr<TautscopeLoop, detail::Destroy> handle_;
};

} // namespace tautscope

#endif
