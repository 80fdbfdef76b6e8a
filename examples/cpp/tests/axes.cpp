/* A robot with [[dof]], recorded by record.py: the same commands and estimates as in Python, from the short and the whole
   configuration, without allocation; and what is refused. */

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "../allocations.hpp"
#include "../recording.hpp"

namespace {

struct Update {
    double tick, captured_at, kind;
    std::array<double, 3> values;
    double status, reaction, flags;
    std::array<double, 3> state_estimate, innovation, delta_minus, delta_plus, half_width;
};
static_assert(sizeof(Update) == 24 * sizeof(double));

const double covariance[] = {1e-3, 2e-4, 0.0, 2e-4, 1e-3, 0.0, 0.0, 0.0, 1e-3};

void predict(const double *q, double *z) {
    z[0] = 20 * q[0] + 0.5 * q[1];
    z[1] = q[1] + 0.25 * q[2] * q[2];
    z[2] = q[2] - 0.5 * q[1];
}

bool predict_with_jacobian(const double *q, double *z, double *jacobian) {
    const double rows[] = {20.0, 0.5, 0.0, 0.0, 1.0, 0.5 * q[2], 0.0, -0.5, 1.0};
    std::copy(std::begin(rows), std::end(rows), jacobian);
    predict(q, z);
    return true;
}

TautscopeTipReport update(tautscope::Axes &axes, const Update &now) {
    const auto kind = static_cast<std::uint32_t>(now.kind);
    switch (kind) {
    case 0:
        return axes.on_tip(now.values, now.captured_at);
    case 1:
        return axes.on_measurement(now.values, now.captured_at, covariance, predict, kind);
    default:
        return axes.on_measurement(now.values, now.captured_at, covariance, predict_with_jacobian, kind);
    }
}

void apply(tautscope::Axes &axes, int event) {
    switch (event) {
    case 1:
        return axes.engage();
    case 2:
        return axes.acknowledge();
    case 3:
        return axes.raise_flag(TAUTSCOPE_FLAG_DRIVE_FAULT);
    case 4:
        return axes.set_compensation(0.5);
    case 5:
        return axes.set_compensation(1.0);
    default:
        return;
    }
}

template <std::size_t M> bool starts_with(const double (&values)[M], const std::array<double, 3> &expected) {
    const double first[] = {values[0], values[1], values[2]};
    return is_same(first, expected);
}

bool is_expected(const TautscopeTipReport &report, const Update &expected, const TautscopeHysteresis &found) {
    return report.status == static_cast<TautscopeStatus>(expected.status) &&
           report.reaction == static_cast<TautscopeReaction>(expected.reaction) &&
           report.flags == static_cast<std::uint32_t>(expected.flags) &&
           starts_with(report.state_estimate, expected.state_estimate) &&
           starts_with(report.innovation, expected.innovation) &&
           starts_with(report.delta_minus, expected.delta_minus) &&
           starts_with(report.delta_plus, expected.delta_plus) && starts_with(found.half_width, expected.half_width);
}

int run(const std::string &recording, const std::string &configuration) {
    tautscope::Axes axes(tautscope::read_file(configuration));
    const auto ticks = read_rows<Tick>(recording + ".ticks");
    const auto updates = read_rows<Update>(recording + ".measurements");
    const unsigned long allocated = allocations::count;
    std::size_t wrong = 0, next = 0, used = 0;
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
        const Tick &now = ticks[tick];
        apply(axes, static_cast<int>(now.event));
        const tautscope::Values command = axes.step(now.reference, now.time, now.made_at);
        const double values[] = {command[0], command[1], command[2]};
        wrong += !is_same(values, now.command);
        for (; next < updates.size() && static_cast<std::size_t>(updates[next].tick) == tick; ++next) {
            const TautscopeTipReport report = update(axes, updates[next]);
            wrong += !is_expected(report, updates[next], axes.hysteresis());
            used += report.status == TAUTSCOPE_STATUS_OK;
        }
    }
    const unsigned long in_loop = allocations::count - allocated;
    std::printf("%zu ticks, %zu measurements, %zu used, %zu unlike Python, %lu allocations\n", ticks.size(), next, used,
                wrong, in_loop);
    return used < 1000 || next != updates.size() || wrong > 0 || in_loop > 0;
}

