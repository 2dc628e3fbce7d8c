/* An FMU for co-simulation, FMI 2.0, that makes the trouble it is asked for.  modelDescription.xml: bench.xml.

   y = gain * u, count: steps, off = not on, whole = n, seconds: its time, length: of the text `label`. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void *Component;
typedef unsigned int Reference;
typedef int Status;
enum { OK, WARNING, DISCARD, ERROR };
enum { NONE, CRASH, HANG, GATED, REFUSE, NOT_A_NUMBER, EXIT, LAST };

typedef struct {
    double u, gain, seconds, length;
    int n, count, trouble, at, on;
} State;

typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static State state = {.gain = 1.0};
static Callbacks callbacks;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const names[]) { return OK; }

Component fmi2Instantiate(const char *name, int kind, const char *guid, const char *where, const Callbacks *given,
                          int visible, int logs) {
    callbacks = *given;
    return strcmp(guid, "bench") == 0 ? &state : NULL;
}
void fmi2FreeInstance(Component c) {}
Status fmi2SetupExperiment(Component c, int tolerance, double value, double start, int stops, double stop) { return OK; }
Status fmi2EnterInitializationMode(Component c) { return state.at < 0 && state.trouble == REFUSE ? ERROR : OK; }
Status fmi2ExitInitializationMode(Component c) { return OK; }
Status fmi2Terminate(Component c) {
    const char *place = getenv("PNFARM_TEST_TERMINATED");
    return place && symlink("terminated", place) ? ERROR : OK;
}
Status fmi2Reset(Component c) { return OK; }

static double y(void) { return state.trouble == NOT_A_NUMBER && state.count >= state.at ? NAN : state.gain * state.u; }

Status fmi2GetReal(Component c, const Reference r[], size_t n, double v[]) {
    for (size_t i = 0; i < n; i++) v[i] = r[i] == 2 ? y() : r[i] == 10 ? state.seconds : state.length;
    return OK;
}
Status fmi2GetInteger(Component c, const Reference r[], size_t n, int v[]) {
    for (size_t i = 0; i < n; i++) v[i] = r[i] == 3 ? state.count : state.n;
    return OK;
}
Status fmi2GetBoolean(Component c, const Reference r[], size_t n, int v[]) {
    for (size_t i = 0; i < n; i++) v[i] = !state.on;
    return OK;
}
Status fmi2GetString(Component c, const Reference r[], size_t n, const char *v[]) { return ERROR; }
Status fmi2SetReal(Component c, const Reference r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) *(r[i] == 1 ? &state.u : &state.gain) = v[i];
    return OK;
}
Status fmi2SetInteger(Component c, const Reference r[], size_t n, const int v[]) {
    for (size_t i = 0; i < n; i++) *(r[i] == 7 ? &state.n : r[i] == 8 ? &state.trouble : &state.at) = v[i];
    return OK;
}
Status fmi2SetBoolean(Component c, const Reference r[], size_t n, const int v[]) {
    for (size_t i = 0; i < n; i++) state.on = v[i];
    return OK;
}
Status fmi2SetString(Component c, const Reference r[], size_t n, const char *const v[]) {
    for (size_t i = 0; i < n; i++) state.length = (double)strlen(v[i]);
    return OK;
}

Status fmi2DoStep(Component c, double time, double step, int final) {
    if (state.count >= state.at) switch (state.trouble) {
        case CRASH: abort();
        case HANG: for (;;) pause();
        case GATED: while (access(getenv("PNFARM_TEST_GATE"), F_OK)) usleep(1000); break;
        case REFUSE: callbacks.logger(NULL, "bench", ERROR, "logStatusError", "the press is %s", "jammed"); return ERROR;
        case EXIT: _exit(3);
    }
    if (final) { callbacks.logger(NULL, "bench", ERROR, "logStatusError", "no state can be put back"); return ERROR; }
    if (fabs(time - state.seconds) > 1e-9) return ERROR;
    state.seconds = time + step;
    state.count++;
    return state.trouble == LAST && state.count == state.at ? DISCARD : OK;
}

Status fmi2GetFMUstate(Component c, void **v) {
    *v = malloc(sizeof state);
    memcpy(*v, &state, sizeof state);
    return OK;
}
Status fmi2SetFMUstate(Component c, void *v) { memcpy(&state, v, sizeof state); return OK; }
Status fmi2FreeFMUstate(Component c, void **v) { free(*v); *v = NULL; return OK; }
Status fmi2SerializedFMUstateSize(Component c, void *v, size_t *n) { *n = sizeof state; return OK; }
Status fmi2SerializeFMUstate(Component c, void *v, char octets[], size_t n) { memcpy(octets, v, n); return OK; }
Status fmi2DeSerializeFMUstate(Component c, const char octets[], size_t n, void **v) {
    if (n != sizeof state) return ERROR;
    *v = malloc(n);
    memcpy(*v, octets, n);
    return OK;
}

Status fmi2GetBooleanStatus(Component c, int kind, int *value) {
    *value = kind == 3;
    return OK;
}

/* never called */
#define UNUSED(name) Status name(void) { return ERROR; }
UNUSED(fmi2GetDirectionalDerivative)
UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2CancelStep)
UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus)
UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetStringStatus)
