/* Every error of a caller has a code and a message, and leaves the loop as it was. */

#define TAUTSCOPE_WITH_OPENCV
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <tautscope.hpp>

namespace {

int failures = 0;

void expect(bool holds, const char *what, int line) {
    if (!holds) {
        std::printf("line %d: %s; last message: %s\n", line, what, tautscope_error_message());
        ++failures;
    }
}

#define EXPECT(condition) expect((condition), #condition, __LINE__)

/// The call has this result, and the message has this text.
#define FAILS(call, code, text)                                                                                        \
    do {                                                                                                               \
        EXPECT((call) == TAUTSCOPE_RESULT_##code);                                                                     \
        EXPECT(std::string(tautscope_error_message()).find(text) != std::string::npos);                               \
    } while (false)

template <class Function> TautscopeResult thrown(Function function) {
    try {
        function();
    } catch (const tautscope::Error &error) {
        return error.result();
    }
    return TAUTSCOPE_RESULT_OK;
}

std::string replaced(std::string text, const std::string &from, const std::string &to) {
    const auto found = text.find(from);
    EXPECT(found != std::string::npos);
    return found == std::string::npos ? text : text.replace(found, from.size(), to);
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TautscopeResult create(const std::string &toml) {
    return thrown([&] { tautscope::Loop loop(toml); });
}

void check_configuration(const std::string &toml) {
    FAILS(create(replaced(toml, "[control]", "[controls]")), CONFIG, "control");
    FAILS(create(replaced(toml, "gain_limit", "gain_limt")), CONFIG, "insertion.gain_limt: unknown key");
    FAILS(create(replaced(toml, "\nperiod = 0.001", "\nperiod = -1.0")), CONFIG, "control.period: got -1");
    FAILS(create(replaced(toml, "\nperiod = 0.001", "\nperiod = \"fast\"")), CONFIG,
          "control.period: got \"fast\", expected a number");
    const auto detector = [](const std::string &text) { return thrown([&] { tautscope::Detector created(text); }); };
    FAILS(detector(replaced(toml, "pixel_format = \"bgr\"", "pixel_format = \"hsv\"")), CONFIG, "camera.pixel_format");
    FAILS(detector(replaced(toml, "smoothing = ", "smoothing = 9")), CONFIG, "smoothing");
    // With `[[dof]]`, which no loop of bands has, it is of the camera that is given.
    const std::string robot = "[[dof]]\nname = \"a\"\nwidth_limit = 1\n";
    FAILS(detector(robot + "[camera]\nfxx = 1"), CONFIG, "camera.fxx: unknown key");
    tautscope::Detector small(robot + "[camera]\nwidth = 64\nheight = 48");
    std::vector<std::uint8_t> pixels(64 * 48 * 3, 90);
    const TautscopeImage image{pixels.data(), pixels.size(), 64 * 3, 64, 48, TAUTSCOPE_PIXEL_FORMAT_BGR};
    EXPECT(thrown([&] { small.detect(image); }) == TAUTSCOPE_RESULT_OK);
    TautscopeLoop *untouched = nullptr;
    FAILS(tautscope_loop_create(nullptr, 0, &untouched), NULL_POINTER, "toml");
    EXPECT(untouched == nullptr);
    FAILS(tautscope_loop_create(reinterpret_cast<const std::uint8_t *>(toml.data()), toml.size(), nullptr), NULL_POINTER,
          "handle");
}

void check_step(const std::string &toml) {
    tautscope::Loop loop(toml), undisturbed(toml);
    const double first[3] = {0.025, 0.0, 0.9}, second[3] = {0.0251, 0.01, 0.91};
    tautscope::Vector command{};
    EXPECT(loop.try_step({nan, 0.0, 0.9}, 0.0, command) == TAUTSCOPE_RESULT_SIGNAL);
    EXPECT(std::isnan(command[0]) && std::isnan(command[2]));
    const tautscope::Vector before = loop.step(first, 0.0);
    undisturbed.step(first, 0.0);
    for (const double wrong : {nan, infinity, -infinity}) {
        for (std::size_t dof = 0; dof < 3; ++dof) {
            tautscope::Vector reference{0.025, 0.0, 0.9};
            reference[dof] = wrong;
            command = {};
            FAILS(loop.try_step(reference, 0.001, command), SIGNAL, "reference");
            EXPECT(command == before);
        }
        FAILS(loop.try_step(first, wrong, command), SIGNAL, "time");
    }
    FAILS(loop.try_step(first, 0.001, command, infinity), SIGNAL, "made_at");
    FAILS(tautscope_loop_step(loop.handle(), 3, nullptr, nan, 0.001, command.data()), NULL_POINTER, "reference");
    FAILS(tautscope_loop_step(loop.handle(), 3, first, nan, 0.001, nullptr), NULL_POINTER, "command");
    FAILS(tautscope_loop_step(nullptr, 3, first, nan, 0.001, command.data()), NULL_POINTER, "handle");
    EXPECT(loop.step(second, 0.001) == undisturbed.step(second, 0.001));
    const std::vector<double> two{0.025, 0.0};
    EXPECT(thrown([&] { loop.step(two, 0.002); }) == TAUTSCOPE_RESULT_SIZE);
    FAILS(loop.try_step(two, 0.002, command), SIZE, "dofs: got 2, expected 3");
    tautscope::Loop of_four("[[dof]]\nname = \"a\"\nwidth_limit = 1\n[[dof]]\nname = \"b\"\nwidth_limit = 1\n"
                            "[[dof]]\nname = \"c\"\nwidth_limit = 1\n[[dof]]\nname = \"d\"\nwidth_limit = 1\n");
    FAILS(of_four.try_step({0.0, 0.0, 0.0, 0.0}, 0.0, command), SIZE, "dofs: got 3, expected 4");
    const std::vector<double> three{0.025, 0.0, 0.9};
    EXPECT(thrown([&] { loop.step(three, 0.002); }) == TAUTSCOPE_RESULT_OK);
}

void check_features(const std::string &toml) {
    tautscope::Loop loop(toml);
    loop.step({0.025, 0.0, 0.9}, 0.0);
    const double good[4] = {350.0, 260.0, 345.0, 190.0};
    TautscopeReport report{};
    for (const std::uint32_t size : {0U, 4U, static_cast<std::uint32_t>(sizeof report) - 1}) {
        report.size = size;
        FAILS(tautscope_loop_on_features(loop.handle(), good, 0.0, &report), SIZE, "report.size");
    }
    // Of a caller with more members, these are filled and the others are left.
    struct {
        TautscopeReport report;
        std::uint32_t later[4];
    } newer{{}, {7, 7, 7, 7}};
    newer.report.size = sizeof newer;
    EXPECT(tautscope_loop_on_features(loop.handle(), good, 0.0, &newer.report) == TAUTSCOPE_RESULT_OK);
    EXPECT(newer.report.size == sizeof newer && newer.later[0] == 7 && newer.later[3] == 7);
    EXPECT(tautscope_loop_on_features(loop.handle(), good, 0.0, nullptr) == TAUTSCOPE_RESULT_OK);
    EXPECT(tautscope_loop_on_features(loop.handle(), nullptr, 0.0, nullptr) == TAUTSCOPE_RESULT_OK);
    FAILS(tautscope_loop_on_features(loop.handle(), good, nan, nullptr), SIGNAL, "captured_at");
    for (const std::array<double, 4> &wrong : {std::array<double, 4>{nan, nan, nan, nan}, {nan, 260.0, 345.0, 190.0},
                                               {350.0, 260.0, 345.0, infinity}}) {
        FAILS(tautscope_loop_on_features(loop.handle(), wrong.data(), 0.0, nullptr), SIGNAL, "features");
    }
    FAILS(tautscope_loop_on_detection(loop.handle(), nullptr, 0.0, nullptr), NULL_POINTER, "detection");
    FAILS(tautscope_loop_predict_state(loop.handle(), 0.0, nullptr), NULL_POINTER, "prediction");
    EXPECT(loop.predict_state(0.0).is_known == 1 && loop.predict_state(-9.0).is_known == 0);
}

void check_image(const std::string &toml) {
    tautscope::Loop loop(toml);
    tautscope::Detector detector(toml);
    loop.step({0.025, 0.0, 0.9}, 0.0);
    std::vector<std::uint8_t> pixels(720 * 576 * 3, 90);
    cv::Mat mat;
    mat.rows = 576;
    mat.cols = 720;
    mat.data = pixels.data();
    mat.step[0] = 720 * 3;
    const TautscopeImage good = tautscope::view(mat, TAUTSCOPE_PIXEL_FORMAT_BGR);
    EXPECT(good.length == pixels.size() && good.stride == 2160 && good.width == 720 && good.height == 576);
    EXPECT(loop.on_frame(detector, good, 0.0).status == TAUTSCOPE_STATUS_NO_MARKERS);
    mat.channels = 4;
    EXPECT(thrown([&] { tautscope::view(mat, TAUTSCOPE_PIXEL_FORMAT_BGR); }) == TAUTSCOPE_RESULT_IMAGE);

    const auto detect = [&](const TautscopeImage &image) {
        return tautscope_loop_on_frame(loop.handle(), detector.handle(), &image, 0.0, nullptr);
    };
    const auto with = [&](auto change) {
        TautscopeImage image = good;
        change(image);
        return detect(image);
    };
    FAILS(with([](auto &image) { image.data = nullptr; }), NULL_POINTER, "image.data");
    FAILS(with([](auto &image) { image.width = 360; }), IMAGE, "360 x 576");
    FAILS(with([](auto &image) { image.height = 0; }), IMAGE, "720 x 0");
    FAILS(with([](auto &image) { image.format = TAUTSCOPE_PIXEL_FORMAT_RGB; }), IMAGE, "bgr");
    FAILS(with([](auto &image) { image.format = 77; }), IMAGE, "format 77");
    FAILS(with([](auto &image) { image.stride = 2159; }), IMAGE, "stride");
    FAILS(with([](auto &image) { image.length -= 1; }), IMAGE, "data");
    FAILS(with([](auto &image) { image.stride = static_cast<std::size_t>(-1); }), IMAGE, "data");
    FAILS(with([](auto &image) { image.length = static_cast<std::size_t>(-1); }), SIZE, "image.data");
    FAILS(tautscope_loop_on_frame(loop.handle(), nullptr, &good, 0.0, nullptr), NULL_POINTER, "handle");
    FAILS(tautscope_loop_on_frame(loop.handle(), detector.handle(), nullptr, 0.0, nullptr), NULL_POINTER, "image");
    TautscopeDetection detection;
    TautscopeStatePrediction prediction = loop.predict_state(0.0);
    prediction.std[1] = nan;
    FAILS(tautscope_detector_detect(detector.handle(), &good, &prediction, &detection), SIGNAL, "prediction");
    FAILS(tautscope_detector_detect(detector.handle(), &good, nullptr, nullptr), NULL_POINTER, "detection");
}

void check_supervision(const std::string &toml) {
    tautscope::Loop loop(toml);
    loop.step({0.025, 0.0, 0.9}, 0.0);
    FAILS(tautscope_loop_raise_flag(loop.handle(), 27), SIGNAL, "flag: got 27");
    FAILS(tautscope_loop_set_compensation(loop.handle(), 1.5), SIGNAL, "compensation: got 1.5");
    FAILS(tautscope_loop_set_compensation(loop.handle(), nan), SIGNAL, "compensation");
    FAILS(tautscope_loop_supervision(loop.handle(), nullptr), NULL_POINTER, "supervision");
    EXPECT(loop.supervision().reaction == TAUTSCOPE_REACTION_NONE);
    loop.raise_flag(TAUTSCOPE_FLAG_DRIVE_FAULT);
    const TautscopeSupervision stopped = loop.supervision();
    EXPECT(stopped.reaction == TAUTSCOPE_REACTION_QUICK_STOP);
    EXPECT(stopped.flags == 1U << TAUTSCOPE_FLAG_DRIVE_FAULT && stopped.latched == stopped.flags);
    const tautscope::Vector held = loop.step({0.026, 0.0, 0.9}, 0.001);
    EXPECT(held[0] == 0.025);
    loop.engage();
    EXPECT(loop.supervision().reaction == TAUTSCOPE_REACTION_NONE);
    EXPECT(loop.supervision().latched != 0);
    loop.acknowledge();
    EXPECT(loop.supervision().latched == 0);
    tautscope::Loop moved = std::move(loop);
    EXPECT(moved.period() == 0.001);
}

} // namespace

int main(int count, char **arguments) {
    const std::string toml = tautscope::read_file(count == 2 ? arguments[1] : "best.toml");
    check_configuration(toml);
    check_step(toml);
    check_features(toml);
    check_image(toml);
    check_supervision(toml);
    for (const char *path : {"not/a/file", "."}) {
        EXPECT(thrown([&] { tautscope::read_file(path); }) == TAUTSCOPE_RESULT_CONFIG);
    }
    std::printf("%d failures\n", failures);
    return failures > 0;
}
