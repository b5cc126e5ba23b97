/* A stand-in for the vendor's libHD: the same ABI, a servo thread at 1 kHz, and two simulated devices.

   Each device has a stylus of 45 g on a spring and a damper, as if a hand held it, which sways up and down by SWAY, in mm. The rules of frames, handles, names and the scheduler are checked; a violation puts
   an error on the stack. Tests control the library by the functions fake_*, read the log of calls, and can make any
   function fail. The library does not depend on netboard. `netboard bench loop --device touch` uses it, too. */

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef uint32_t HHD, HDenum, HDerror;
typedef uint32_t (*Callback)(void *);
typedef struct {
    HDerror code;
    int32_t internal;
    HHD handle;
} HDErrorInfo;

enum { DEVICES = 2, JOBS = 16, STACK = 256, LOG_SIZE = 1 << 16, SWITCHES = 8 };
enum { INVALID_HANDLE = 0xFFFFFFFF };
enum {
    INVALID_ENUM = 0x0100, INVALID_VALUE = 0x0101, INVALID_OPERATION = 0x0102, BAD_HANDLE = 0x0104,
    EXCEEDED_MAX_FORCE = 0x0201, DEVICE_FAULT = 0x0300, ALREADY_INITIATED = 0x0301, COMM_ERROR = 0x0302,
    ILLEGAL_BEGIN = 0x0400, ILLEGAL_END = 0x0401, FRAME_ERROR = 0x0402, SCHEDULER_FULL = 0x0501
};
enum { FORCE_OUTPUT = 0x4000, CLAMPING, RAMPING, FORCE_LIMIT, ONE_FRAME, VELOCITY_LIMIT = 0x2606, IMPULSE_LIMIT = 0x2607 };
enum { CALIBRATION_OK = 0x5000, NEEDS_UPDATE, NEEDS_MANUAL_INPUT, STYLE_INKWELL = 4 };

static const double MASS = 0.045, STIFFNESS = 150, DAMPING = 5, STEP = 1e-3, SWAY_HZ = 0.5, MOST = 3.3, LASTING = 0.88;

struct device {
    const char *name, *serial, *model;
    int plugged, open, docked, buttons, state, style, frames, framed, placed;
    HHD handle;
    double rest[3], x[3], v[3], wanted[3], rendered[3]; /* mm, mm/s, N */
    int on[SWITCHES];
};

struct job {
    Callback callback;
    void *data;
    unsigned priority;
    unsigned long handle;
};

static struct device devices[DEVICES];
static struct job jobs[JOBS];
static HDErrorInfo stack[STACK];
static int stacked, current = -1, stalled, pinned_errors, refuses_null;
static unsigned long next_job = 1;
static HHD next_handle = 1;
static volatile int running;
static volatile long ticks;
static pthread_t servo;
static volatile int stepping; /* a test runs a tick of the servo */
#ifndef SWAY
#define SWAY 0
#endif
static double sway = SWAY; /* amplitude of the hand [mm] */
static int in_servo_thread(void) { return running && (stepping || pthread_equal(pthread_self(), servo)); }

static pthread_mutex_t lock; /* recursive; never held while a callback runs */
static pthread_mutex_t ticking = PTHREAD_MUTEX_INITIALIZER; /* held while a tick runs */
static char call_log[LOG_SIZE];
static size_t logged;
static char failing[64];
static HDerror failing_code;
static int failing_after;
static double began;

static void init_lock(void) __attribute__((constructor));
void fake_reset(void);

