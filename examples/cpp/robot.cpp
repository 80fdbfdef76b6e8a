#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>

#include <tautscope.hpp>

const char robot[] = R"(
[[dof]]
name = "bend_x"
width_limit = 1.2  # the largest slack that is compensated [rad]
[[dof]]
name = "bend_y"
width_limit = 1.2
)";

int main() try {
    tautscope::Axes axes(robot);
    // What the sensor measures in a state of the tip: here the position of a point [mm].
    const auto predict = [](const double *q, double *z) {
        z[0] = 40 * std::sin(q[0]);
        z[1] = 40 * std::cos(q[0]) * std::sin(q[1]);
    };
    double tip[2] = {0.0, 0.0}, without[2] = {0.0, 0.0}, error = 0.0, error_without = 0.0;
    for (int tick = 0; tick < 12000; ++tick) { // in use: every control period
        const double time = tick * axes.period();
        const double reference[2] = {0.8 * std::sin(1.1 * time), 0.8 * std::sin(0.7 * time)};
        const double half = tick < 6000 ? 0.0 : 1.0 / 12000; // mean of two motors over the second half
        const tautscope::Values command = axes.step(reference, time);
        for (int dof : {0, 1}) { // in use: your motors; here a slack of 0.6 rad
            tip[dof] = std::clamp(tip[dof], command[dof] - 0.3, command[dof] + 0.3);
            without[dof] = std::clamp(without[dof], reference[dof] - 0.3, reference[dof] + 0.3);
            error += half * std::abs(tip[dof] - reference[dof]);
            error_without += half * std::abs(without[dof] - reference[dof]);
        }
        if (tick % 5 == 0) { // in use: for every measurement
            double measured[2];
            predict(tip, measured);
            axes.on_measurement(measured, time, {0.1, 0.0, 0.0, 0.1}, predict); // covariance in mm^2
        }
        if (tick % 2400 == 2399) {
            const TautscopeHysteresis found = axes.hysteresis();
            std::printf("%2.0f s: slack of %.2f and %.2f rad found\n", time, 2 * found.half_width[0],
                        2 * found.half_width[1]);
        }
    }
    std::printf("tip off by %.3f rad on average, with tautscope by %.3f rad\n", error_without, error);
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
