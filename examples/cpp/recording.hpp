/* A recording of record.py. */

#ifndef RECORDING_HPP
#define RECORDING_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include <tautscope.hpp>

struct Tick {
    double time, made_at;
    tautscope::Vector reference;
    double event;
    tautscope::Vector command;
};

struct ImageUpdate {
    double tick, captured_at;
    std::array<double, 4> features;
    double status, reaction, flags;
    tautscope::Vector state_estimate, delta_minus, delta_plus;
    std::array<double, 4> features_without_prediction;
    double checksum;
};

static_assert(sizeof(Tick) == 9 * sizeof(double) && sizeof(ImageUpdate) == 23 * sizeof(double));

template <class Row> std::vector<Row> read_rows(const std::string &path) {
    const std::string bytes = tautscope::read_file(path);
    std::vector<Row> rows(bytes.size() / sizeof(Row));
    std::memcpy(static_cast<void *>(rows.data()), bytes.data(), rows.size() * sizeof(Row));
    return rows;
}

/// The update of a loop by the features of a recorded image.
inline TautscopeReport update(tautscope::Loop &loop, const ImageUpdate &image) {
    const bool has_band = std::any_of(image.features.begin(), image.features.end(), [](double v) { return !std::isnan(v); });
    return has_band ? loop.on_features(image.features, image.captured_at)
                    : loop.on_features(std::nullopt, image.captured_at);
}

/// Whether all numbers have the same bits; every NaN is the same.
template <std::size_t N> bool is_same(const double (&values)[N], const std::array<double, N> &expected) {
    for (std::size_t i = 0; i < N; ++i) {
        if (!(std::isnan(values[i]) && std::isnan(expected[i])) &&
            std::memcmp(&values[i], &expected[i], sizeof(double)) != 0) {
            return false;
        }
    }
    return true;
}

/// Whether an image update has the result that Python had.
inline bool is_same(const TautscopeReport &report, const ImageUpdate &expected) {
    return report.status == static_cast<TautscopeStatus>(expected.status) &&
           report.reaction == static_cast<TautscopeReaction>(expected.reaction) &&
           report.flags == static_cast<std::uint32_t>(expected.flags) &&
           is_same(report.state_estimate, expected.state_estimate) &&
           is_same(report.delta_minus, expected.delta_minus) && is_same(report.delta_plus, expected.delta_plus);
}

#endif
