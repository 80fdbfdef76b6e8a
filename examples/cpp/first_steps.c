#include <math.h>
#include <stdio.h>
#include <tautscope.h>

static int is_ok(TautscopeResult result) {
    if (result != TAUTSCOPE_RESULT_OK) {
        fprintf(stderr, "%s\n", tautscope_error_message());
    }
    return result == TAUTSCOPE_RESULT_OK;
}

int main(int count, char **arguments) {
    static uint8_t toml[65536];
    FILE *file = fopen(count == 2 ? arguments[1] : "config.toml", "rb");
    const size_t length = file ? fread(toml, 1, sizeof toml, file) : 0;
    TautscopeLoop *loop = NULL;
    double period = 0.0;
    if (!is_ok(tautscope_loop_create(toml, length, &loop)) || !is_ok(tautscope_loop_period(loop, &period))) {
        return 1;
    }
    for (int tick = 0; tick < 400; ++tick) { /* in use: every control period */
        const double time = tick * period;
        const double reference[3] = {0.025 + 0.01 * time, 0.0, 0.9}; /* m, rad, rad */
        double command[3];
        if (!is_ok(tautscope_loop_step(loop, reference, NAN, time, command))) {
            return 1; /* `command` is the last one */
        }
        if (tick % 40 == 0) { /* in use: for every image */
            const double features[4] = {350.0, 260.0, 345.0, 190.0}; /* u, v of band A, of band B in px */
            TautscopeReport report = {.size = sizeof report};
            if (!is_ok(tautscope_loop_on_features(loop, features, time, &report))) {
                return 1;
            }
            printf("%.2f s: %s, %s\n", time, tautscope_status_name(report.status),
                   tautscope_reaction_name(report.reaction));
        }
    }
    tautscope_loop_destroy(loop);
    return 0;
}
