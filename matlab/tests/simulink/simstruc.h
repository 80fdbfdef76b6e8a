/* Test double of Simulink's header: what sfun_tautscope.c uses, with the meaning of MathWorks' documentation. Calls in a phase in
   which they are not allowed, ports that do not exist and signals of an input without direct feedthrough end the program. */

#ifndef SIMSTRUC_H
#define SIMSTRUC_H

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PORTS 8
#define WIDTH 8
#define SS_PRM_NOT_TUNABLE 0

typedef int int_T;
typedef double real_T;

/* A row of characters, or else a number. */
typedef struct {
    const char *characters;
    double number;
} mxArray;

typedef enum { SIZES, SAMPLE_TIMES, START, OUTPUTS_PHASE, UPDATE, TERMINATE } Phase;

typedef struct {
    int count;
    int width[PORTS];
    int has_feedthrough[PORTS];
    double signal[PORTS][WIDTH];
} Ports;

typedef struct {
    Phase phase;
    int expected_parameters, parameter_count;
    const mxArray *parameters;
    int is_fixed[PORTS];
    Ports inputs, outputs;
    int sample_times, pointers;
    void *pointer;
    double sample_time, offset_time, time;
    const char *error;
} SimStruct;

static inline void require(int is_allowed, const char *what) {
    if (!is_allowed) {
        fprintf(stderr, "sfun_tautscope.c: %s\n", what);
        exit(1);
    }
}

static inline int mxIsChar(const mxArray *a) { return a->characters != NULL; }
static inline int mxIsDouble(const mxArray *a) { return a->characters == NULL; }
static inline size_t mxGetNumberOfElements(const mxArray *a) { return a->characters ? strlen(a->characters) : 1; }
static inline double mxGetScalar(const mxArray *a) { return a->number; }
static inline int mxGetString(const mxArray *a, char *text, size_t length) {
    if (!a->characters || strlen(a->characters) >= length) {
        return 1;
    }
    strcpy(text, a->characters);
    return 0;
}

static inline void ssSetErrorStatus(SimStruct *S, const char *text) { S->error = text; }
static inline const char *ssGetErrorStatus(const SimStruct *S) { return S->error; }
static inline void ssSetNumSFcnParams(SimStruct *S, int count) { S->expected_parameters = count; }
static inline int ssGetNumSFcnParams(const SimStruct *S) { return S->expected_parameters; }
static inline int ssGetSFcnParamsCount(const SimStruct *S) { return S->parameter_count; }
static inline const mxArray *ssGetSFcnParam(const SimStruct *S, int index) {
    require(index >= 0 && index < S->parameter_count, "no such parameter");
    return &S->parameters[index];
}
static inline void ssSetSFcnParamTunable(SimStruct *S, int index, int is_tunable) {
    require(S->phase == SIZES, "tunable parameters are set in mdlInitializeSizes");
    S->is_fixed[index] = !is_tunable;
}

static inline int set_ports(SimStruct *S, Ports *ports, int count) {
    require(S->phase == SIZES && count <= PORTS, "ports are set in mdlInitializeSizes");
    ports->count = count;
    return 1;
}
static inline void set_width(SimStruct *S, Ports *ports, int port, int width) {
    require(S->phase == SIZES && port < ports->count && width <= WIDTH, "widths are set in mdlInitializeSizes");
    ports->width[port] = width;
}
static inline int ssSetNumInputPorts(SimStruct *S, int count) { return set_ports(S, &S->inputs, count); }
static inline int ssSetNumOutputPorts(SimStruct *S, int count) { return set_ports(S, &S->outputs, count); }
static inline void ssSetInputPortWidth(SimStruct *S, int port, int width) { set_width(S, &S->inputs, port, width); }
static inline void ssSetOutputPortWidth(SimStruct *S, int port, int width) { set_width(S, &S->outputs, port, width); }
static inline void ssSetInputPortRequiredContiguous(SimStruct *S, int port, int is_required) {
    require(port < S->inputs.count && is_required, "ssGetInputPortSignal needs contiguous signals");
}
static inline void ssSetInputPortDirectFeedThrough(SimStruct *S, int port, int has_feedthrough) {
    S->inputs.has_feedthrough[port] = has_feedthrough;
}
static inline const void *ssGetInputPortSignal(SimStruct *S, int port) {
    require(port < S->inputs.count, "no such input");
    require(S->phase == UPDATE || (S->phase == OUTPUTS_PHASE && S->inputs.has_feedthrough[port]),
            "mdlOutputs reads an input without direct feedthrough");
    return S->inputs.signal[port];
}
static inline real_T *ssGetOutputPortRealSignal(SimStruct *S, int port) {
    require(port < S->outputs.count && S->phase == OUTPUTS_PHASE, "outputs are written in mdlOutputs");
    return S->outputs.signal[port];
}

static inline void ssSetNumSampleTimes(SimStruct *S, int count) { S->sample_times = count; }
static inline void ssSetSampleTime(SimStruct *S, int index, double period) {
    require(S->phase == SAMPLE_TIMES && index < S->sample_times, "sample times are set in mdlInitializeSampleTimes");
    S->sample_time = period;
}
static inline void ssSetOffsetTime(SimStruct *S, int index, double offset) {
    require(S->phase == SAMPLE_TIMES && index < S->sample_times, "sample times are set in mdlInitializeSampleTimes");
    S->offset_time = offset;
}
static inline void ssSetNumPWork(SimStruct *S, int count) { S->pointers = count; }
static inline void ssSetPWorkValue(SimStruct *S, int index, void *pointer) {
    require(index < S->pointers && S->phase >= START, "no such pointer");
    S->pointer = pointer;
}
static inline void *ssGetPWorkValue(const SimStruct *S, int index) {
    require(index < S->pointers && S->phase >= START, "no such pointer");
    return S->pointer;
}
static inline double ssGetT(const SimStruct *S) { return S->time; }

#endif
