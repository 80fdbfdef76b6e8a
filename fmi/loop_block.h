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
    TautscopeReport report; /* of the last image */
    TautscopeSupervision supervision;
    double command[3];
    int was_set[BLOCK_ACTIONS];
    double share;
} LoopBlock;

/* Creates the loop from a file that has every key of the configuration; on failure `message` says why. 1 on success. */
static inline int block_create(LoopBlock *block, const char *file, char *message, size_t length) {
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
    } else if (tautscope_loop_create((const uint8_t *)toml, (size_t)size, &block->loop) != TAUTSCOPE_RESULT_OK ||
               tautscope_loop_predict_state(block->loop, 0.0, &(TautscopeStatePrediction){.is_known = 0}) != TAUTSCOPE_RESULT_OK) {
        /* The second refuses a robot with [[dof]]: the signals are those of the article's instrument. */
        snprintf(message, length, "%s: %s", file, tautscope_error_message());
        tautscope_loop_destroy(block->loop);
        block->loop = NULL;
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
        result = tautscope_loop_step(block->loop, 3, reference, time - age, time, block->command);
    }
    return result == TAUTSCOPE_RESULT_OK ? tautscope_loop_supervision(block->loop, &block->supervision) : result;
}

/* An image update after the tick; `features` (4) in px, NaN for a band that was not found. */
static inline TautscopeResult block_update(LoopBlock *block, const double *features, double captured_at) {
    const int has_band = !(isnan(features[0]) && isnan(features[1]) && isnan(features[2]) && isnan(features[3]));
    const TautscopeResult result =
        tautscope_loop_on_features(block->loop, has_band ? features : NULL, captured_at, &block->report);
    return result == TAUTSCOPE_RESULT_OK ? tautscope_loop_supervision(block->loop, &block->supervision) : result;
}

#endif