template <class Call> int refuses(Call call, const std::string &words) {
    try {
        call();
    } catch (const std::exception &error) {
        if (std::string(error.what()).find(words) != std::string::npos) {
            return 0;
        }
        std::printf("got \"%s\", expected \"%s\"\n", error.what(), words.c_str());
        return 1;
    }
    std::printf("nothing refused, expected \"%s\"\n", words.c_str());
    return 1;
}

int errors() {
    tautscope::Axes axes("[[dof]]\nname = \"a\"\nwidth_limit = 1\n[[dof]]\nname = \"b\"\nwidth_limit = 1\n");
    axes.step({0.1, 0.2}, 0.0);
    const auto fails = [](const double *, double *) { throw std::runtime_error("of the model"); };
    const double small[] = {1e-4, 0.0, 0.0, 1e-4};
    int wrong = refuses([&] { axes.step({0.1}, 0.1); }, "dofs: got 1, expected 2");
    wrong += refuses([&] { axes.on_tip({0.1}, 0.0); }, "measurement.count");
    wrong += refuses([&] { axes.on_tip({0.1, 0.2}, 0.0, {1.0}); }, "covariance: got 1 numbers, expected 4");
    wrong += refuses([&] { axes.on_measurement({0.1, 0.2}, 0.0, small, fails); }, "of the model");
    tautscope::Values command{tautscope::Numbers({0.3, 0.4})};
    wrong += axes.try_step({0.1}, 0.1, command) != TAUTSCOPE_RESULT_SIZE || command[0] != 0.3 || command[1] != 0.4;
    const tautscope::Values state = axes.predicted_state();
    wrong += state.size() != axes.dofs() || !(state[0] >= -1 && state[0] <= 1);
    return wrong;
}

/* The article's scheme of two axes is that of each by itself, and finds the width of each play. */
int article() {
    const auto compensators = [](std::size_t count) {
        return tautscope::Compensator(std::vector<TautscopeCompensatorSettings>(count, {5.0, 5.0, 0.0, 0.0, 0.0}));
    };
    const auto estimators = [](std::size_t count) {
        return tautscope::Estimator(std::vector<TautscopeEstimatorSettings>(count, {0.02, 0.4, 0.25, 0.0, 0.0}));
    };
    auto both = compensators(2);
    auto found = estimators(2);
    tautscope::Compensator alone[] = {compensators(1), compensators(1)};
    tautscope::Estimator each[] = {estimators(1), estimators(1)};
    const double half[] = {0.2, 0.3};
    double tip[] = {0.0, 0.0};
    int wrong = 0;
    for (int tick = 0; tick < 5000; ++tick) {
        const double reference[] = {std::sin(0.01 * tick), std::sin(0.007 * tick)};
        const tautscope::Values command = both.step(reference);
        for (std::size_t axis : {0, 1}) {
            tip[axis] = std::clamp(tip[axis], command[axis] - half[axis], command[axis] + half[axis]);
            wrong += alone[axis].step({reference[axis]})[0] != command[axis];
            each[axis].update({command[axis]}, {tip[axis]});
            alone[axis].set_offsets(each[axis].delta_minus(), each[axis].delta_plus());
        }
        found.update(command, tip);
        both.set_offsets(found.delta_minus(), found.delta_plus());
    }
    for (std::size_t axis : {0, 1}) {
        wrong += !(std::abs(found.delta_plus()[axis] - found.delta_minus()[axis] - 2 * half[axis]) < 0.05);
    }
    const tautscope::Estimator first({{0.02, 0.4, 0.25, -0.1, 0.3}});
    wrong += first.delta_minus()[0] != -0.1 || first.delta_plus()[0] != 0.3;
    wrong += refuses([&] { both.step({0.1}); }, "dofs: got 1, expected 2");
    wrong += refuses([&] { both.set_offsets({0.2, 0.2}, {0.1, 0.1}); }, "delta_minus");
    wrong += refuses([&] { found.update({0.1, 0.2}, {0.1}); }, "dofs");
    wrong += refuses([&] { compensators(9); }, "1 to 8");
    return wrong;
}

} // namespace

int main(int count, char **arguments) try {
    const std::string recording = count == 2 ? arguments[1] : "axes_best";
    return run(recording, recording + ".toml") + run(recording, recording + "-short.toml") + errors() + article();
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
