/* The rest of the functions of FMI 3.0: a unit must have them, and its model description states that it does not support them. */

#include "unit.h"

#pragma GCC diagnostic ignored "-Wunused-parameter"

static fmi3Status refuse(const Unit *unit, const char *name) {
    unit_log(unit, fmi3Error, "%s is not supported", name);
    return fmi3Error;
}

#define UNSUPPORTED(name, ...)                                                                                             \
    fmi3Status name(fmi3Instance instance, __VA_ARGS__) { return refuse(instance, #name); }
#define UNSUPPORTED_MODE(name)                                                                                             \
    fmi3Status name(fmi3Instance instance) { return refuse(instance, #name); }
typedef const fmi3ValueReference References[];

fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                          fmi3InstanceEnvironment f, fmi3LogMessageCallback g) {
    return NULL;
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
                                               fmi3InstanceEnvironment f, fmi3LogMessageCallback g, fmi3ClockUpdateCallback h,
                                               fmi3LockPreemptionCallback i, fmi3UnlockPreemptionCallback j) {
    return NULL;
}

UNSUPPORTED_MODE(fmi3EnterEventMode)
UNSUPPORTED_MODE(fmi3EnterStepMode)
UNSUPPORTED_MODE(fmi3EnterConfigurationMode)
UNSUPPORTED_MODE(fmi3ExitConfigurationMode)
UNSUPPORTED_MODE(fmi3EnterContinuousTimeMode)
UNSUPPORTED_MODE(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d,
            fmi3Boolean *e, fmi3Float64 *f)
UNSUPPORTED(fmi3GetBinary, References a, size_t b, size_t c[], fmi3Binary d[], size_t e)
UNSUPPORTED(fmi3SetBinary, References a, size_t b, const size_t c[], const fmi3Binary d[], size_t e)
UNSUPPORTED(fmi3GetClock, References a, size_t b, fmi3Clock c[])
UNSUPPORTED(fmi3SetClock, References a, size_t b, const fmi3Clock c[])
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference a, size_t *b)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference a, size_t b[], fmi3ValueReference c[], size_t d[],
            fmi3DependencyKind e[], size_t f)
UNSUPPORTED(fmi3GetFMUState, fmi3FMUState *a)
UNSUPPORTED(fmi3SetFMUState, fmi3FMUState a)
UNSUPPORTED(fmi3FreeFMUState, fmi3FMUState *a)
UNSUPPORTED(fmi3SerializedFMUStateSize, fmi3FMUState a, size_t *b)
UNSUPPORTED(fmi3SerializeFMUState, fmi3FMUState a, fmi3Byte b[], size_t c)
UNSUPPORTED(fmi3DeserializeFMUState, const fmi3Byte a[], size_t b, fmi3FMUState *c)
UNSUPPORTED(fmi3GetDirectionalDerivative, References a, size_t b, References c, size_t d, const fmi3Float64 e[], size_t f,
            fmi3Float64 g[], size_t h)
UNSUPPORTED(fmi3GetAdjointDerivative, References a, size_t b, References c, size_t d, const fmi3Float64 e[], size_t f,
            fmi3Float64 g[], size_t h)
UNSUPPORTED(fmi3GetIntervalDecimal, References a, size_t b, fmi3Float64 c[], fmi3IntervalQualifier d[])
UNSUPPORTED(fmi3GetIntervalFraction, References a, size_t b, fmi3UInt64 c[], fmi3UInt64 d[], fmi3IntervalQualifier e[])
UNSUPPORTED(fmi3GetShiftDecimal, References a, size_t b, fmi3Float64 c[])
UNSUPPORTED(fmi3GetShiftFraction, References a, size_t b, fmi3UInt64 c[], fmi3UInt64 d[])
UNSUPPORTED(fmi3SetIntervalDecimal, References a, size_t b, const fmi3Float64 c[])
UNSUPPORTED(fmi3SetIntervalFraction, References a, size_t b, const fmi3UInt64 c[], const fmi3UInt64 d[])
UNSUPPORTED(fmi3SetShiftDecimal, References a, size_t b, const fmi3Float64 c[])
UNSUPPORTED(fmi3SetShiftFraction, References a, size_t b, const fmi3UInt64 c[], const fmi3UInt64 d[])
UNSUPPORTED(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
UNSUPPORTED(fmi3SetTime, fmi3Float64 a)
UNSUPPORTED(fmi3SetContinuousStates, const fmi3Float64 a[], size_t b)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, fmi3Float64 a[], size_t b)
UNSUPPORTED(fmi3GetEventIndicators, fmi3Float64 a[], size_t b)
UNSUPPORTED(fmi3GetContinuousStates, fmi3Float64 a[], size_t b)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, fmi3Float64 a[], size_t b)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *a)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *a)
UNSUPPORTED(fmi3GetOutputDerivatives, References a, size_t b, const fmi3Int32 c[], fmi3Float64 d[], size_t e)
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference a, fmi3Float64 b)
