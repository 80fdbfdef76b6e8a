/* C++17 wrapper of tautscope.h: handles that destroy themselves, errors as exceptions, views instead of pointers. */

#ifndef TAUTSCOPE_HPP
#define TAUTSCOPE_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
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
#include <vector>

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

/// Numbers in the caller's memory, for the call they are an argument of: as `View`, of any count.
class Numbers {
public:
    Numbers() noexcept = default;

    template <std::size_t N> Numbers(const double (&values)[N]) noexcept : data_(values), size_(N) {}

    Numbers(std::initializer_list<double> values) noexcept : Numbers(values.begin(), values.size()) {}

    template <class Container,
              class = std::enable_if_t<
                  std::is_convertible_v<decltype(std::declval<const Container &>().data()), const double *>>>
    Numbers(const Container &values) : Numbers(values.data(), static_cast<std::size_t>(values.size())) {}

    const double *data() const noexcept { return data_; }

    std::size_t size() const noexcept { return size_; }

private:
    Numbers(const double *data, std::size_t size) noexcept : data_(data), size_(size) {}

    const double *data_ = nullptr;
    std::size_t size_ = 0;
};

/// A number per degree of freedom, up to 8, without allocation.
class Values {
public:
    Values() noexcept = default;

    explicit Values(std::size_t size, double value = 0.0) noexcept : size_(size) { values_.fill(value); }

    /// A copy of the first 8 numbers.
    explicit Values(Numbers numbers) noexcept : size_(std::min(numbers.size(), values_.size())) {
        std::copy_n(numbers.data(), size_, values_.begin());
    }

    double *data() noexcept { return values_.data(); }
    const double *data() const noexcept { return values_.data(); }
    std::size_t size() const noexcept { return size_; }
    double &operator[](std::size_t index) noexcept { return values_[index]; }
    double operator[](std::size_t index) const noexcept { return values_[index]; }
    const double *begin() const noexcept { return data(); }
    const double *end() const noexcept { return data() + size_; }

private:
    std::array<double, 8> values_{};
    std::size_t size_ = 0;
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
    std::string text;
    std::array<char, 4096> part;
    // Iterators would throw another exception for a folder.
    while (file.read(part.data(), part.size()) || file.gcount() > 0) {
        text.append(part.data(), static_cast<std::size_t>(file.gcount()));
    }
    if (!file.is_open() || file.bad()) {
        throw Error(TAUTSCOPE_RESULT_CONFIG, "File cannot be read: " + path);
    }
    return text;
}

namespace detail {

struct Destroy {
    void operator()(TautscopeLoop *loop) const noexcept { tautscope_loop_destroy(loop); }
    void operator()(TautscopeDetector *detector) const noexcept { tautscope_detector_destroy(detector); }
    void operator()(TautscopeCompensator *compensator) const noexcept { tautscope_compensator_destroy(compensator); }
    void operator()(TautscopeEstimator *estimator) const noexcept { tautscope_estimator_destroy(estimator); }
};

inline void check_version() {
    if (tautscope_abi_version() != TAUTSCOPE_ABI_VERSION) {
        throw Error(TAUTSCOPE_RESULT_INTERNAL,
                    "the library has version " + std::to_string(tautscope_abi_version()) +
                        " of the interface, the header " + std::to_string(TAUTSCOPE_ABI_VERSION));
    }
}

template <class Handle>
std::unique_ptr<Handle, Destroy> create(TautscopeResult (*function)(const std::uint8_t *, std::size_t, Handle **),
                                        std::string_view toml) {
    check_version();
    // An empty view has a null pointer.
    static const char nothing = 0;
    const char *text = toml.empty() ? &nothing : toml.data();
    Handle *handle = nullptr;
    check(function(reinterpret_cast<const std::uint8_t *>(text), toml.size(), &handle));
    return std::unique_ptr<Handle, Destroy>(handle);
}

/// As `create`, of an object of the settings of each degree of freedom.
template <class Handle, class Settings>
std::unique_ptr<Handle, Destroy> create_each(TautscopeResult (*function)(const Settings *, std::size_t, Handle **),
                                             const std::vector<Settings> &settings) {
    check_version();
    Handle *handle = nullptr;
    check(function(settings.data(), settings.size(), &handle));
    return std::unique_ptr<Handle, Destroy>(handle);
}

/// What both kinds of loops have.
class AnyLoop {
public:
    /// The number n of degrees of freedom.
    std::size_t dofs() const noexcept { return dofs_; }

    /// The control period [s].
    double period() const noexcept { return period_; }

    /// The state of the tip (n,) that the estimated slack predicts now.
    Values predicted_state() {
        Values state(dofs_);
        check(tautscope_loop_predicted_state(handle_.get(), dofs_, state.data()));
        return state;
    }

