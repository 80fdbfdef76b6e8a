/* Gateway between the classes of +tautscope and the C interface, for MATLAB and Octave; build.m compiles it.

   tautscope_mex(ACTION, ...)

   Users call the classes. An object is a number here, never a pointer, so that no value passed from a script can crash the program. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mex.h>
#include <tautscope.h>

#if TAUTSCOPE_ABI_VERSION != 1
#error "tautscope.h is of another version of the interface than this gateway"
#endif

#define OBJECTS 64
#define DOFS 8
#define FEATURES 4
#define VALUES 16
#define FLAGS 32

/* One object: a loop with its detector, which the first image creates, or one of the other two. */
typedef struct {
    TautscopeLoop *loop;
    TautscopeDetector *detector;
    TautscopeCompensator *compensator;
    TautscopeEstimator *estimator;
    size_t dofs;
    uint32_t serial; /* 0: free */
} Slot;

static Slot slots[OBJECTS];
static uint32_t last_serial;

static const char *const identifiers[] = {"",         "tautscope:NullPointer", "tautscope:Config",  "tautscope:Signal",
                                          "tautscope:Image", "tautscope:Size",        "tautscope:Internal"};

static void check(TautscopeResult result) {
    if (result != TAUTSCOPE_RESULT_OK) {
        const char *identifier = result < sizeof identifiers / sizeof *identifiers ? identifiers[result] : "tautscope:Internal";
        mexErrMsgIdAndTxt(identifier, "%s", tautscope_error_message());
    }
}

static void destroy(Slot *slot) {
    tautscope_detector_destroy(slot->detector);
    tautscope_loop_destroy(slot->loop);
    tautscope_compensator_destroy(slot->compensator);
    tautscope_estimator_destroy(slot->estimator);
    memset(slot, 0, sizeof *slot);
}

static void destroy_all(void) {
    for (int i = 0; i < OBJECTS; ++i) {
        destroy(&slots[i]);
    }
}

/* The slot of an object; NULL if it was deleted. */
static Slot *find(const mxArray *handle) {
    const double serial = mxIsDouble(handle) && mxGetNumberOfElements(handle) == 1 ? mxGetScalar(handle) : 0.0;
    for (int i = 0; i < OBJECTS; ++i) {
        if (slots[i].serial != 0 && slots[i].serial == serial) {
            return &slots[i];
        }
    }
    return NULL;
}

static const double *numbers(const mxArray *value, size_t count, const char *name) {
    if (!mxIsDouble(value) || mxIsComplex(value) || mxGetNumberOfElements(value) != count) {
        mexErrMsgIdAndTxt("tautscope:Signal", "%s: got %d elements of class %s, expected %d real numbers of class double", name,
                          (int)mxGetNumberOfElements(value), mxGetClassName(value), (int)count);
    }
    return (const double *)mxGetData(value);
}

static double number(const mxArray *value, const char *name) { return *numbers(value, 1, name); }

static uint32_t whole(const mxArray *value, const char *name) {
    const double found = number(value, name);
    if (!(found >= 0.0 && found <= UINT32_MAX && found == floor(found))) {
        mexErrMsgIdAndTxt("tautscope:Signal", "%s: got %g, expected a whole number from 0 on", name, found);
    }
    return (uint32_t)found;
}

static char *text(const mxArray *value, const char *name) {
    if (!mxIsChar(value)) {
        mexErrMsgIdAndTxt("tautscope:Signal", "%s: got class %s, expected a row of characters", name, mxGetClassName(value));
    }
    return mxArrayToString(value);
}

/* The configuration, bytes of class uint8. */
static const uint8_t *document(const mxArray *toml) {
    if (!mxIsUint8(toml)) {
        mexErrMsgIdAndTxt("tautscope:Config", "configuration: got class %s, expected uint8", mxGetClassName(toml));
    }
    return (const uint8_t *)mxGetData(toml);
}

