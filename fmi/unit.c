/* The functions of FMI 3.0 for co-simulation, the same for every content. */

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unit.h"

enum { INSTANTIATED, INITIALIZATION, STEP, TERMINATED };

/* Relative deviation of a communication step from whole control periods that comes from rounding. */
static const double ROUNDING = 1e-6;

static const struct {
    unsigned char type, role;
    double start;
} variables[VARIABLES] = VARIABLE_TABLE;

void unit_log(const Unit *unit, fmi3Status status, const char *format, ...) {
    char message[2 * TEXT_LENGTH];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (unit->log) {
        unit->log(unit->environment, status, "error", message);
    } else {
        fprintf(stderr, "%s: %s\n", unit->name, message);
    }
}

void unit_resource(const Unit *unit, const char *name, char *path, size_t length) {
    const size_t end = strlen(unit->resources);
    const char *separator = end > 0 && strchr("/\\", unit->resources[end - 1]) ? "" : "/";
    snprintf(path, length, "%s%s%s", unit->resources, separator, name);
}

static void set_start_values(Unit *unit) {
    for (int i = 0; i < VARIABLES; ++i) {
        unit->values[i] = variables[i].start;
    }
    snprintf(unit->text, sizeof unit->text, "%s", START_TEXT);
    unit->mode = INSTANTIATED;
}

static fmi3Status fail(const Unit *unit, const char *what) {
    unit_log(unit, fmi3Error, "%s", what);
    return fmi3Error;
}

static int is_of(const Unit *unit, fmi3ValueReference reference, int type) {
    if (reference < VARIABLES && variables[reference].type == type) {
        return 1;
    }
    unit_log(unit, fmi3Error, "value reference %lu: no variable of this type", (unsigned long)reference);
    return 0;
}

static int may_set(const Unit *unit, fmi3ValueReference reference) {
    const int role = variables[reference].role;
    if (role == INPUT || role == TUNABLE || (role == FIXED && unit->mode <= INITIALIZATION)) {
        return 1;
    }
    unit_log(unit, fmi3Error, "value reference %lu: it cannot be set %s", (unsigned long)reference,
             role == FIXED ? "after the initialization" : "because it is an output");
    return 0;
}

#define ACCESS(Name, Type, TYPE)                                                                                            \
    fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference references[], size_t count, Type values[],     \
                             size_t value_count) {                                                                          \
        const Unit *unit = instance;                                                                                        \
        for (size_t i = 0; i < count; ++i) {                                                                                \
            if (i >= value_count || !is_of(unit, references[i], TYPE)) {                                                    \
                return fmi3Error;                                                                                           \
            }                                                                                                               \
            values[i] = (Type)unit->values[references[i]];                                                                  \
        }                                                                                                                   \
        return fmi3OK;                                                                                                      \
    }                                                                                                                       \
    fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference references[], size_t count,                    \
                             const Type values[], size_t value_count) {                                                     \
        Unit *unit = instance;                                                                                              \
        for (size_t i = 0; i < count; ++i) {                                                                                \
            if (i >= value_count || !is_of(unit, references[i], TYPE) || !may_set(unit, references[i])) {                   \
                return fmi3Error;                                                                                           \
            }                                                                                                               \
            unit->values[references[i]] = (double)values[i];                                                                \
        }                                                                                                                   \
        return fmi3OK;                                                                                                      \
    }

