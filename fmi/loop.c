/* Content of a unit: the loop. */

#include <stdlib.h>

#include "loop_block.h"
#include "unit.h"

static void write_outputs(Unit *unit) {
    const LoopBlock *block = unit->content;
    for (size_t dof = 0; dof < block->dofs; ++dof) {
        unit->values[COMMAND + dof] = block->command[dof];
        unit->values[DELTA_MINUS + dof] = block->report.delta_minus[dof];
        unit->values[DELTA_PLUS + dof] = block->report.delta_plus[dof];
        unit->values[ESTIMATE + dof] = block->report.state_estimate[dof];
    }
    unit->values[STATUS] = block->report.status;
    unit->values[REACTION] = block->supervision.reaction;
    unit->values[FLAGS] = block->supervision.flags;
}

fmi3Status content_start(Unit *unit) {
    char file[2 * TEXT_LENGTH], message[4 * TEXT_LENGTH];
    LoopBlock *block = malloc(sizeof *block);
    unit_resource(unit, "config.toml", file, sizeof file);
    if (!block || !block_create(block, file, message, sizeof message)) {
        unit_log(unit, fmi3Error, "%s", block ? message : "out of memory");
        free(block);
        return fmi3Error;
    }
    unit->content = block;
    write_outputs(unit);
    return fmi3OK;
}

fmi3Status content_step(Unit *unit, double time, long periods) {
    LoopBlock *block = unit->content;
    const double *values = unit->values;
    TautscopeResult result = TAUTSCOPE_RESULT_OK;
    for (long i = 0; i < periods && result == TAUTSCOPE_RESULT_OK; ++i) {
        result = block_tick(block, values + REFERENCE, values[REFERENCE_AGE], time + (double)i * PERIOD,
                            values + ENGAGE, values[COMPENSATION]);
        /* Whether there is an image or a measurement, when it was taken, and its values follow one another. */
        if (i == 0 && result == TAUTSCOPE_RESULT_OK && values[CAPTURED_AT - 1] != 0.0) {
            result = block_update(block, values + CAPTURED_AT + 1, values[CAPTURED_AT]);
        }
    }
    if (result != TAUTSCOPE_RESULT_OK) {
        unit_log(unit, fmi3Error, "%s", tautscope_error_message());
        return fmi3Error;
    }
    write_outputs(unit);
    return fmi3OK;
}

void content_stop(Unit *unit) {
    LoopBlock *block = unit->content;
    if (block) {
        tautscope_loop_destroy(block->loop);
        free(block);
        unit->content = NULL;
    }
}
