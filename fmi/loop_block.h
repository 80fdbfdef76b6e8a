/* The loop as a block of a simulation tool: signals in, signals out, one call of each function per tick. Used by the
   S-function (matlab/sfun_tautscope.c) and by the FMI unit (fmi/loop.c).

   A signal that is not connected is 0 in most tools, so that 0 is the safe value of every input. */

#ifndef TAUTSCOPE_LOOP_BLOCK_H
#define TAUTSCOPE_LOOP_BLOCK_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tautscope.h>

#if TAUTSCOPE_ABI_VERSION != 1
#error "tautscope.h is of another version of the interface than this block"
#endif

enum { BLOCK_ENGAGE, BLOCK_ACKNOWLEDGE, BLOCK_DRIVE_FAULT, BLOCK_ACTIONS };

typedef struct {
    TautscopeLoop *loop;
    size_t dofs, measured; /* numbers of a reference and of a measurement */
    double period;
    int has_bands;
    TautscopeTipReport report; /* of the last measurement */
    TautscopeSupervision supervision;
    double command[8];
    int was_set[BLOCK_ACTIONS];
    double share;
} LoopBlock;

/* Before the first measurement no state is estimated, and the loop compensates the slack that it expects. */
static inline void block_rest(LoopBlock *block) {
    TautscopeHysteresis expected;
    (void)tautscope_loop_hysteresis(block->loop, &expected);
    for (size_t dof = 0; dof < block->dofs; ++dof) {
        block->report.state_estimate[dof] = NAN;
        block->report.delta_minus[dof] = expected.centre[dof] - expected.half_width[dof];
        block->report.delta_plus[dof] = expected.centre[dof] + expected.half_width[dof];
    }
}

/* Creates the loop from the file of a configuration; else 0, and `message` says why. */
static inline int block_create(LoopBlock *block, const char *file, char *message, size_t length) {
    TautscopeStatePrediction bands;
    FILE *stream = fopen(file, "rb");
    char *toml = NULL;
    long size = -1;
    memset(block, 0, sizeof *block);
    block->report.size = sizeof block->report;
    block->report.status = TAUTSCOPE_STATUS_NO_MARKERS;
    block->share = 1.0;
    if (stream && fseek(stream, 0, SEEK_END) == 0 && (size = ftell(stream)) >= 0 && fseek(stream, 0, SEEK_SET) == 0) {
        toml = (char *)malloc((size_t)size + 1);
    }
    if (!toml || fread(toml, 1, (size_t)size, stream) != (size_t)size) {
        snprintf(message, length, "File cannot be read: %s", file);
    } else if (tautscope_loop_create((const uint8_t *)toml, (size_t)size, &block->loop) != TAUTSCOPE_RESULT_OK) {
        snprintf(message, length, "%s: %s", file, tautscope_error_message());
    } else {
        (void)tautscope_loop_size(block->loop, &block->dofs, &block->period);
        /* With [[dof]] no bands can be predicted. */
        block->has_bands = tautscope_loop_predict_state(block->loop, 0.0, &bands) == TAUTSCOPE_RESULT_OK;
        block->measured = block->has_bands ? 4 : block->dofs;
        block_rest(block);
    }
    free(toml);
    if (stream) {
        fclose(stream);
    }
    return block->loop != NULL;
}

/* A control tick. `age` of the reference (s): 0 for one made now, NaN if not known. Each of `actions` (engage, acknowledge,
   drive fault) is done once when it becomes other than 0. `share` of the compensation is 0 to 1. */
static inline TautscopeResult block_tick(LoopBlock *block, const double *reference, double age, double time,
                                         const double *actions, double share) {
    TautscopeResult result = TAUTSCOPE_RESULT_OK;
    for (int action = 0; action < BLOCK_ACTIONS && result == TAUTSCOPE_RESULT_OK; ++action) {
        const int is_set = actions[action] != 0.0;
        if (is_set && !block->was_set[action]) {
            result = action == BLOCK_ENGAGE        ? tautscope_loop_engage(block->loop)
                     : action == BLOCK_ACKNOWLEDGE ? tautscope_loop_acknowledge(block->loop)
                                                   : tautscope_loop_raise_flag(block->loop, TAUTSCOPE_FLAG_DRIVE_FAULT);
        }
        block->was_set[action] = is_set;
    }
    if (result == TAUTSCOPE_RESULT_OK && share != block->share) {
        result = tautscope_loop_set_compensation(block->loop, share);
        block->share = share;
    }
    if (result == TAUTSCOPE_RESULT_OK) {
        result = tautscope_loop_step(block->loop, block->dofs, reference, time - age, time, block->command);
    }
    return result == TAUTSCOPE_RESULT_OK ? tautscope_loop_supervision(block->loop, &block->supervision) : result;
}

/* An update after the tick: features (4) in px, NaN for a band that was not found; with [[dof]] the tip (n) in m or rad, NaN for
   what was not measured. All NaN are an image without bands, but no measurement of the tip. */
static inline TautscopeResult block_update(LoopBlock *block, const double *measured, double captured_at) {
    const TautscopeMeasurement tip = {.values = measured, .count = block->dofs, .captured_at = captured_at};
    TautscopeReport image = {.size = sizeof image};
    TautscopeResult result = TAUTSCOPE_RESULT_OK;
    int known = 0;
    for (size_t i = 0; i < block->measured; ++i) {
        known += !isnan(measured[i]);
    }
    if (block->has_bands) {
        result = tautscope_loop_on_features(block->loop, known > 0 ? measured : NULL, captured_at, &image);
        block->report.status = image.status;
        memcpy(block->report.state_estimate, image.state_estimate, sizeof image.state_estimate);
        memcpy(block->report.delta_minus, image.delta_minus, sizeof image.delta_minus);
        memcpy(block->report.delta_plus, image.delta_plus, sizeof image.delta_plus);
    } else if (known > 0) {
        result = tautscope_loop_on_tip(block->loop, &tip, &block->report);
    }
    return result == TAUTSCOPE_RESULT_OK ? tautscope_loop_supervision(block->loop, &block->supervision) : result;
}

#endif
