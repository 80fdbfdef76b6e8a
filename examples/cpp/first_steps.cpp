#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>

#include <tautscope.hpp>

const char robot[] = R"(
[[dof]]
name = "bend"
width_limit = 1.2  # the largest slack that is compensated [rad]
)";

/// In use: your motor and what it moves; here a slack of 1 rad.
double moved(double tip, double command) { return std::clamp(tip, command - 0.5, command + 0.5); }

int main() try {
    tautscope::Axes loop(robot);
    double tip = 0.0, alone = 0.0, error = 0.0, error_alone = 0.0;
    for (int tick = 0; tick < 4000; ++tick) { // in use: every control period
        const double time = tick * loop.period();
        const double reference = std::sin(1.57 * time); // in use: from the operator [rad]
        tip = moved(tip, loop.step({reference}, time)[0]);
        alone = moved(alone, reference);
        error += std::abs(tip - reference) / 400;
        error_alone += std::abs(alone - reference) / 400;
        if (tick >= 1400 && tick % 8 == 0) { // in use: for every measurement of the tip
            loop.on_tip({tip}, time);
        }
        if (tick % 400 == 399) {
            std::printf("%2.0f s: slack of %.2f rad, tip off by %.2f rad, without tautscope by %.2f rad\n", time,
                        2 * loop.hysteresis().half_width[0], error, error_alone);
            error = error_alone = 0.0;
        }
    }
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
