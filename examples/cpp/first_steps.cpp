#include <cstdio>
#include <exception>
#include <vector>

#include <tautscope.hpp>

int main(int count, char **arguments) try {
    const std::string toml = tautscope::read_file(count == 2 ? arguments[1] : "config.toml");
    tautscope::Loop loop(toml);
    tautscope::Detector detector(toml);

    const std::vector<std::uint8_t> pixels(720 * 576 * 3, 90); // in use: the camera's memory
    TautscopeImage image{};
    image.data = pixels.data();
    image.length = pixels.size();
    image.stride = 720 * 3;
    image.width = 720;
    image.height = 576;
    image.format = TAUTSCOPE_PIXEL_FORMAT_BGR;

    for (int tick = 0; tick < 400; ++tick) { // in use: every control period
        const double time = tick * loop.period();
        const tautscope::Vector command = loop.step({0.025 + 0.01 * time, 0.0, 0.9}, time); // m, rad, rad
        if (tick % 40 == 0) {                                                                // in use: for every image
            const TautscopeReport report = loop.on_frame(detector, image, time);
            std::printf("%.2f s: insertion %.4f m, %s\n", time, command[0], tautscope_status_name(report.status));
            if (report.reaction >= TAUTSCOPE_REACTION_QUICK_STOP) {
                return 1; // in use: stop the drives
            }
        }
    }
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