static void init_lock(void) {
    pthread_mutexattr_t how;
    pthread_mutexattr_init(&how);
    pthread_mutexattr_settype(&how, PTHREAD_MUTEX_RECURSIVE);
    pthread_mutex_init(&lock, &how);
    fake_reset();
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void log_call(const char *form, ...) {
    va_list words;
    va_start(words, form);
    if (logged + 100 < LOG_SIZE) {
        logged += vsnprintf(call_log + logged, 99, form, words);
        call_log[logged++] = '\n';
        call_log[logged] = 0;
    }
    va_end(words);
}

static void push(HDerror code, int32_t internal, HHD handle) {
    if (stacked < STACK) stack[stacked++] = (HDErrorInfo){code, internal, handle};
}

static HHD current_handle(void) { return current < 0 ? INVALID_HANDLE : devices[current].handle; }

static struct device *of(HHD handle) {
    for (int i = 0; i < DEVICES; i++)
        if (devices[i].open && devices[i].handle == handle) return &devices[i];
    push(BAD_HANDLE, 0, handle);
    return NULL;
}

static struct device *now(void) {
    if (current >= 0) return &devices[current];
    push(INVALID_OPERATION, 0, INVALID_HANDLE);
    return NULL;
}

/* Whether this call fails, as requested by fake_fail; pushes the error. */
static int fails(const char *function) {
    if (strcmp(function, failing) || failing_after-- > 0) return 0;
    failing[0] = 0;
    push(failing_code, -7, current_handle());
    return 1;
}

#define ENTER pthread_mutex_lock(&lock)
#define LEAVE pthread_mutex_unlock(&lock)

/* --- errors ----------------------------------------------------------------------------------------------------- */

HDErrorInfo hdGetError(void) {
    ENTER;
    HDErrorInfo none = {0, 0, INVALID_HANDLE}, top = stacked ? stack[--stacked] : none;
    if (pinned_errors) top = (HDErrorInfo){DEVICE_FAULT, 1, current_handle()};
    LEAVE;
    return top;
}

const char *hdGetErrorString(HDerror code) { return code == 0x0200 ? "the motors are warm" : "fake library error"; }

/* --- devices ---------------------------------------------------------------------------------------------------- */

HHD hdInitDevice(const char *name) {
    ENTER;
    HHD found = INVALID_HANDLE;
    if (running) push(INVALID_OPERATION, 1, INVALID_HANDLE);
    for (int i = 0; i < DEVICES && found == INVALID_HANDLE; i++) {
        struct device *d = &devices[i];
        if (name ? strcmp(name, d->name) : refuses_null || !d->plugged) continue;
        if (!d->plugged) break;
        if (d->open) {
            push(ALREADY_INITIATED, 0, d->handle);
            LEAVE;
            return d->handle;
        }
        d->open = 1;
        d->handle = found = next_handle++;
        d->frames = d->framed = 0;
        memset(d->on, 0, sizeof d->on);
        memset(d->wanted, 0, sizeof d->wanted);
        d->on[ONE_FRAME - FORCE_OUTPUT] = 1;
        current = i;
        log_call("init %s", d->serial);
    }
    if (found == INVALID_HANDLE) push(DEVICE_FAULT, -28, INVALID_HANDLE);
    fails("hdInitDevice");
    LEAVE;
    return found;
}

void hdDisableDevice(HHD handle) {
    ENTER;
    struct device *d = of(handle);
    fails("hdDisableDevice");
    if (d) {
        log_call("disable %s", d->serial);
        d->open = 0;
        memset(d->wanted, 0, sizeof d->wanted);
        memset(d->rendered, 0, sizeof d->rendered);
        if (current >= 0 && d == &devices[current]) current = -1;
    }
    LEAVE;
}

void hdMakeCurrentDevice(HHD handle) {
    ENTER;
    struct device *d = of(handle);
    if (d) current = (int)(d - devices);
    fails("hdMakeCurrentDevice");
    LEAVE;
}

HHD hdGetCurrentDevice(void) { return current_handle(); }

void hdBeginFrame(HHD handle) {
    ENTER;
    struct device *d = of(handle);
    if (d) {
        current = (int)(d - devices);
        if (running && !in_servo_thread()) push(ILLEGAL_BEGIN, 2, handle);
        if (!d->frames && d->framed && d->on[ONE_FRAME - FORCE_OUTPUT]) push(ILLEGAL_BEGIN, 1, handle);
        if (!d->plugged) push(COMM_ERROR, -28, handle);
        d->frames++;
        fails("hdBeginFrame");
    }
    LEAVE;
}

static void take_force(struct device *d) {
    double size = sqrt(d->wanted[0] * d->wanted[0] + d->wanted[1] * d->wanted[1] + d->wanted[2] * d->wanted[2]), share = 1;
    if (size > MOST * (1 + 1e-9)) {
        if (d->on[FORCE_LIMIT - FORCE_OUTPUT]) push(EXCEEDED_MAX_FORCE, 0, d->handle);
        if (d->on[CLAMPING - FORCE_OUTPUT]) share = MOST / size;
    }
    int was = d->rendered[0] || d->rendered[1] || d->rendered[2];
    for (int i = 0; i < 3; i++) d->rendered[i] = d->on[0] && d->plugged ? share * d->wanted[i] : 0;
    int is = d->rendered[0] || d->rendered[1] || d->rendered[2];
    if (was != is) log_call(is ? "force %s" : "zero %s", d->serial);
}

void hdEndFrame(HHD handle) {
    ENTER;
    struct device *d = of(handle);
    if (d && !d->frames)
        push(ILLEGAL_END, 0, handle);
    else if (d && !--d->frames) {
        d->framed = 1;
        take_force(d);
        fails("hdEndFrame");
    }
    LEAVE;
}

/* --- properties of a device ------------------------------------------------------------------------------------- */

static int switch_of(HDenum what) {
    if (what >= FORCE_OUTPUT && what <= ONE_FRAME) return (int)(what - FORCE_OUTPUT);
    if (what == VELOCITY_LIMIT || what == IMPULSE_LIMIT) return (int)(what - VELOCITY_LIMIT) + 5;
    push(INVALID_ENUM, 0, current_handle());
    return SWITCHES - 1;
}

static void set_switch(const char *function, HDenum what, int on) {
    ENTER;
    struct device *d = now();
    int failed = fails(function);
    if (d && !failed) d->on[switch_of(what)] = on;
    LEAVE;
}

void hdEnable(HDenum what) { set_switch("hdEnable", what, 1); }
void hdDisable(HDenum what) { set_switch("hdDisable", what, 0); }

uint8_t hdIsEnabled(HDenum what) {
    ENTER;
    struct device *d = now();
    uint8_t on = d ? (uint8_t)d->on[switch_of(what)] : 0;
    LEAVE;
    return on;
}

/* Write the numeric values of a parameter; return how many. */
static int numbers(struct device *d, HDenum what, double *out) {
    static const double usable[6] = {-80, -60, -35, 80, 60, 35}, all[6] = {-210, -110, -85, 210, 205, 130};
    if (what >= 0x2000 && what < 0x2200 && !d->frames) push(FRAME_ERROR, 0, d->handle);
    const double *three = what == 0x2050 ? d->x : what == 0x2051 ? d->v : what == 0x2700 ? d->rendered : NULL;
    const double *six = what == 0x2550 ? all : what == 0x2551 ? usable : NULL;
    if (three || six) {
        memcpy(out, three ? three : six, (three ? 3 : 6) * sizeof *out);
        return three ? 3 : 6;
    }
    switch (what) {
        case 0x2000: *out = d->buttons; return 1;
        case 0x2002: *out = d->docked; return 1;
        case 0x2555: *out = d->style; return 1;
        case 0x2600: case 0x2601: *out = 1000; return 1;
        case 0x2602: *out = 0.5; return 1;
        case 0x2603: *out = MOST; return 1;
        case 0x2604: *out = LASTING; return 1;
        case 0x2606: *out = 850; return 1;
        case 0x2607: *out = 0.05; return 1;
        case 0x2608: *out = 33; return 1;
    }
    push(INVALID_ENUM, 0, d->handle);
    return 0;
}

#define GETTER(Name, Type)                                              \
    void hdGet##Name##v(HDenum what, Type *out) {                       \
        double found[6];                                                \
        ENTER;                                                          \
        struct device *d = now();                                       \
        int count = d && !fails("hdGet" #Name "v") ? numbers(d, what, found) : 0; \
        for (int i = 0; i < count; i++) out[i] = (Type)found[i];        \
        LEAVE;                                                          \
    }
GETTER(Boolean, uint8_t)
GETTER(Integer, int32_t)
GETTER(Float, float)
GETTER(Double, double)
GETTER(Long, long)

const char *hdGetString(HDenum what) {
    ENTER;
    struct device *d = now();
    const char *found = NULL;
    if (d && !fails("hdGetString")) {
        switch (what) {
            case 0x2500: found = "3.30.0"; break;
            case 0x2501: found = d->model; break;
            case 0x2502: found = "4.3.2"; break;
            case 0x2503: found = "fake vendor"; break;
            case 0x2504: found = d->serial; break;
            case 0x2505: found = "1.9"; break;
            default: push(INVALID_ENUM, 0, d->handle);
        }
    }
    LEAVE;
    return found;
}

void hdSetDoublev(HDenum what, const double *in) {
    ENTER;
    struct device *d = now();
    if (d && what != 0x2700)
        push(INVALID_ENUM, 0, d->handle);
    else if (d && (!d->frames || (running && !in_servo_thread())))
        push(FRAME_ERROR, 0, d->handle); /* a force is allowed only within a frame */
    else if (d && !fails("hdSetDoublev"))
        memcpy(d->wanted, in, sizeof d->wanted);
    LEAVE;
}

#define NO_SETTER(Name, Type)                               \
    void hdSet##Name##v(HDenum what, const Type *in) {      \
        (void)what, (void)in;                               \
        ENTER;                                              \
        push(INVALID_ENUM, 0, current_handle());            \
        LEAVE;                                              \
    }