static mxArray *row(const double *values, size_t count) {
    mxArray *made = mxCreateDoubleMatrix(1, count, mxREAL);
    memcpy(mxGetData(made), values, count * sizeof *values);
    return made;
}

static mxArray *flag_names(uint32_t flags) {
    mxArray *names;
    mwSize count = 0;
    for (uint32_t flag = 0; flag < FLAGS; ++flag) {
        count += flags >> flag & 1u;
    }
    names = mxCreateCellMatrix(1, count);
    count = 0;
    for (uint32_t flag = 0; flag < FLAGS; ++flag) {
        if (flags >> flag & 1u) {
            const char *name = tautscope_flag_name(flag);
            mxSetCell(names, count++, mxCreateString(name ? name : "unknown"));
        }
    }
    return names;
}

static mxArray *flags_of(const uint32_t *flags, size_t count) {
    mxArray *made = mxCreateLogicalMatrix(1, count);
    for (size_t i = 0; i < count; ++i) {
        mxGetLogicals(made)[i] = flags[i] != 0;
    }
    return made;
}

/* A report of n degrees of freedom and m features or values, the member `predicted` by that name. */
#define STRUCTURE_OF(report, n, m, predicted)                                                                                     \
    structure_of((report).status, (report).reaction, (report).flags, (report).captured_at, #predicted,                            \
                 (mxArray *[]){row((report).state_estimate, n), row((report).state_deviation, n), row((report).predicted_state, n), \
                               row((report).predicted, m), row((report).innovation, m), row((report).delta_minus, n),             \
                               row((report).delta_plus, n), flags_of((report).is_observable, n)})

static mxArray *structure_of(uint32_t status, uint32_t reaction, uint32_t flags, double captured_at, const char *predicted,
                             mxArray *const parts[]) {
    const char *names[] = {"status",          "reaction",  "flags",      "captured_at", "state_estimate", "state_deviation",
                           "predicted_state", predicted,   "innovation", "delta_minus", "delta_plus",     "is_observable"};
    mxArray *made = mxCreateStructMatrix(1, 1, 12, names);
    mxSetField(made, 0, "status", mxCreateString(tautscope_status_name(status)));
    mxSetField(made, 0, "reaction", mxCreateString(tautscope_reaction_name(reaction)));
    mxSetField(made, 0, "flags", flag_names(flags));
    mxSetField(made, 0, "captured_at", mxCreateDoubleScalar(captured_at));
    for (int part = 4; part < 12; ++part) {
        mxSetField(made, 0, names[part], parts[part - 4]);
    }
    return made;
}

/* A free slot, which is still free while its serial is 0. */
static Slot *free_slot(void) {
    Slot *slot = slots;
    while (slot < slots + OBJECTS && slot->serial) {
        ++slot;
    }
    if (slot == slots + OBJECTS) {
        mexErrMsgIdAndTxt("tautscope:Signal", "%d objects exist already; delete one first", OBJECTS);
    }
    memset(slot, 0, sizeof *slot);
    return slot;
}

static mxArray *taken(Slot *slot) {
    slot->serial = ++last_serial;
    mexLock(); /* `clear all` must not unload it under an object */
    return mxCreateDoubleScalar(slot->serial);
}

static mxArray *create(const mxArray *toml) {
    Slot *slot = free_slot();
    check(tautscope_loop_create(document(toml), mxGetNumberOfElements(toml), &slot->loop));
    check(tautscope_loop_size(slot->loop, &slot->dofs, NULL));
    return taken(slot);
}

/* `settings` has the five members of the structure in a column per degree of freedom, in the header's order. */
static mxArray *create_each(const mxArray *settings, int is_estimator) {
    Slot *slot = free_slot();
    slot->dofs = mxGetNumberOfElements(settings) / 5;
    const double *values = numbers(settings, 5 * slot->dofs, "settings");
    check(is_estimator ? tautscope_estimator_create((const TautscopeEstimatorSettings *)values, slot->dofs, &slot->estimator)
                       : tautscope_compensator_create((const TautscopeCompensatorSettings *)values, slot->dofs, &slot->compensator));
    return taken(slot);
}

