/* A robot with [[dof]] from record.py through the control loop: its commands and estimates have the bits that they had in Python,
   the slack is found, nothing is allocated, and measurements come from another thread. */

#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include <tautscope_control/control_loop.hpp>

#include "allocations.hpp"
#include "expect.hpp"
#include "recording.hpp"

using namespace tautscope_control;

namespace {

using Two = std::array<double, 2>;

struct TipTick {
    double time, made_at;
    Two reference;
    double event;
    Two command;
};

struct TipUpdate {
    double tick, captured_at;
    Two values;
    double status, reaction, flags;
    Two state_estimate, delta_minus, delta_plus;
    std::array<double, 5> unused;
};

static_assert(sizeof(TipTick) == 7 * sizeof(double) && sizeof(TipUpdate) == 18 * sizeof(double));

bool has_bits(const double *values, const Two &expected) {
    const double own[] = {values[0], values[1]};
    return is_same(own, expected);
}

bool has_report(ControlLoop &control) {
    TautscopeTipReport report;
    return control.detection().reports.pop(report);
}

Measurement measurement(const TipUpdate &update) { return {Values(update.values), update.captured_at, 0}; }

void commands_and_estimates_are_those_of_python(const std::string &recording) {
    ControlLoop control(tautscope::read_file(recording + ".toml"));
    EXPECT(!control.has_bands() && control.dofs() == (std::vector<std::string>{"bend", "slide"}));
    const auto ticks = read_rows<TipTick>(recording + ".ticks");
    const auto updates = read_rows<TipUpdate>(recording + ".images");
    control.post(Request::enable);
    std::size_t wrong = 0, update = 0;
    const unsigned long allocated = allocations::count;
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
        const TipTick &now = ticks[tick];
        if (now.event != 0.0) {
            control.set_compensation(now.event == 4.0 ? 0.5 : 1.0);
        }
        wrong += !control.set_measured(ticks[0].reference, now.time) || !control.set_reference(now.reference, now.made_at);
        wrong += !has_bits(control.step(now.time).command.data(), now.command);
        if (update < updates.size() && static_cast<std::size_t>(updates[update].tick) == tick) {
            const TipUpdate &expected = updates[update++];
            wrong += !control.detection().measurements.push(measurement(expected));
            control.exchange();
            TautscopeTipReport report{};
            wrong += !control.detection().reports.pop(report) || report.status != static_cast<TautscopeStatus>(expected.status) ||
                     !has_bits(report.state_estimate, expected.state_estimate) ||
                     !has_bits(report.delta_minus, expected.delta_minus) ||
                     !has_bits(report.delta_plus, expected.delta_plus);
        }
    }
    const unsigned long in_loop = allocations::count - allocated;
    const auto found = control.loop().hysteresis();
    std::printf("%zu ticks, %zu measurements, %zu unlike Python, slack of %.3f rad and %.2f mm found\n", ticks.size(), update, wrong,
                2 * found.half_width[0], 2e3 * found.half_width[1]);
    EXPECT(wrong == 0 && !updates.empty() && update == updates.size() && in_loop == 0);
    EXPECT(std::abs(2 * found.half_width[0] - 0.6) < 0.02 && std::abs(2 * found.half_width[1] - 8e-3) < 0.2e-3);
}

void measurements_come_from_another_thread(const std::string &recording) {
    ControlLoop control(tautscope::read_file(recording + ".toml"));
    const auto ticks = read_rows<TipTick>(recording + ".ticks");
    const auto updates = read_rows<TipUpdate>(recording + ".images");
    std::atomic<std::size_t> tick{0}, seen{0};
    std::size_t used = 0, offered = 0;
    std::thread sensor([&] {
        for (const TipUpdate &update : updates) {
            while (static_cast<double>(tick) < update.tick) {
                std::this_thread::yield();
            }
            for (TautscopeTipReport report; control.detection().reports.pop(report);) {
                ++used;
            }
            offered += control.detection().measurements.push(measurement(update));
            ++seen;
        }
    });
    // On a busy computer the loop would end before the sensor's thread had its turn.
    const auto is_behind = [&] {
        const std::size_t next = seen;
        return next < updates.size() && updates[next].tick + 100.0 < static_cast<double>(tick);
    };
    control.post(Request::enable);
    for (const TipTick &now : ticks) {
        control.set_measured(ticks[0].reference, now.time);
        control.set_reference(now.reference, now.made_at);
        control.step(now.time);
        control.exchange();
        ++tick;
        while (is_behind()) {
            std::this_thread::yield();
        }
    }
    sensor.join();
    control.exchange();
    for (TautscopeTipReport report; control.detection().reports.pop(report);) {
        ++used;
    }
    std::printf("%zu measurements offered, %zu reports\n", offered, used);
    EXPECT(used > 64 && used <= offered && offered <= updates.size());
}

void wrong_measurements_change_nothing(const std::string &recording) {
    ControlLoop control(tautscope::read_file(recording + ".toml"));
    const Measurement good{Values(Numbers{0.1, 1e-3}), 0.0, 0};
    EXPECT(control.detection().measurements.push(good));
    control.exchange();
    // Nothing controls.
    EXPECT(!has_report(control) && control.detection().refused == 1);
    control.set_measured(good.values, 0.0);
    control.post(Request::enable);
    EXPECT(!control.set_reference(Numbers{0.1}, 0.0) && !control.set_reference(Numbers{0.1, std::nan("")}, 0.0));
    EXPECT(control.set_reference(Numbers{0.1, 1e-3}, 0.0) && control.step(0.0).is_sent);
    EXPECT(control.detection().measurements.push({Values(Numbers{0.1}), 0.0, 0}));
    EXPECT(control.detection().measurements.push({good.values, 0.0, 4}));
    control.exchange();
    EXPECT(!has_report(control) && control.detection().refused == 3);
    EXPECT(control.detection().measurements.push(good));
    control.exchange();
    EXPECT(has_report(control) && !has_report(control));
    // One tolerance in rad, one in m.
    control.post(Request::disable);
    control.step(0.005);
    control.set_measured(Numbers{0.14, 1e-3 + 0.9e-3}, 0.01);
    control.post(Request::enable);
    EXPECT(control.step(0.01).state == OperatingState::enabled);
    control.post(Request::disable);
    control.step(0.015);
    control.set_measured(Numbers{0.1, 1e-3 + 1.1e-3}, 0.02);
    control.post(Request::enable);
    EXPECT(control.step(0.02).state == OperatingState::fault);
    std::size_t waiting = 0;
    while (control.detection().measurements.push(good)) {
        ++waiting;
    }
    EXPECT(waiting == 64);
}

} // namespace

int main(int count, char **arguments) try {
    const std::string recording = count == 2 ? arguments[1] : "tip_best";
    commands_and_estimates_are_those_of_python(recording);
    measurements_come_from_another_thread(recording);
    wrong_measurements_change_nothing(recording);
    std::printf("%d failures\n", failures);
    return failures > 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