    /// The hysteresis estimated so far, in the first n entries.
    TautscopeHysteresis hysteresis() {
        TautscopeHysteresis hysteresis;
        check(tautscope_loop_hysteresis(handle_.get(), &hysteresis));
        return hysteresis;
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

protected:
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

    explicit AnyLoop(std::string_view toml) : handle_(create(&tautscope_loop_create, toml)) {
        check(tautscope_loop_size(handle_.get(), &dofs_, &period_));
    }

    template <class Report> static Report empty() noexcept {
        Report report{};
        report.size = sizeof report;
        return report;
    }

    std::unique_ptr<TautscopeLoop, Destroy> handle_;

private:
    std::size_t dofs_ = 0;
    double period_ = 0.0;
};

} // namespace detail

/// Finds the two marker bands in images; one thread at a time.
class Detector {
public:
    /// From a configuration; keys that it does not have have their defaults.
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

/// The loop of the article's instrument: reference in, command out; one thread at a time.
class Loop : public detail::AnyLoop {
public:
    /// From a configuration; keys that it does not have have their defaults.
    explicit Loop(std::string_view toml) : AnyLoop(toml) {}

    /// One control tick at `time` [s]: the command for a reference, made at `made_at` [s] if that is known.
    Vector step(Numbers reference, double time, double made_at = unknown) {
        Vector command;
        check(try_step(reference, time, command, made_at));
        return command;
    }

    /// As `step`, without exceptions: with any result but OK, `command` is the last one; it stays as it is for a reference
    /// of another size, or a loop that cannot be used any more.
    TautscopeResult try_step(Numbers reference, double time, Vector &command, double made_at = unknown) noexcept {
        // A loop with another number of `[[dof]]` would write as many.
        const std::size_t count = dofs() == command.size() ? reference.size() : command.size();
        return tautscope_loop_step(handle_.get(), count, reference.data(), made_at, time, command.data());
    }

    /// Image update with centroids u, v of both bands [px]; two NaN for a band that was not found.
    TautscopeReport on_features(View<4> features, double captured_at) {
        auto report = empty<TautscopeReport>();
        check(tautscope_loop_on_features(handle_.get(), features.data(), captured_at, &report));
        return report;
    }

    /// Image update without bands.
    TautscopeReport on_features(std::nullopt_t, double captured_at) {
        auto report = empty<TautscopeReport>();
        check(tautscope_loop_on_features(handle_.get(), nullptr, captured_at, &report));
        return report;
    }

    /// Image update: predicts, detects and updates, in this thread.
    TautscopeReport on_frame(Detector &detector, const TautscopeImage &image, double captured_at) {
        auto report = empty<TautscopeReport>();
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
        auto report = empty<TautscopeReport>();
        check(tautscope_loop_on_detection(handle_.get(), &detection, captured_at, &report));
        return report;
    }
};

/// The loop of 1 to 8 degrees of freedom whose tip any sensor measures; one thread at a time.
class Axes : public detail::AnyLoop {
public:
    /// From a configuration with `[[dof]]`; keys that it does not have have their defaults.
    explicit Axes(std::string_view toml) : AnyLoop(toml) {}

    /// One control tick at `time` [s]: the command (n,) for a reference (n,), made at `made_at` [s] if that is known.
    Values step(Numbers reference, double time, double made_at = unknown) {
        Values command(dofs());
        check(try_step(reference, time, command, made_at));
        return command;
    }

    /// As `step`, without exceptions: with any result but OK, `command` is the last one; it stays as it is for a reference
    /// of another size, or a loop that cannot be used any more.
    TautscopeResult try_step(Numbers reference, double time, Values &command, double made_at = unknown) noexcept {
        if (command.size() != dofs()) {
            command = Values(dofs(), unknown);
        }
        return tautscope_loop_step(handle_.get(), reference.size(), reference.data(), made_at, time, command.data());
    }

    /// Update with the tip measured degree by degree (n,); NaN for what was not measured. Without a covariance (n, n), row by
    /// row, `measurement.tip_deviation` is used.
    TautscopeTipReport on_tip(Numbers values, double captured_at, Numbers covariance = {}, std::uint32_t sensor = 0) {
        const TautscopeMeasurement measurement = measured(values, captured_at, covariance, sensor, 0);
        auto report = empty<TautscopeTipReport>();
        check(tautscope_loop_on_tip(handle_.get(), &measurement, &report));
        return report;
    }

