/* S-function of the loop for Simulink: a C-MEX file, Level 2. build.m compiles it.

   Dialog parameters: file of the configuration; share of the compensation, 0 to 1.
   Input ports: 1 reference (n), 2 its age (s), 3 features (4), with [[dof]] the tip (n), 4 whether there is a new measurement,
   5 captured_at (s), 6 engage, acknowledge, drive fault (3).
   Output ports: 1 command (n), 2 delta_minus (n), 3 delta_plus (n), 4 state estimate (n),
   5 status, reaction, flags as numbers of tautscope.h (3).

   The sample time is `control.period`. Only the command and port 5 depend on the reference of the tick; a measurement changes the
   outputs of the next tick, so that a plant with a sensor closes the loop without an algebraic loop. */

#define S_FUNCTION_NAME sfun_tautscope
#define S_FUNCTION_LEVEL 2

#include <simstruc.h>

#include <loop_block.h>

enum { FILE_PARAMETER, SHARE_PARAMETER, PARAMETERS };
enum { REFERENCE, AGE, MEASURED, HAS_MEASURED, CAPTURED_AT, ACTIONS, INPUTS };
enum { COMMAND, DELTA_MINUS, DELTA_PLUS, STATE_ESTIMATE, STATE, OUTPUTS };

/* Simulink reads the text after the function has returned. */
static char message[8192];

static LoopBlock *create(SimStruct *S) {
    char file[4096];
    LoopBlock *block = (LoopBlock *)malloc(sizeof *block);
    if (!block || mxGetString(ssGetSFcnParam(S, FILE_PARAMETER), file, sizeof file) != 0) {
        snprintf(message, sizeof message, "The first parameter must be the name of a file, up to %d characters.", (int)sizeof file);
    } else if (block_create(block, file, message, sizeof message)) {
        return block;
    }
    free(block);
    ssSetErrorStatus(S, message);
    return NULL;
}

static void destroy(LoopBlock *block) {
    if (block) {
        tautscope_loop_destroy(block->loop);
        free(block);
    }
}

static void check(SimStruct *S, TautscopeResult result) {
    if (result != TAUTSCOPE_RESULT_OK) {
        snprintf(message, sizeof message, "%s", tautscope_error_message());
        ssSetErrorStatus(S, message);
    }
}

#define MDL_CHECK_PARAMETERS
static void mdlCheckParameters(SimStruct *S) {
    const mxArray *share = ssGetSFcnParam(S, SHARE_PARAMETER);
    if (!mxIsChar(ssGetSFcnParam(S, FILE_PARAMETER))) {
        ssSetErrorStatus(S, "The first parameter must be the name of a file.");
    } else if (!mxIsDouble(share) || mxGetNumberOfElements(share) != 1 || !(mxGetScalar(share) >= 0.0 && mxGetScalar(share) <= 1.0)) {
        ssSetErrorStatus(S, "The second parameter, the share of the compensation, must be a number from 0 to 1.");
    }
}

static void mdlInitializeSizes(SimStruct *S) {
    ssSetNumSFcnParams(S, PARAMETERS);
    if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {
        return; /* Simulink reports it */
    }
    mdlCheckParameters(S);
    if (ssGetErrorStatus(S) != NULL) {
        return;
    }
    LoopBlock *block = create(S);
    if (!block) {
        return;
    }
    const int n = (int)block->dofs, measured = (int)block->measured;
    const int input_widths[INPUTS] = {n, 1, measured, 1, 1, BLOCK_ACTIONS};
    const int output_widths[OUTPUTS] = {n, n, n, n, 3};
    destroy(block);
    ssSetSFcnParamTunable(S, FILE_PARAMETER, SS_PRM_NOT_TUNABLE);
    if (!ssSetNumInputPorts(S, INPUTS) || !ssSetNumOutputPorts(S, OUTPUTS)) {
        return;
    }
    for (int port = 0; port < INPUTS; ++port) {
        ssSetInputPortWidth(S, port, input_widths[port]);
        ssSetInputPortRequiredContiguous(S, port, 1);
        ssSetInputPortDirectFeedThrough(S, port, port == REFERENCE || port == AGE || port == ACTIONS);
    }
    for (int port = 0; port < OUTPUTS; ++port) {
        ssSetOutputPortWidth(S, port, output_widths[port]);
    }
    ssSetNumSampleTimes(S, 1);
    ssSetNumPWork(S, 1);
}

static void mdlInitializeSampleTimes(SimStruct *S) {
    LoopBlock *block = create(S);
    if (block) {
        ssSetSampleTime(S, 0, block->period);
        ssSetOffsetTime(S, 0, 0.0);
    }
    destroy(block);
}

#define MDL_START
static void mdlStart(SimStruct *S) { ssSetPWorkValue(S, 0, create(S)); }

static void mdlOutputs(SimStruct *S, int_T tid) {
    LoopBlock *block = (LoopBlock *)ssGetPWorkValue(S, 0);
    double *state = ssGetOutputPortRealSignal(S, STATE);
    (void)tid;
    check(S, block_tick(block, (const double *)ssGetInputPortSignal(S, REFERENCE), *(const double *)ssGetInputPortSignal(S, AGE),
                        ssGetT(S), (const double *)ssGetInputPortSignal(S, ACTIONS),
                        mxGetScalar(ssGetSFcnParam(S, SHARE_PARAMETER))));
    for (size_t dof = 0; dof < block->dofs; ++dof) {
        ssGetOutputPortRealSignal(S, COMMAND)[dof] = block->command[dof];
        ssGetOutputPortRealSignal(S, DELTA_MINUS)[dof] = block->report.delta_minus[dof];
        ssGetOutputPortRealSignal(S, DELTA_PLUS)[dof] = block->report.delta_plus[dof];
        ssGetOutputPortRealSignal(S, STATE_ESTIMATE)[dof] = block->report.state_estimate[dof];
    }
    state[0] = block->report.status;
    state[1] = block->supervision.reaction;
    state[2] = block->supervision.flags;
}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid) {
    (void)tid;
    if (*(const double *)ssGetInputPortSignal(S, HAS_MEASURED) != 0.0) {
        check(S, block_update((LoopBlock *)ssGetPWorkValue(S, 0), (const double *)ssGetInputPortSignal(S, MEASURED),
                              *(const double *)ssGetInputPortSignal(S, CAPTURED_AT)));
    }
}

static void mdlTerminate(SimStruct *S) {
    destroy((LoopBlock *)ssGetPWorkValue(S, 0));
    ssSetPWorkValue(S, 0, NULL);
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
