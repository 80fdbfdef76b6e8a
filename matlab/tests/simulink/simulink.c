/* Test double of Simulink: runs the S-function that includes this file against a recording of examples/cpp/record.py, of the
   article's instrument or of a robot with [[dof]] whose tip is measured as it is.

     sfun_driver RECORDING

   It fails unless every command, estimate and offset has the bits that it had in Python. */

#include <time.h>

/* Ticks for which an action stays set: it acts once. The drive fault is still set when the loop is engaged again. */
enum { PRESSED = 2000 };

static double *read_rows(const char *recording, const char *kind, size_t columns, size_t *count) {
    char path[4096];
    FILE *file;
    double *rows;
    snprintf(path, sizeof path, "%s.%s", recording, kind);
    file = fopen(path, "rb");
    require(file != NULL && fseek(file, 0, SEEK_END) == 0, path);
    *count = (size_t)ftell(file) / (columns * sizeof *rows);
    rows = (double *)malloc(*count * columns * sizeof *rows);
    rewind(file);
    require(rows != NULL && fread(rows, columns * sizeof *rows, *count, file) == *count, path);
    fclose(file);
    return rows;
}

/* Bits that differ, and the largest difference. */
static size_t wrong;
static double largest;

static void compare(const double *values, const double *expected, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        if (!(isnan(values[i]) && isnan(expected[i])) && memcmp(&values[i], &expected[i], sizeof(double)) != 0) {
            ++wrong;
            largest = fmax(largest, fabs(values[i] - expected[i]));
        }
    }
}

static void is_refused(const mxArray *parameters, const char *words) {
    SimStruct S = {.parameter_count = 2, .parameters = parameters};
    mdlInitializeSizes(&S);
    S.phase = SAMPLE_TIMES;
    if (!S.error) {
        mdlInitializeSampleTimes(&S);
    }
    require(S.error != NULL && strstr(S.error, words) != NULL, words);
}

int main(int count, char **arguments) {
    static double nothing[WIDTH] = {0};
    const double *minus, *plus;
    char config[4096];
    size_t ticks, images, image = 0;
    double *tick_rows, *image_rows;
    mxArray parameters[2] = {{config, 0.0}, {NULL, 1.0}};
    SimStruct S = {.parameter_count = 2, .parameters = parameters};
    size_t pressed_at[BLOCK_ACTIONS] = {0};
    clock_t begin;
    require(count == 2, "usage: sfun_driver RECORDING");
    snprintf(config, sizeof config, "%s.toml", arguments[1]);
    is_refused((mxArray[]){{"missing.toml", 0.0}, {NULL, 1.0}}, "File cannot be read: missing.toml");
    is_refused((mxArray[]){{NULL, 1.0}, {NULL, 1.0}}, "name of a file");
    is_refused((mxArray[]){{config, 0.0}, {NULL, 1.5}}, "from 0 to 1");

    mdlInitializeSizes(&S);
    require(S.error == NULL, S.error);
    const size_t n = (size_t)S.inputs.width[REFERENCE], m = (size_t)S.inputs.width[MEASURED];
    const size_t TICK = 3 + 2 * n, IMAGE = 10 + m + 3 * n, answers = 2 + m;
    require(S.outputs.width[COMMAND] == S.inputs.width[REFERENCE], "as many commands as references");
    tick_rows = read_rows(arguments[1], "ticks", TICK, &ticks);
    image_rows = read_rows(arguments[1], "images", IMAGE, &images);
    S.phase = SAMPLE_TIMES;
    mdlInitializeSampleTimes(&S);
    require(S.sample_time == tick_rows[TICK], "the sample time is not the control period");
    S.phase = START;
    mdlStart(&S);
    begin = clock();
    for (size_t tick = 0; tick < ticks && !S.error; ++tick) {
        const double *now = tick_rows + TICK * tick;
        const int event = (int)now[2 + n];
        S.time = now[0];
        memcpy(S.inputs.signal[REFERENCE], now + 2, n * sizeof(double));
        S.inputs.signal[AGE][0] = now[0] - now[1];
        for (int action = 0; action < BLOCK_ACTIONS; ++action) {
            pressed_at[action] = event == action + 1 ? tick : pressed_at[action];
            S.inputs.signal[ACTIONS][action] = pressed_at[action] > 0 && tick < pressed_at[action] + PRESSED;
        }
        parameters[SHARE_PARAMETER].number = event == 4 ? 0.5 : event == 5 ? 1.0 : parameters[SHARE_PARAMETER].number;
        S.phase = OUTPUTS_PHASE;
        mdlOutputs(&S, 0);
        compare(S.outputs.signal[COMMAND], now + 3 + n, n);
        if (image == 0) {
            require(isnan(S.outputs.signal[STATE_ESTIMATE][n - 1]), "an estimate before the first measurement");
        } else {
            const double *last = image_rows + IMAGE * (image - 1);
            compare(S.outputs.signal[STATE], last + answers, 1);
            compare(S.outputs.signal[STATE_ESTIMATE], last + answers + 3, n);
            compare(S.outputs.signal[DELTA_MINUS], last + answers + 3 + n, n);
            compare(S.outputs.signal[DELTA_PLUS], last + answers + 3 + 2 * n, n);
        }
        const int has_image = image < images && (size_t)image_rows[IMAGE * image] == tick;
        memcpy(S.inputs.signal[MEASURED], has_image ? image_rows + IMAGE * image + 2 : nothing, m * sizeof(double));
        S.inputs.signal[CAPTURED_AT][0] = has_image ? image_rows[IMAGE * image + 1] : 0.0;
        S.inputs.signal[HAS_MEASURED][0] = has_image;
        image += (size_t)has_image;
        S.phase = UPDATE;
        mdlUpdate(&S, 0);
    }
    printf("%s: %zu ticks, %zu image updates in %.2f s, %zu numbers unlike Python, largest difference %g\n", arguments[1], ticks,
           image, (double)(clock() - begin) / CLOCKS_PER_SEC, wrong, largest);
    require(S.error == NULL, S.error);
    minus = S.outputs.signal[DELTA_MINUS];
    plus = S.outputs.signal[DELTA_PLUS];
    if (n == 2) { /* two plays of `record_tip` */
        require(fabs(plus[0] - minus[0] - 0.6) < 0.02 && fabs(plus[1] - minus[1] - 8e-3) < 2e-4, "the slack is not found");
    }

    /* A reference that is not finite ends the simulation with the library's message. */
    S.inputs.signal[REFERENCE][1] = NAN;
    S.phase = OUTPUTS_PHASE;
    mdlOutputs(&S, 0);
    require(S.error != NULL && strstr(S.error, "reference") != NULL, "a reference of NaN is not refused");
    S.phase = TERMINATE;
    mdlTerminate(&S);
    mdlTerminate(&S);
    free(tick_rows);
    free(image_rows);
    return ticks == 0 || image != images || wrong > 0;
}