NO_SETTER(Boolean, uint8_t)
NO_SETTER(Integer, int32_t)
NO_SETTER(Float, float)
NO_SETTER(Long, long)

/* --- calibration ------------------------------------------------------------------------------------------------ */

HDenum hdCheckCalibration(void) {
    ENTER;
    struct device *d = now();
    if (d && d->style == STYLE_INKWELL && !running) push(INVALID_OPERATION, 0, d->handle);
    HDenum state = d && !fails("hdCheckCalibration") ? (HDenum)d->state : NEEDS_MANUAL_INPUT;
    LEAVE;
    return state;
}

HDenum hdCheckCalibrationStyle(void) {
    ENTER;
    struct device *d = now();
    HDenum style = d ? (HDenum)d->style : 0;
    LEAVE;
    return style;
}

void hdUpdateCalibration(HDenum style) {
    ENTER;
    struct device *d = now();
    if (d && !fails("hdUpdateCalibration")) {
        log_call("calibrate %s %u%s", d->serial, style, d->on[0] ? " with force" : "");
        if (d->state == NEEDS_UPDATE && ((unsigned)d->style & style))
            d->state = CALIBRATION_OK;
        else
            push(INVALID_OPERATION, 0, d->handle);
    }
    LEAVE;
}

/* --- scheduler -------------------------------------------------------------------------------------------------- */

