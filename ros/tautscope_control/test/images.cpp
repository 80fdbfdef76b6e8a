/* Images of record.py through the exchange: estimates as in Python, and ticks that never wait for a detection. */

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <tautscope_control/control_loop.hpp>
#include <tautscope_control/detection_worker.hpp>

#include "allocations.hpp"
#include "recording.hpp"

using namespace tautscope_control;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t width = 720, height = 576, size = 3 * width * height;

struct Recorded {
    explicit Recorded(const std::string &path)
        : toml(tautscope::read_file(path + ".toml")), ticks(read_rows<::Tick>(path + ".ticks")),
          images(read_rows<ImageUpdate>(path + ".images")),
          pixels(std::make_shared<const std::string>(tautscope::read_file(path + ".pixels"))) {}

    OwnedImage image(std::size_t number) const {
        OwnedImage image{{}, images[number].captured_at, pixels};
        image.view.data = reinterpret_cast<const std::uint8_t *>(pixels->data()) + number * size;
        image.view.length = size;
        image.view.stride = 3 * width;
        image.view.width = width;
        image.view.height = height;
        image.view.format = TAUTSCOPE_PIXEL_FORMAT_BGR;
        return image;
    }

    std::string toml;
    std::vector<::Tick> ticks;
    std::vector<ImageUpdate> images;
    std::shared_ptr<const std::string> pixels;
};

/// Both sides of the exchange in one thread, in the order of Python.
int in_turn(const Recorded &recorded) {
    ControlLoop control(recorded.toml);
    tautscope::Detector detector(recorded.toml);
    control.post(Request::enable);
    std::size_t wrong = 0, image = 0;
    unsigned long allocated = 0;
    const auto exchanged = [&] {
        const unsigned long before = allocations::count;
        control.exchange();
        allocated += allocations::count - before;
    };
    for (std::size_t tick = 0; tick < recorded.ticks.size(); ++tick) {
        const ::Tick &now = recorded.ticks[tick];
        control.set_measured(recorded.ticks[0].reference, now.time);
        control.set_reference(now.reference, now.made_at);
        const Values command = control.step(now.time).command;
        const double values[] = {command[0], command[1], command[2]};
        wrong += !is_same(values, now.command);
        for (; image < recorded.images.size() && static_cast<std::size_t>(recorded.images[image].tick) == tick; ++image) {
            DetectionExchange &exchange = control.detection();
            const OwnedImage seen = recorded.image(image);
            wrong += !exchange.is_free() || !exchange.request(seen.captured_at) || exchange.request(seen.captured_at);
            wrong += exchange.prediction() != nullptr;
            exchanged();
            const TautscopeDetection detection = detector.detect(seen.view, *exchange.prediction());
            wrong += exchange.withdraw() || exchange.take_report() != nullptr;
            exchange.submit(&detection);
            exchanged();
            const TautscopeReport *report = exchange.take_report();
            wrong += report == nullptr || !is_same(*report, recorded.images[image]);
        }
    }
    std::printf("%zu images in turn, %zu unlike Python, %lu allocations\n", image, wrong, allocated);
    return image == 0 || wrong > 0 || allocated > 0;
}

/// Images in pairs, faster than they can be detected, in real time: ticks go on, and every image is accounted for.
int in_two_threads(const Recorded &recorded) {
    ControlLoop control(recorded.toml);
    std::atomic<std::uint64_t> reports{0}, found{0};
    double longest = 0.0;
    std::uint64_t offered = 0;
    ImageCounts counts{};
    {
        DetectionWorker worker(
            recorded.toml, control.detection(),
            [&](const TautscopeReport &report) {
                ++reports;
                found += report.status == TAUTSCOPE_STATUS_OK;
            },
            [](const std::string &error) { std::printf("%s\n", error.c_str()); });
        control.post(Request::enable);
        auto next = std::chrono::steady_clock::now();
        std::size_t image = 0;
        for (const ::Tick &now : recorded.ticks) {
            for (; image + 1 < recorded.images.size() && recorded.images[image + 1].captured_at <= now.time; image += 2) {
                worker.offer(recorded.image(image));
                worker.offer(recorded.image(image + 1));
                offered += 2;
            }
            const auto start = std::chrono::steady_clock::now();
            control.set_measured(recorded.ticks[0].reference, now.time);
            control.set_reference(now.reference, now.made_at);
            control.step(now.time);
            control.exchange();
            longest = std::max(longest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
            next += 5ms;
            std::this_thread::sleep_until(next);
        }
        // What has been offered goes through while ticks go on.
        for (int tick = 0; tick < 100; ++tick) {
            counts = worker.counts();
            if (counts.used + counts.replaced + counts.refused == offered) {
                break;
            }
            control.exchange();
            std::this_thread::sleep_for(5ms);
        }
        // A broken image is refused, and the next one is used.
        OwnedImage broken = recorded.image(image - 1);
        broken.view.width = 16;
        worker.offer(broken);
        std::this_thread::sleep_for(20ms);
        for (int tick = 0; tick < 100 && worker.counts().refused == counts.refused; ++tick) {
            control.exchange();
            std::this_thread::sleep_for(5ms);
        }
        counts = worker.counts();
    }
    std::printf("%llu images offered, %llu used, %llu replaced, %llu refused, both bands in %llu, longest tick %.3f ms\n",
                static_cast<unsigned long long>(offered), static_cast<unsigned long long>(counts.used),
                static_cast<unsigned long long>(counts.replaced), static_cast<unsigned long long>(counts.refused),
                static_cast<unsigned long long>(found.load()), 1e3 * longest);
    const bool is_complete = counts.arrived == offered + 1 &&
                             counts.arrived == counts.used + counts.replaced + counts.refused && counts.refused >= 1;
    return !is_complete || counts.used != reports || found == 0;
}

/// What was detected for an image from before the loop was disabled is not used when it is enabled again.
int disabled_meanwhile(const Recorded &recorded) {
    ControlLoop control(recorded.toml);
    tautscope::Detector detector(recorded.toml);
    DetectionExchange &exchange = control.detection();
    const auto tick = [&](double time) {
        control.set_measured(recorded.ticks.at(0).reference, time);
        control.step(time);
        control.exchange();
    };
    control.post(Request::enable);
    tick(0.0);
    exchange.request(0.0);
    tick(0.005);
    const TautscopeDetection detection = detector.detect(recorded.image(0).view, *exchange.prediction());
    exchange.submit(&detection);
    control.post(Request::disable);
    tick(0.01);
    const bool is_dropped = exchange.is_free() && exchange.take_report() == nullptr;
    exchange.request(0.01);
    tick(0.015);
    const bool is_waiting = exchange.prediction() == nullptr && exchange.withdraw();
    std::printf("disabled: dropped %d, not predicted %d\n", is_dropped, is_waiting);
    return !is_dropped || !is_waiting;
}

} // namespace

int main(int count, char **arguments) try {
    const Recorded recorded(count == 2 ? arguments[1] : "frames");
    return in_turn(recorded) | in_two_threads(recorded) | disabled_meanwhile(recorded);
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