/* Types without variables: NONE is the type of none. */
ACCESS(Float64, fmi3Float64, FLOAT64)
ACCESS(Int32, fmi3Int32, INT32)
ACCESS(Boolean, fmi3Boolean, BOOLEAN)
ACCESS(Float32, fmi3Float32, NONE)
ACCESS(Int8, fmi3Int8, NONE)
ACCESS(UInt8, fmi3UInt8, NONE)
ACCESS(Int16, fmi3Int16, NONE)
ACCESS(UInt16, fmi3UInt16, NONE)
ACCESS(UInt32, fmi3UInt32, NONE)
ACCESS(Int64, fmi3Int64, NONE)
ACCESS(UInt64, fmi3UInt64, NONE)

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3String values[],
                         size_t value_count) {
    const Unit *unit = instance;
    for (size_t i = 0; i < count; ++i) {
        if (i >= value_count || !is_of(unit, references[i], STRING)) {
            return fmi3Error;
        }
        values[i] = unit->text;
    }
    return fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3String values[],
                         size_t value_count) {
    Unit *unit = instance;
    for (size_t i = 0; i < count; ++i) {
        if (i >= value_count || !is_of(unit, references[i], STRING) || !may_set(unit, references[i])) {
            return fmi3Error;
        }
        if (strlen(values[i]) >= sizeof unit->text) {
            return fail(unit, "a text is too long");
        }
        strcpy(unit->text, values[i]);
    }
    return fmi3OK;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean is_on, size_t count, const fmi3String categories[]) {
    (void)instance, (void)is_on, (void)count, (void)categories;
    return fmi3OK; /* only errors are logged */
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean is_visible,
                                         fmi3Boolean logging_on, fmi3Boolean event_mode_used, fmi3Boolean early_return_allowed,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Unit *unit = calloc(1, sizeof *unit);
    (void)is_visible, (void)logging_on, (void)event_mode_used, (void)early_return_allowed, (void)intermediate;
    (void)intermediate_count, (void)update;
    if (!unit) {
        return NULL;
    }
    unit->environment = environment;
    unit->log = log;
    snprintf(unit->name, sizeof unit->name, "%s", name ? name : "");
    if (!token || strcmp(token, INSTANTIATION_TOKEN) != 0) {
        unit_log(unit, fmi3Error, "the token is not that of modelDescription.xml");
    } else if (!resources || strlen(resources) >= sizeof unit->resources) {
        unit_log(unit, fmi3Error, "the path of the resources is missing or too long");
    } else {
        strcpy(unit->resources, resources);
        set_start_values(unit);
        return unit;
    }
    free(unit);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) {
    if (instance) {
        content_stop(instance);
        free(instance);
    }
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_time_defined, fmi3Float64 stop_time) {
    Unit *unit = instance;
    (void)tolerance_defined, (void)tolerance, (void)stop_time_defined, (void)stop_time;
    if (unit->mode != INSTANTIATED) {
        return fail(unit, "fmi3EnterInitializationMode: the unit was initialized before; reset it first");
    }
    unit->values[TIME] = start_time;
    unit->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    Unit *unit = instance;
    if (unit->mode != INITIALIZATION) {
        return fail(unit, "fmi3ExitInitializationMode: the unit is not in its initialization mode");
    }
    const fmi3Status status = content_start(unit);
    unit->mode = status == fmi3OK ? STEP : TERMINATED;
    return status;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate_simulation, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time) {
    Unit *unit = instance;
    const double periods = round(step / PERIOD);
    (void)no_set_state;
    *event_handling_needed = *terminate_simulation = *early_return = false;
    *last_successful_time = time;
    if (unit->mode != STEP) {
        return fail(unit, "fmi3DoStep: the unit is not initialized, or has failed or ended");
    }
    if (!(periods >= 1.0 && periods <= 1e6 && fabs(step - periods * PERIOD) <= ROUNDING * step)) {
        unit_log(unit, fmi3Error, "communication step: got %.9g s, expected one or more control periods of %.9g s", step, PERIOD);
        return fmi3Error;
    }
    const fmi3Status status = content_step(unit, time, (long)periods);
    if (status != fmi3OK) {
        unit->mode = TERMINATED;
        return status;
    }
    unit->values[TIME] = *last_successful_time = time + step;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    Unit *unit = instance;
    content_stop(unit);
    unit->mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    content_stop(instance);
    set_start_values(instance);
    return fmi3OK;
}