static void live(struct device *d) {
    if (sway) d->rest[1] = sway * sin(2 * M_PI * SWAY_HZ * STEP * (double)ticks);
    for (int i = 0; i < 3; i++) {
        if (d->placed) break;
        double force = d->rendered[i] - 1e-3 * (STIFFNESS * (d->x[i] - d->rest[i]) + DAMPING * d->v[i]);
        d->v[i] += 1e3 * force / MASS * STEP;
        d->x[i] += d->v[i] * STEP;
    }
}

static void tick(void) {
    struct job due[JOBS];
    int count = 0;
    ENTER;
    began = seconds();
    for (int i = 0; i < DEVICES; i++) {
        live(&devices[i]);
        devices[i].framed = 0;
    }
    for (int i = 0; i < JOBS; i++) {
        if (!jobs[i].callback) continue;
        int at = count++;
        for (; at > 0 && due[at - 1].priority < jobs[i].priority; at--) due[at] = due[at - 1];
        due[at] = jobs[i];
    }
    LEAVE;
    for (int i = 0; i < count; i++) {
        uint32_t after = due[i].callback(due[i].data);
        ENTER;
        for (int j = 0; after == 0 && j < JOBS; j++)
            if (jobs[j].handle == due[i].handle) jobs[j] = (struct job){0};
        LEAVE;
    }
    ticks++;
}