static mxArray *step(Slot *slot, const mxArray *reference, const mxArray *time, const mxArray *made_at) {
    double command[DOFS];
    check(tautscope_loop_step(slot->loop, slot->dofs, numbers(reference, slot->dofs, "reference"), number(made_at, "made_at"),
                              number(time, "time"), command));
    return row(command, slot->dofs);
}

static mxArray *on_features(Slot *slot, const mxArray *features, const mxArray *captured_at) {
    TautscopeReport report = {.size = sizeof report};
    const double *found = numbers(features, FEATURES, "features");
    const int has_band = !(isnan(found[0]) && isnan(found[1]) && isnan(found[2]) && isnan(found[3]));
    check(tautscope_loop_on_features(slot->loop, has_band ? found : NULL, number(captured_at, "captured_at"), &report));
    return STRUCTURE_OF(report, slot->dofs, FEATURES, predicted_features);
}

/* A function handle as the model of a sensor. An error must not jump over the library: `message` is thrown afterwards. */
typedef struct {
    mxArray *function;
    size_t dofs, count;
    char message[256];
} Model;

static int predict(void *context, const double *state, double *values, double *jacobian) {
    Model *model = (Model *)context;
    mxArray *arguments[2] = {model->function, row(state, model->dofs)}, *found = NULL;
    (void)jacobian; /* left as it is: derivatives by differences */
    if (mexCallMATLABWithTrap(1, &found, 2, arguments, "feval") || !found) {
        snprintf(model->message, sizeof model->message, "predict: the call failed");
        return 0;
    }
    mxDestroyArray(arguments[1]);
    const size_t count = mxGetNumberOfElements(found);
    if (count == model->count && mxIsDouble(found) && !mxIsComplex(found)) {
        memcpy(values, mxGetData(found), count * sizeof *values);
    } else if (count > 0) {
        snprintf(model->message, sizeof model->message, "predict: got %d elements of class %s, expected %d real numbers of class double",
                 (int)count, mxGetClassName(found), (int)model->count);
    }
    mxDestroyArray(found);
    return count == model->count; /* an empty result: the sensor sees nothing */
}

/* Values, time, covariance (empty: that of the configuration), sensor; for any measurement also its model and `point`. */
static mxArray *on_measurement(Slot *slot, int count, const mxArray *arguments[]) {
    TautscopeTipReport report = {.size = sizeof report};
    const size_t values = mxGetNumberOfElements(arguments[0]);
    TautscopeMeasurement measurement = {.count = values,
                                        .values = numbers(arguments[0], values, "values"),
                                        .captured_at = number(arguments[1], "captured_at"),
                                        .sensor = whole(arguments[3], "sensor")};
    if (mxGetNumberOfElements(arguments[2]) > 0) {
        measurement.covariance = numbers(arguments[2], values * values, "covariance");
    }
    if (count == 4) {
        check(tautscope_loop_on_tip(slot->loop, &measurement, &report));
    } else {
        Model model = {.function = mxDuplicateArray(arguments[4]), .dofs = slot->dofs, .count = values};
        measurement.point = whole(arguments[5], "point");
        const TautscopeResult result = tautscope_loop_on_measurement(slot->loop, &measurement, predict, &model, &report);
        if (model.message[0]) {
            mexErrMsgIdAndTxt("tautscope:Signal", "%s", model.message);
        }
        mxDestroyArray(model.function);
        check(result);
    }
    return STRUCTURE_OF(report, slot->dofs, values, predicted_values);
}

static mxArray *hysteresis(Slot *slot) {
    const char *names[] = {"half_width", "width_std", "centre", "gain", "gain_std"};
    TautscopeHysteresis found;
    check(tautscope_loop_hysteresis(slot->loop, &found));
    const double *parts[] = {found.half_width, found.width_std, found.centre, found.gain, found.gain_std};
    mxArray *made = mxCreateStructMatrix(1, 1, 5, names);
    for (int part = 0; part < 5; ++part) {
        mxSetField(made, 0, names[part], row(parts[part], slot->dofs));
    }
    return made;
}

