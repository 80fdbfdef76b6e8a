/* Images of record.py: the same detections and estimates as in Python, with padded lines, in one thread and in two. */

#include <algorithm>
#include <cstdio>
#include <future>
#include <string>
#include <vector>

#include "../allocations.hpp"
#include "../recording.hpp"

int main(int count, char **arguments) try {
    const std::string recording = count == 2 ? arguments[1] : "frames";
    const std::string toml = tautscope::read_file(recording + ".toml");
    const auto ticks = read_rows<Tick>(recording + ".ticks");
    const auto images = read_rows<ImageUpdate>(recording + ".images");
    const std::string pixels = tautscope::read_file(recording + ".pixels");
    tautscope::Loop loop(toml), other(toml);
    tautscope::Detector detector(toml), background(toml);

    constexpr std::size_t width = 720, height = 576, line = 3 * width, stride = line + 64;
    std::vector<std::uint8_t> padded(stride * height, 255);
    TautscopeImage view{};
    view.data = padded.data();
    view.length = padded.size();
    view.stride = stride;
    view.width = width;
    view.height = height;
    view.format = TAUTSCOPE_PIXEL_FORMAT_BGR;

    std::size_t wrong = 0, image = 0;
    unsigned long allocated = 0;
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
        const Tick &now = ticks[tick];
        const tautscope::Vector command = loop.step(now.reference, now.time);
        const double values[] = {command[0], command[1], command[2]};
        wrong += !is_same(values, now.command);
        other.step(now.reference, now.time);
        for (; image < images.size() && static_cast<std::size_t>(images[image].tick) == tick; ++image) {
            const ImageUpdate &expected = images[image];
            for (std::size_t row = 0; row < height; ++row) {
                const char *from = pixels.data() + (image * height + row) * line;
                std::copy(from, from + line, padded.begin() + static_cast<std::ptrdiff_t>(row * stride));
            }
            const unsigned long before = allocations::count;
            const TautscopeReport report = loop.on_frame(detector, view, expected.captured_at);
            allocated += image > 0 ? allocations::count - before : 0;
            wrong += !is_same(report, expected);

            const TautscopeStatePrediction prediction = other.predict_state(expected.captured_at);
            auto detecting = std::async(std::launch::async, [&] { return background.detect(view, prediction); });
            const TautscopeDetection detection = detecting.get();
            wrong += !is_same(detection.features, expected.features);
            wrong += detection.checksum != static_cast<std::uint32_t>(expected.checksum);
            wrong += !is_same(other.on_detection(detection, expected.captured_at), expected);
            wrong += !is_same(detector.detect(view).features, expected.features_without_prediction);
        }
    }
    std::printf("%zu images, %zu unlike Python, %lu allocations after the first\n", image, wrong, allocated);
    return image == 0 || image != images.size() || wrong > 0 || allocated > 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