    /// Update with up to 16 values (m,) and their covariance (m, m), row by row.
    ///
    /// `predict(const double *state, double *values)` writes what the sensor would measure in a state; with a third argument
    /// `double *jacobian` also dz/dq (m, n) row by row, else central differences are used. It may return false where the sensor
    /// sees nothing. `point` is 2 for u, v of points of an image, which are right or wrong together.
    template <class Predict>
    TautscopeTipReport on_measurement(Numbers values, double captured_at, Numbers covariance, Predict &&predict,
                                       std::uint32_t sensor = 0, std::uint32_t point = 1) {
        struct Call {
            std::remove_reference_t<Predict> *predict;
            std::exception_ptr error;
        } call{&predict, nullptr};
        // No exception may pass the library.
        const auto forward = [](void *context, const double *state, double *z, double *jacobian) -> int {
            Call &own = *static_cast<Call *>(context);
            if (own.error) {
                return 0;
            }
            try {
                return seen(*own.predict, state, z, jacobian);
            } catch (...) {
                own.error = std::current_exception();
                return 0;
            }
        };
        const TautscopeMeasurement measurement = measured(values, captured_at, covariance, sensor, point);
        auto report = empty<TautscopeTipReport>();
        const TautscopeResult result =
            tautscope_loop_on_measurement(handle_.get(), &measurement, forward, &call, &report);
        if (call.error) {
            std::rethrow_exception(call.error);
        }
        check(result);
        return report;
    }

private:
    static TautscopeMeasurement measured(Numbers values, double captured_at, Numbers covariance, std::uint32_t sensor,
                                         std::uint32_t point) {
        const std::size_t count = values.size();
        if (covariance.data() != nullptr && covariance.size() != count * count) {
            throw Error(TAUTSCOPE_RESULT_SIZE, "covariance: got " + std::to_string(covariance.size()) +
                                                   " numbers, expected " + std::to_string(count * count));
        }
        return {values.data(), count, covariance.data(), captured_at, sensor, point};
    }

    template <class Predict> static int seen(Predict &predict, const double *state, double *z, double *jacobian) {
        const auto call = [&] {
            if constexpr (std::is_invocable_v<Predict &, const double *, double *, double *>) {
                return predict(state, z, jacobian);
            } else {
                return predict(state, z);
            }
        };
        if constexpr (std::is_void_v<decltype(call())>) {
            call();
            return 1;
        } else {
            return call() ? 1 : 0;
        }
    }
};

/// The article's inverse of the plays of 1 to 8 degrees of freedom, each by itself, Eqs. (2)-(3).
class Compensator {
public:
    explicit Compensator(const std::vector<TautscopeCompensatorSettings> &settings)
        : handle_(detail::create_each(&tautscope_compensator_create, settings)), dofs_(settings.size()) {}

    /// The command (n,) for the next reference (n,).
    Values step(Numbers reference) {
        Values command(dofs_);
        check(tautscope_compensator_step(handle_.get(), reference.size(), reference.data(), command.data()));
        return command;
    }

    /// Changes the contact offsets (n,), input minus output; the command does not move.
    void set_offsets(Numbers delta_minus, Numbers delta_plus) {
        const bool is_each = delta_minus.size() == delta_plus.size();
        check(tautscope_compensator_set_offsets(handle_.get(), is_each ? delta_plus.size() : 0, delta_minus.data(),
                                                delta_plus.data()));
    }

private:
    std::unique_ptr<TautscopeCompensator, detail::Destroy> handle_;
    std::size_t dofs_;
};

/// The article's estimation of the contact offsets of 1 to 8 degrees of freedom, each by itself, Eqs. (4)-(6).
class Estimator {
public:
    explicit Estimator(const std::vector<TautscopeEstimatorSettings> &settings)
        : handle_(detail::create_each(&tautscope_estimator_create, settings)), minus_(settings.size()),
          plus_(settings.size()) {
        for (std::size_t dof = 0; dof < settings.size(); ++dof) {
            minus_[dof] = settings[dof].delta_minus;
            plus_[dof] = settings[dof].delta_plus;
        }
    }

    /// Updates the offsets from a command (n,) and the output (n,) measured at the same instant; NaN for what was not measured.
    void update(Numbers command, Numbers measured) {
        const bool is_each = command.size() == measured.size();
        check(tautscope_estimator_update(handle_.get(), is_each ? command.size() : 0, command.data(), measured.data(),
                                         minus_.data(), plus_.data()));
    }

    /// Negative contact offsets (n,) after the last update, before it the first ones, input minus output.
    const Values &delta_minus() const noexcept { return minus_; }

    /// Positive contact offsets (n,) after the last update, before it the first ones, input minus output.
    const Values &delta_plus() const noexcept { return plus_; }

private:
    std::unique_ptr<TautscopeEstimator, detail::Destroy> handle_;
    Values minus_, plus_;
};

} // namespace tautscope

#endif
