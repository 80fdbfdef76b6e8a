/* A real-time controller at the control rate: references and features from a recording of record.py, commands out.

   controller RECORDING [--real-time]

It prints how long ticks and image updates take, and fails unless every command and every estimate has the bits that it had in
Python, and nothing was allocated in the loop. With --real-time it waits for each period and also prints how late it woke. */

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <string>
#include <vector>

#include "allocations.hpp"
#include "recording.hpp"

namespace {

using Clock = std::chrono::steady_clock;

double microseconds(Clock::duration duration) { return std::chrono::duration<double, std::micro>(duration).count(); }

void apply(tautscope::Loop &loop, int event) {
    switch (event) {
    case 1:
        loop.engage();
        break;
    case 2:
        loop.acknowledge();
        break;
    case 3:
        loop.raise_flag(TAUTSCOPE_FLAG_DRIVE_FAULT);
        break;
    case 4:
        loop.set_compensation(0.5);
        break;
    case 5:
        loop.set_compensation(1.0);
        break;
    default:
        break;
    }
}

void print(const char *name, std::vector<double> &times) {
    if (times.empty()) {
        return;
    }
    std::sort(times.begin(), times.end());
    const auto quantile = [&](double share) { return times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))]; };
    std::printf("%s: median %.2f us, p99 %.2f us, p99.9 %.2f us, largest %.2f us\n", name, quantile(0.5), quantile(0.99),
                quantile(0.999), times.back());
    // Bins double: up to 1/4 us, 1/2 us, ...
    double upper = 0.25;
    for (std::size_t done = 0; done < times.size(); upper *= 2) {
        const auto end = std::upper_bound(times.begin(), times.end(), upper) - times.begin();
        if (static_cast<std::size_t>(end) > done) {
            std::printf("  up to %9.2f us: %zu\n", upper, static_cast<std::size_t>(end) - done);
        }
        done = static_cast<std::size_t>(end);
    }
}

int run(const std::string &recording, bool is_real_time) {
    tautscope::Loop loop(tautscope::read_file(recording + ".toml"));
    const auto ticks = read_rows<Tick>(recording + ".ticks");
    const auto images = read_rows<ImageUpdate>(recording + ".images");
    const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(loop.period()));
    std::vector<double> tick_times, update_times, lateness;
    tick_times.reserve(ticks.size());
    update_times.reserve(images.size());
    lateness.reserve(ticks.size());

    const unsigned long allocated = allocations::count;
    std::size_t wrong = 0, image = 0;
    auto next = Clock::now();
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
        if (is_real_time) {
            next += period;
            const auto since = next.time_since_epoch();
            const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
            const timespec until{static_cast<std::time_t>(seconds.count()),
                                 static_cast<long>(std::chrono::nanoseconds(since - seconds).count())};
            while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
            }
            lateness.push_back(microseconds(Clock::now() - next));
        }
        const Tick &now = ticks[tick];
        apply(loop, static_cast<int>(now.event));
        tautscope::Vector command;
        const auto start = Clock::now();
        const TautscopeResult result = loop.try_step(now.reference, now.time, command, now.made_at);
        tick_times.push_back(microseconds(Clock::now() - start));
        const double values[] = {command[0], command[1], command[2]};
        wrong += result != TAUTSCOPE_RESULT_OK || !is_same(values, now.command);
        // Here `command` goes to the drives.
        for (; image < images.size() && static_cast<std::size_t>(images[image].tick) == tick; ++image) {
            const auto begin = Clock::now();
            const TautscopeReport report = update(loop, images[image]);
            update_times.push_back(microseconds(Clock::now() - begin));
            wrong += !is_same(report, images[image]);
        }
    }
    const unsigned long in_loop = allocations::count - allocated;

    print("tick", tick_times);
    print("image update", update_times);
    print("late", lateness);
    std::printf("%zu ticks, %zu image updates, %zu unlike Python, ", ticks.size(), images.size(), wrong);
    if (ALLOCATIONS_ARE_COUNTED) {
        std::printf("%lu allocations\n", in_loop);
    } else {
        std::printf("allocations not counted\n");
    }
    return ticks.empty() || image != images.size() || wrong > 0 || in_loop > 0;
}

} // namespace

int main(int count, char **arguments) {
    const bool is_real_time = count == 3 && std::string(arguments[2]) == "--real-time";
    if (count != 2 && !is_real_time) {
        std::fprintf(stderr, "usage: controller RECORDING [--real-time]\n");
        return 2;
    }
    try {
        return run(arguments[1], is_real_time);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