static void *serve(void *nothing) {
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    while (running) {
        due.tv_nsec += 1000000;
        if (due.tv_nsec >= 1000000000) due.tv_sec++, due.tv_nsec -= 1000000000;
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {}
        pthread_mutex_lock(&ticking);
        if (!stalled) tick();
        pthread_mutex_unlock(&ticking);
        double behind = seconds() - (due.tv_sec + 1e-9 * due.tv_nsec);
        if (behind > 0.02) clock_gettime(CLOCK_MONOTONIC, &due);
    }
    return nothing;
}

void hdStartScheduler(void) {
    ENTER;
    if (running)
        push(INVALID_OPERATION, 0, INVALID_HANDLE);
    else if (!fails("hdStartScheduler")) {
        log_call("start");
        running = 1;
        pthread_create(&servo, NULL, serve, NULL);
    }
    LEAVE;
}

void hdStopScheduler(void) {
    ENTER;
    int was = running;
    running = 0;
    if (was) log_call("stop");
    fails("hdStopScheduler");
    LEAVE;
    if (was) pthread_join(servo, NULL);
}

void hdSetSchedulerRate(unsigned long rate) {
    if (rate != 1000) push(INVALID_VALUE, 0, INVALID_HANDLE);
}

unsigned long hdScheduleAsynchronous(Callback callback, void *data, uint16_t priority) {
    ENTER;
    unsigned long handle = 0;
    if (!fails("hdScheduleAsynchronous")) {
        for (int i = 0; i < JOBS && !handle; i++)
            if (!jobs[i].callback) jobs[i] = (struct job){callback, data, priority, handle = next_job++};
        if (!handle) push(SCHEDULER_FULL, 0, INVALID_HANDLE);
        if (priority != 65535) log_call("schedule");
    }
    LEAVE;
    return handle;
}

void hdScheduleSynchronous(Callback callback, void *data, uint16_t priority) {
    (void)priority;
    callback(data);
}

static int has(unsigned long handle) {
    for (int i = 0; i < JOBS; i++)
        if (handle && jobs[i].handle == handle) return i + 1;
    return 0;
}

void hdUnschedule(unsigned long handle) {
    ENTER;
    int at = has(handle);
    fails("hdUnschedule");
    log_call("unschedule%s", running ? " while running" : "");
    if (at)
        jobs[at - 1] = (struct job){0};
    else
        push(INVALID_VALUE, 0, INVALID_HANDLE);
    LEAVE;
}

uint8_t hdWaitForCompletion(unsigned long handle, uint32_t how) {
    ENTER;
    uint8_t waits = how == 0 && has(handle);
    LEAVE;
    return waits;
}

double hdGetSchedulerTimeStamp(void) { return seconds() - began; }

/* --- for the tests ---------------------------------------------------------------------------------------------- */

static struct device *fake(const char *serial) {
    for (int i = 0; i < DEVICES; i++)
        if (!strcmp(devices[i].serial, serial)) return &devices[i];
    return NULL;
}

