#include <math.h>
#include <stdio.h>
#include <tautscope.h>

static const char robot[] = "[[dof]]\n"
                            "name = \"bend_x\"\n"
                            "width_limit = 1.2\n" /* the largest slack that is compensated [rad] */
                            "[[dof]]\n"
                            "name = \"bend_y\"\n"
                            "width_limit = 1.2\n";

/* What the sensor measures in a state of the tip: here the position of a point [mm]. */
static int predict(void *context, const double *q, double *z, double *jacobian) {
    (void)context;
    (void)jacobian; /* left as it is: derivatives by differences */
    z[0] = 40 * sin(q[0]);
    z[1] = 40 * cos(q[0]) * sin(q[1]);
    return 1;
}

int main(void) {
    const double covariance[4] = {0.1, 0.0, 0.0, 0.1}; /* mm^2 */
    double tip[2] = {0.0, 0.0};
    TautscopeLoop *loop = NULL;
    TautscopeResult result = tautscope_loop_create((const uint8_t *)robot, sizeof robot - 1, &loop);
    for (int tick = 0; tick < 12000 && result == TAUTSCOPE_RESULT_OK; ++tick) { /* in use: every control period */
        const double time = tick * 0.005;
        const double reference[2] = {0.8 * sin(1.1 * time), 0.8 * sin(0.7 * time)};
        double command[2];
        result = tautscope_loop_step(loop, 2, reference, NAN, time, command);
        for (int dof = 0; dof < 2; ++dof) { /* in use: your motors; here a slack of 0.6 rad */
            tip[dof] = fmin(fmax(tip[dof], command[dof] - 0.3), command[dof] + 0.3);
        }
        if (result == TAUTSCOPE_RESULT_OK && tick % 5 == 0) { /* in use: for every measurement */
            double values[2];
            predict(NULL, tip, values, NULL);
            const TautscopeMeasurement measurement = {
                .values = values, .count = 2, .covariance = covariance, .captured_at = time};
            result = tautscope_loop_on_measurement(loop, &measurement, predict, NULL, NULL);
        }
    }
    TautscopeHysteresis found;
    if (result != TAUTSCOPE_RESULT_OK || tautscope_loop_hysteresis(loop, &found) != TAUTSCOPE_RESULT_OK) {
        fprintf(stderr, "%s\n", tautscope_error_message());
        return 1;
    }
    printf("slack of %.2f and %.2f rad found\n", 2 * found.half_width[0], 2 * found.half_width[1]);
    tautscope_loop_destroy(loop);
    return 0;
}
