/* A co-simulation unit of FMI 3.0: unit.c is its interface, twin.c or loop.c its content. */

#ifndef TAUTSCOPE_UNIT_H
#define TAUTSCOPE_UNIT_H

#include <stddef.h>

#include "fmi3Functions.h"
#include "variables.h" /* written by build.py: indices, types, start values */

#define TEXT_LENGTH 4096

typedef struct {
    double values[VARIABLES];
    char text[TEXT_LENGTH]; /* the value of the only variable of type String, if there is one */
    char resources[TEXT_LENGTH];
    char name[256];
    int mode;
    void *content;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Unit;

/* Sends a message to the importer. */
void unit_log(const Unit *unit, fmi3Status status, const char *format, ...);

/* Path of a file in the folder `resources` of the unit. */
void unit_resource(const Unit *unit, const char *name, char *path, size_t length);

/* What a content defines. `start` may use parameters and inputs; `step` lets `periods` control periods of length PERIOD pass,
   from `time` on. Both write outputs to `values`. After a status other than OK, `stop` is still called; it may be called without
   `start`. */
fmi3Status content_start(Unit *unit);
fmi3Status content_step(Unit *unit, double time, long periods);
void content_stop(Unit *unit);

#endif