void fake_reset(void) {
    hdStopScheduler();
    ENTER;
    memset(devices, 0, sizeof devices);
    memset(jobs, 0, sizeof jobs);
    devices[0] = (struct device){.name = "Default Device", .serial = "40512001", .model = "Touch"};
    devices[1] = (struct device){.name = "Right Device", .serial = "40512002", .model = "Touch X"};
    for (int i = 0; i < DEVICES; i++) {
        devices[i].plugged = getenv("FAKE_LIBHD_UNPLUGGED") == NULL;
        devices[i].state = CALIBRATION_OK;
        devices[i].style = STYLE_INKWELL;
    }
    stacked = stalled = pinned_errors = refuses_null = failing_after = 0;
    logged = 0;
    call_log[0] = failing[0] = 0;
    current = -1;
    LEAVE;
}

long fake_ticks(void) { return ticks; }
int fake_running(void) { return running; }

/* Stop the ticks, or let them go on; no tick runs when this returns. */
void fake_stall(int on) {
    pthread_mutex_lock(&ticking);
    stalled = on;
    pthread_mutex_unlock(&ticking);
}

void fake_sway(double amplitude) { sway = amplitude; }

/* Count the ticks of a stalled servo from 0, with all styluses at rest at their origins. */
void fake_restart(void) {
    ENTER;
    ticks = 0;
    for (int i = 0; i < DEVICES; i++) {
        memset(devices[i].x, 0, sizeof devices[i].x);
        memset(devices[i].v, 0, sizeof devices[i].v);
        memset(devices[i].rest, 0, sizeof devices[i].rest);
    }
    LEAVE;
}

/* Run one tick of a stalled servo in this thread. */
void fake_step(void) {
    pthread_mutex_lock(&ticking);
    stepping = 1;
    tick();
    stepping = 0;
    pthread_mutex_unlock(&ticking);
}

void fake_refuse_null(int on) { refuses_null = on; }
void fake_pin_errors(int on) { pinned_errors = on; }
char fake_decimal_point(void) { return localeconv()->decimal_point[0]; }
void fake_name(const char *serial, const char *name) { fake(serial)->name = name; }
void fake_dock(const char *serial, int on) { fake(serial)->docked = on; }
void fake_press(const char *serial, int buttons) { fake(serial)->buttons = buttons; }
int fake_open(const char *serial) { return fake(serial)->open; }
HHD fake_handle(const char *serial) { return fake(serial)->handle; }
int fake_enabled(const char *serial, HDenum what) { return fake(serial)->on[switch_of(what)]; }

int fake_jobs(void) {
    int count = 0;
    for (int i = 0; i < JOBS; i++) count += jobs[i].callback != NULL;
    return count;
}

void fake_calibration(const char *serial, int state, int style) {
    ENTER;
    fake(serial)->state = state;
    fake(serial)->style = style;
    LEAVE;
}

/* Unplugging loses the calibration; a replugged stylus is in its inkwell. */
void fake_plug(const char *serial, int in) {
    ENTER;
    fake(serial)->plugged = in;
    fake(serial)->state = NEEDS_UPDATE;
    LEAVE;
}

/* Fix the reported position and velocity of a stylus. */
void fake_place(const char *serial, const double x[3], const double v[3]) {
    ENTER;
    struct device *d = fake(serial);
    d->placed = 1;
    memcpy(d->x, x, sizeof d->x);
    memcpy(d->v, v, sizeof d->v);
    LEAVE;
}

void fake_motor_force(const char *serial, double out[3]) {
    ENTER;
    memcpy(out, fake(serial)->rendered, 3 * sizeof *out);
    LEAVE;
}

void fake_error(HDerror code, int32_t internal, HHD handle) {
    ENTER;
    push(code, internal, handle);
    LEAVE;
}

/* Make a function fail once, after a number of calls that succeed. */
void fake_fail(const char *function, HDerror code, int after) {
    ENTER;
    snprintf(failing, sizeof failing, "%s", function);
    failing_code = code;
    failing_after = after;
    LEAVE;
}

/* Return the calls since the previous request, one per line. */
void fake_call_log(char *out, size_t room) {
    ENTER;
    snprintf(out, room, "%s", call_log);
    logged = 0;
    call_log[0] = 0;
    LEAVE;
}