static mxArray *predicted_state(Slot *slot) {
    double state[DOFS];
    check(tautscope_loop_predicted_state(slot->loop, slot->dofs, state));
    return row(state, slot->dofs);
}

/* A step of a compensator, or an update of an estimator, which gives delta_minus and delta_plus. */
static void article(Slot *slot, const mxArray *first, const mxArray *second, mxArray *results[]) {
    double minus[DOFS], plus[DOFS];
    const double *values = numbers(first, slot->dofs, slot->estimator ? "command" : "reference");
    if (slot->compensator) {
        check(tautscope_compensator_step(slot->compensator, slot->dofs, values, plus));
        results[0] = row(plus, slot->dofs);
        return;
    }
    check(tautscope_estimator_update(slot->estimator, slot->dofs, values, numbers(second, slot->dofs, "measured"), minus, plus));
    results[0] = row(minus, slot->dofs);
    results[1] = row(plus, slot->dofs);
}

/* `pixels` is height x width x 3 of class uint8, R, G, B, in columns as MATLAB has it; the library gets rows of B, G, R. */
static mxArray *on_frame(Slot *slot, const mxArray *toml, const mxArray *pixels, const mxArray *captured_at) {
    TautscopeReport report = {.size = sizeof report};
    TautscopeImage image = {.format = TAUTSCOPE_PIXEL_FORMAT_BGR};
    const mwSize *size = mxGetDimensions(pixels);
    const uint8_t *planes = (const uint8_t *)mxGetData(pixels);
    uint8_t *rows;
    if (!mxIsUint8(pixels) || mxGetNumberOfDimensions(pixels) != 3 || size[2] != 3) {
        mexErrMsgIdAndTxt("tautscope:Image", "image: got class %s with %d dimensions, expected height x width x 3 of class uint8",
                          mxGetClassName(pixels), (int)mxGetNumberOfDimensions(pixels));
    }
    if (!slot->detector) {
        check(tautscope_detector_create(document(toml), mxGetNumberOfElements(toml), &slot->detector));
    }
    const size_t height = (size_t)size[0], width = (size_t)size[1], area = height * width;
    rows = (uint8_t *)mxMalloc(3 * area);
    for (size_t y = 0; y < height; ++y) {
        for (size_t x = 0; x < width; ++x) {
            for (size_t channel = 0; channel < 3; ++channel) {
                rows[3 * (y * width + x) + channel] = planes[(2 - channel) * area + x * height + y];
            }
        }
    }
    image.data = rows;
    image.length = 3 * area;
    image.stride = 3 * width;
    image.width = (uint32_t)width;
    image.height = (uint32_t)height;
    check(tautscope_loop_on_frame(slot->loop, slot->detector, &image, number(captured_at, "captured_at"), &report));
    mxFree(rows);
    return STRUCTURE_OF(report, slot->dofs, FEATURES, predicted_features);
}

static mxArray *supervision(Slot *slot) {
    static const char *const names[] = {"reaction", "flags", "latched", "share"};
    TautscopeSupervision now;
    mxArray *made = mxCreateStructMatrix(1, 1, 4, (const char **)names);
    check(tautscope_loop_supervision(slot->loop, &now));
    mxSetField(made, 0, "reaction", mxCreateString(tautscope_reaction_name(now.reaction)));
    mxSetField(made, 0, "flags", flag_names(now.flags));
    mxSetField(made, 0, "latched", flag_names(now.latched));
    mxSetField(made, 0, "share", mxCreateDoubleScalar(now.share));
    return made;
}

