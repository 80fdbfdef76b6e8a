#include <math.h>
#include <stdio.h>
#include <tautscope.h>

static const char robot[] = "[[dof]]\n"
                            "name = \"bend\"\n"
                            "width_limit = 1.2\n"; /* the largest slack that is compensated [rad] */

/* In use: your motor and what it moves; here a slack of 1 rad. */
static double moved(double tip, double command) { return fmin(fmax(tip, command - 0.5), command + 0.5); }

int main(void) {
    TautscopeLoop *loop = NULL;
    TautscopeResult result = tautscope_loop_create((const uint8_t *)robot, sizeof robot - 1, &loop);
    double command = 0.0, tip = 0.0, alone = 0.0, error = 0.0, error_alone = 0.0;
    for (int tick = 0; tick < 4000 && result == TAUTSCOPE_RESULT_OK; ++tick) { /* in use: every control period */
        const double time = tick * 0.005;
        const double reference = sin(1.57 * time); /* in use: from the operator [rad] */
        result = tautscope_loop_step(loop, 1, &reference, NAN, time, &command);
        tip = moved(tip, command);
        alone = moved(alone, reference);
        error += fabs(tip - reference) / 400;
        error_alone += fabs(alone - reference) / 400;
        if (result == TAUTSCOPE_RESULT_OK && tick >= 1400 && tick % 8 == 0) { /* in use: for every measurement of the tip */
            const TautscopeMeasurement measurement = {.values = &tip, .count = 1, .captured_at = time};
            result = tautscope_loop_on_tip(loop, &measurement, NULL);
        }
        if (result == TAUTSCOPE_RESULT_OK && tick % 400 == 399) {
            TautscopeHysteresis found;
            result = tautscope_loop_hysteresis(loop, &found);
            printf("%2.0f s: slack of %.2f rad, tip off by %.2f rad, without tautscope by %.2f rad\n", time,
                   2 * found.half_width[0], error, error_alone);
            error = error_alone = 0.0;
        }
    }
    if (result != TAUTSCOPE_RESULT_OK) {
        fprintf(stderr, "%s\n", tautscope_error_message());
    }
    tautscope_loop_destroy(loop);
    return result != TAUTSCOPE_RESULT_OK;
}
