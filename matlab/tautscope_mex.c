/* Gateway between +tautscope/Loop.m and the C interface, for MATLAB and Octave; build.m compiles it.

   tautscope_mex(ACTION, ...)

   Users call the class. A loop is a number here, never a pointer, so that no value passed from a script can crash the program. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <mex.h>
#include <tautscope.h>

#if TAUTSCOPE_ABI_VERSION != 1
#error "tautscope.h is of another version of the interface than this gateway"
#endif

#define LOOPS 64
#define DOFS 3
#define FEATURES 4
#define FLAGS 32

typedef struct {
    TautscopeLoop *loop;
    TautscopeDetector *detector; /* created by the first image */
    uint32_t serial;
} Slot;

static Slot slots[LOOPS];
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
    memset(slot, 0, sizeof *slot);
}

static void destroy_all(void) {
    for (int i = 0; i < LOOPS; ++i) {
        destroy(&slots[i]);
    }
}

/* The slot of a loop; NULL if it was deleted. */
static Slot *find(const mxArray *handle) {
    const double serial = mxIsDouble(handle) && mxGetNumberOfElements(handle) == 1 ? mxGetScalar(handle) : 0.0;
    for (int i = 0; i < LOOPS; ++i) {
        if (slots[i].loop && slots[i].serial == serial) {
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

static mxArray *structure_of(const TautscopeReport *report) {
    static const char *const names[] = {"status",     "reaction",   "flags",           "captured_at",
                                        "state_estimate", "state_deviation", "predicted_state", "predicted_features",
                                        "innovation", "delta_minus", "delta_plus",      "is_observable"};
    mxArray *made = mxCreateStructMatrix(1, 1, (int)(sizeof names / sizeof *names), (const char **)names);
    mxArray *is_observable = mxCreateLogicalMatrix(1, DOFS);
    for (int dof = 0; dof < DOFS; ++dof) {
        mxGetLogicals(is_observable)[dof] = report->is_observable[dof] != 0;
    }
    mxSetField(made, 0, "status", mxCreateString(tautscope_status_name(report->status)));
    mxSetField(made, 0, "reaction", mxCreateString(tautscope_reaction_name(report->reaction)));
    mxSetField(made, 0, "flags", flag_names(report->flags));
    mxSetField(made, 0, "captured_at", mxCreateDoubleScalar(report->captured_at));
    mxSetField(made, 0, "state_estimate", row(report->state_estimate, DOFS));
    mxSetField(made, 0, "state_deviation", row(report->state_deviation, DOFS));
    mxSetField(made, 0, "predicted_state", row(report->predicted_state, DOFS));
    mxSetField(made, 0, "predicted_features", row(report->predicted_features, FEATURES));
    mxSetField(made, 0, "innovation", row(report->innovation, FEATURES));
    mxSetField(made, 0, "delta_minus", row(report->delta_minus, DOFS));
    mxSetField(made, 0, "delta_plus", row(report->delta_plus, DOFS));
    mxSetField(made, 0, "is_observable", is_observable);
    return made;
}

static mxArray *create(const mxArray *toml) {
    Slot *slot = slots;
    while (slot < slots + LOOPS && slot->loop) {
        ++slot;
    }
    if (slot == slots + LOOPS) {
        mexErrMsgIdAndTxt("tautscope:Signal", "%d loops exist already; delete one first", LOOPS);
    }
    check(tautscope_loop_create(document(toml), mxGetNumberOfElements(toml), &slot->loop));
    slot->serial = ++last_serial;
    mexLock(); /* `clear all` must not unload it under a loop */
    return mxCreateDoubleScalar(slot->serial);
}

static mxArray *step(Slot *slot, const mxArray *reference, const mxArray *time, const mxArray *made_at) {
    double command[DOFS];
    check(tautscope_loop_step(slot->loop, numbers(reference, DOFS, "reference"), number(made_at, "made_at"),
                              number(time, "time"), command));
    return row(command, DOFS);
}

static mxArray *on_features(Slot *slot, const mxArray *features, const mxArray *captured_at) {
    TautscopeReport report = {.size = sizeof report};
    const double *found = numbers(features, FEATURES, "features");
    const int has_band = !(isnan(found[0]) && isnan(found[1]) && isnan(found[2]) && isnan(found[3]));
    check(tautscope_loop_on_features(slot->loop, has_band ? found : NULL, number(captured_at, "captured_at"), &report));
    return structure_of(&report);
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
    return structure_of(&report);
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
    check(tautscope_loop_period(slot->loop, &value));
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
        mexErrMsgIdAndTxt("tautscope:Signal", "tautscope_mex is called by the class tautscope.Loop");
    }
    if (strcmp(action, "create") == 0) {
        results[0] = create(arguments[1]);
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
        mexErrMsgIdAndTxt("tautscope:Signal", "this loop was deleted; create another one with tautscope.Loop(file)");
    }
    if (strcmp(action, "step") == 0 && count == 5) {
        results[0] = step(slot, arguments[2], arguments[3], arguments[4]);
    } else if (strcmp(action, "on_features") == 0 && count == 4) {
        results[0] = on_features(slot, arguments[2], arguments[3]);
    } else if (strcmp(action, "on_frame") == 0 && count == 5) {
        results[0] = on_frame(slot, arguments[2], arguments[3], arguments[4]);
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