static void raise_flag(Slot *slot, const mxArray *name) {
    char *wanted = text(name, "flag");
    for (uint32_t flag = 0; flag < FLAGS; ++flag) {
        const char *known = tautscope_flag_name(flag);
        if (known && strcmp(known, wanted) == 0) {
            check(tautscope_loop_raise_flag(slot->loop, flag));
            mxFree(wanted);
            return;
        }
    }
    mexErrMsgIdAndTxt("tautscope:Signal", "flag: got '%s', expected the name of a flag, for example 'drive_fault'", wanted);
}

static mxArray *period(Slot *slot) {
    double value = 0.0;
    check(tautscope_loop_size(slot->loop, NULL, &value));
    return mxCreateDoubleScalar(value);
}

void mexFunction(int result_count, mxArray *results[], int count, const mxArray *arguments[]) {
    char action[32];
    static int is_registered = 0;
    (void)result_count;
    if (!is_registered) {
        mexAtExit(destroy_all);
        is_registered = 1;
    }
    if (count < 2 || mxGetString(arguments[0], action, sizeof action) != 0) {
        mexErrMsgIdAndTxt("tautscope:Signal", "tautscope_mex is called by the classes of tautscope");
    }
    if (strcmp(action, "create") == 0) {
        results[0] = create(arguments[1]);
        return;
    }
    if (strcmp(action, "compensator") == 0 || strcmp(action, "estimator") == 0) {
        results[0] = create_each(arguments[1], strcmp(action, "estimator") == 0);
        return;
    }
    Slot *slot = find(arguments[1]);
    if (strcmp(action, "destroy") == 0) {
        if (slot) {
            destroy(slot);
            mexUnlock();
        }
        return;
    }
    if (!slot) {
        mexErrMsgIdAndTxt("tautscope:Signal", "this object was deleted; create another one");
    }
    if (strcmp(action, "article") == 0 && !slot->loop && count == 4) {
        article(slot, arguments[2], arguments[3], results);
    } else if (strcmp(action, "set_offsets") == 0 && slot->compensator && count == 4) {
        check(tautscope_compensator_set_offsets(slot->compensator, slot->dofs, numbers(arguments[2], slot->dofs, "delta_minus"),
                                                numbers(arguments[3], slot->dofs, "delta_plus")));
    } else if (!slot->loop) {
        mexErrMsgIdAndTxt("tautscope:Signal", "no action %s with %d arguments", action, count);
    } else if (strcmp(action, "step") == 0 && count == 5) {
        results[0] = step(slot, arguments[2], arguments[3], arguments[4]);
    } else if (strcmp(action, "on_features") == 0 && count == 4) {
        results[0] = on_features(slot, arguments[2], arguments[3]);
    } else if (strcmp(action, "on_frame") == 0 && count == 5) {
        results[0] = on_frame(slot, arguments[2], arguments[3], arguments[4]);
    } else if (strcmp(action, "on_measurement") == 0 && (count == 6 || count == 8)) {
        results[0] = on_measurement(slot, count - 2, arguments + 2);
    } else if (strcmp(action, "hysteresis") == 0) {
        results[0] = hysteresis(slot);
    } else if (strcmp(action, "predicted_state") == 0) {
        results[0] = predicted_state(slot);
    } else if (strcmp(action, "supervision") == 0) {
        results[0] = supervision(slot);
    } else if (strcmp(action, "period") == 0) {
        results[0] = period(slot);
    } else if (strcmp(action, "engage") == 0) {
        check(tautscope_loop_engage(slot->loop));
    } else if (strcmp(action, "acknowledge") == 0) {
        check(tautscope_loop_acknowledge(slot->loop));
    } else if (strcmp(action, "set_compensation") == 0 && count == 3) {
        check(tautscope_loop_set_compensation(slot->loop, number(arguments[2], "share")));
    } else if (strcmp(action, "raise_flag") == 0 && count == 3) {
        raise_flag(slot, arguments[2]);
    } else {
        mexErrMsgIdAndTxt("tautscope:Signal", "no action %s with %d arguments", action, count);
    }
}
