/* A stand-in for Force Dimension's libdhd: the functions that netboard calls, as dhdc.h 3.17.5 declares them, and two
   devices, an omega.3 and a sigma.7.

   Behaviour follows the SDK's documentation as the forcedimension_core bindings repeat it: -1 and an error of the calling
   thread on failure; TIMEGUARD and no transfer for a position that was read less than the guard ago; MOTOR_SATURATED and a
   scaled force where the motors cannot deliver it; a force limit that also scales; forces only in force mode; a velocity
   only after two positions; gravity compensation on top of each force that is set; serial numbers to open by; -1 with
   DEVICE_IN_USE for a device of another program. A transfer takes 100 us. Each stylus is 0.2 kg on a spring and a damper,
   as if a hand held it. Tests control the library by the functions fake_*, and can make any function fail. */

#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

typedef unsigned char uchar;
typedef unsigned short ushort;
typedef unsigned int uint;

enum { DEVICES = 2, STATUSES = 17, TIMEGUARD = 1, MOTOR_SATURATED = 2 };
enum { NO_ERROR = 0, ERROR_COM = 2, ERROR_NO_DEVICE = 5, ERROR_TIMEOUT = 7, ERROR_NOT_READY = 12, ERROR_INDEX = 15, ERROR_IN_USE = 20 };
enum { POWER, CONNECTED, STARTED, RESET, IDLE, FORCE, BRAKE, GRAVITY = 10, GUARD, OFF_CAUSE = 14 };

static const double MASS = 0.2, STIFFNESS = 150, DAMPING = 10, STEP = 1e-3, GUARD_S = 100e-6, TRANSFER_S = 100e-6;

struct device {
    int serial, type;
    const char *name;
    double motors; /* largest force that the motors can deliver [N] */
    int plugged, powered, used_elsewhere, open, reset, forces, off_cause, braked, gravity, placed, positions;
    uint buttons;
    double limit, x[3], v[3], wanted[3], rendered[3], compensation, moved_s, read_s;
};

static struct device devices[DEVICES];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_mutex_t stall = PTHREAD_MUTEX_INITIALIZER; /* held by a test: transfers wait */
static __thread int last_error;
static char failing[40];
static int failing_code, failing_after, transfers, blind;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void transfer(void) {
    struct timespec taken = {0, (long)(1e9 * TRANSFER_S)};
    pthread_mutex_lock(&stall);
    pthread_mutex_unlock(&stall);
    nanosleep(&taken, NULL);
    transfers++;
}

static int fail(int code) {
    last_error = code;
    return -1;
}

/* Whether this call fails, as requested by fake_fail. */
static int fails(const char *function) {
    if (strcmp(function, failing) || failing_after-- > 0) return 0;
    failing[0] = 0;
    last_error = failing_code;
    return 1;
}

/* An open device; NULL, and an error, if there is none or it was unplugged. */
static struct device *of(char id, const char *function) {
    struct device *d = id >= 0 && id < DEVICES ? &devices[(int)id] : NULL;
    last_error = NO_ERROR;
    if (fails(function)) return NULL;
    if (!d || !d->open) return fail(ERROR_INDEX), NULL;
    if (!d->plugged) return fail(ERROR_COM), NULL;
    return d;
}

static void live(struct device *d) {
    double now = seconds();
    for (; d->moved_s < now; d->moved_s += STEP)
        for (int i = 0; i < 3 && !d->placed; i++) {
            d->v[i] += (d->rendered[i] - STIFFNESS * d->x[i] - DAMPING * d->v[i]) / MASS * STEP;
            d->x[i] += d->v[i] * STEP;
        }
}

static int count(int (*counted)(struct device *)) {
    int found = 0;
    for (int i = 0; i < DEVICES; i++) found += counted(&devices[i]);
    return found;
}

static int is_plugged(struct device *d) { return d->plugged; }
static int is_served(struct device *d) { return d->plugged && d->open; }

/* --- errors and devices -------------------------------------------------------------------------------------------- */

int dhdErrorGetLast(void) { return last_error; }

const char *dhdErrorGetStr(int error) {
    switch (error) {
        case NO_ERROR: return "no error";
        case ERROR_COM: return "communication error";
        case ERROR_NO_DEVICE: return "no device found";
        case ERROR_TIMEOUT: return "timeout";
        case ERROR_IN_USE: return "device already in use";
    }
    return "stand-in error";
}

const char *dhdErrorGetLastStr(void) { return dhdErrorGetStr(last_error); }

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision) {
    *major = 3, *minor = 17, *release = 5, *revision = 0;
}

int dhdGetDeviceCount(void) { return fails("dhdGetDeviceCount") ? -1 : count(is_plugged); }

static int open_device(int i) {
    struct device *d = &devices[i];
    if (d->used_elsewhere) return fail(ERROR_IN_USE);
    if (d->open) return i;
    d->open = 1;
    d->forces = d->positions = 0;
    d->limit = -1;
    d->moved_s = seconds();
    memset(d->wanted, 0, sizeof d->wanted);
    return i;
}

int dhdOpenID(char index) {
    if (fails("dhdOpenID")) return -1;
    for (int i = 0; i < DEVICES; i++)
        if (devices[i].plugged && index-- == 0) return open_device(i);
    return fail(ERROR_NO_DEVICE);
}

int dhdOpenSerial(int serial) {
    if (fails("dhdOpenSerial")) return -1;
    for (int i = 0; i < DEVICES; i++)
        if (devices[i].plugged && devices[i].serial == serial) return open_device(i);
    return fail(ERROR_NO_DEVICE);
}

int dhdClose(char id) {
    if (id < 0 || id >= DEVICES || !devices[(int)id].open) return fail(ERROR_INDEX);
    struct device *d = &devices[(int)id];
    d->open = d->forces = 0;
    memset(d->rendered, 0, sizeof d->rendered);
    return 0;
}

int dhdStop(char id) {
    struct device *d = of(id, "dhdStop");
    if (!d) return -1;
    d->forces = 0, d->braked = 1;
    memset(d->rendered, 0, sizeof d->rendered);
    return 0;
}

int dhdGetSerialNumber(ushort *out, char id) {
    struct device *d = of(id, "dhdGetSerialNumber");
    if (!d || !d->serial) return d ? fail(ERROR_NOT_READY) : -1;
    *out = (ushort)d->serial;
    return 0;
}

int dhdGetSystemType(char id) {
    struct device *d = of(id, "dhdGetSystemType");
    return d ? d->type : -1;
}

const char *dhdGetSystemName(char id) {
    struct device *d = of(id, "dhdGetSystemName");
    return d ? d->name : NULL;
}

int dhdGetVersion(double *out, char id) {
    if (!of(id, "dhdGetVersion")) return -1;
    *out = 3.2;
    return 0;
}

int dhdGetEffectorMass(double *out, char id) {
    if (!of(id, "dhdGetEffectorMass")) return -1;
    *out = 0.19;
    return 0;
}

int dhdGetStatus(int *out, char id) {
    struct device *d = of(id, "dhdGetStatus");
    if (!d) return -1;
    memset(out, 0, STATUSES * sizeof *out);
    out[POWER] = d->powered, out[CONNECTED] = out[STARTED] = out[GUARD] = 1;
    out[RESET] = d->reset, out[FORCE] = d->forces, out[BRAKE] = d->braked, out[GRAVITY] = d->gravity;
    out[OFF_CAUSE] = d->off_cause;
    return 0;
}

int dhdEnableForce(uchar on, char id) {
    struct device *d = of(id, "dhdEnableForce");
    if (!d) return -1;
    d->forces = on, d->braked = !on;
    if (on) d->off_cause = 0;
    return 0;
}

int dhdSetGravityCompensation(int on, char id) {
    struct device *d = of(id, "dhdSetGravityCompensation");
    if (!d) return -1;
    d->gravity = on;
    return 0;
}

int dhdSetMaxForce(double limit, char id) {
    struct device *d = of(id, "dhdSetMaxForce");
    if (!d) return -1;
    d->limit = limit;
    return 0;
}

/* --- the servo loop ------------------------------------------------------------------------------------------------ */

int dhdGetPosition(double *x, double *y, double *z, char id) {
    struct device *d = of(id, "dhdGetPosition");
    if (!d) return -1;
    int recent = d->positions && seconds() - d->read_s < GUARD_S;
    if (!recent) transfer();
    pthread_mutex_lock(&lock);
    if (!recent) {
        live(d);
        d->read_s = seconds();
        d->positions++;
    }
    *x = d->x[0], *y = d->x[1], *z = d->x[2];
    pthread_mutex_unlock(&lock);
    return recent ? TIMEGUARD : 0;
}

int dhdGetLinearVelocity(double *x, double *y, double *z, char id) {
    struct device *d = of(id, "dhdGetLinearVelocity");
    if (!d) return -1;
    if (d->positions < 2 || blind) return fail(ERROR_TIMEOUT);
    pthread_mutex_lock(&lock);
    *x = d->v[0], *y = d->v[1], *z = d->v[2];
    pthread_mutex_unlock(&lock);
    return 0;
}

uint dhdGetButtonMask(char id) {
    struct device *d = of(id, "dhdGetButtonMask");
    return d ? d->buttons : 0;
}

int dhdSetForce(double x, double y, double z, char id) {
    struct device *d = of(id, "dhdSetForce");
    if (!d) return -1;
    transfer();
    double size = sqrt(x * x + y * y + z * z), most = d->limit >= 0 ? fmin(d->limit, d->motors) : d->motors;
    double share = size > most ? most / size : 1;
    pthread_mutex_lock(&lock);
    live(d);
    double wanted[3] = {share * x, share * y, share * z};
    for (int i = 0; i < 3; i++) d->rendered[i] = d->forces ? wanted[i] : 0;
    d->compensation = d->forces && d->gravity ? 0.19 * 9.81 : 0;
    pthread_mutex_unlock(&lock);
    return size > d->motors ? MOTOR_SATURATED : 0;
}

/* --- for the tests ------------------------------------------------------------------------------------------------- */

static struct device *fake(int serial) {
    for (int i = 0; i < DEVICES; i++)
        if (devices[i].serial == serial) return &devices[i];
    return NULL;
}

void fake_reset(void) {
    memset(devices, 0, sizeof devices);
    devices[0] = (struct device){.serial = 11311, .type = 33, .name = "omega.3", .motors = 14};
    devices[1] = (struct device){.serial = 20202, .type = 104, .name = "sigma.7", .motors = 20};
    for (int i = 0; i < DEVICES; i++) devices[i].plugged = devices[i].powered = devices[i].gravity = 1;
    failing[0] = 0;
    blind = 0;
    failing_after = 0;
}

void fake_plug(int serial, int in) { fake(serial)->plugged = in; }
void fake_power(int serial, int on) { fake(serial)->powered = on; }
void fake_use_elsewhere(int serial, int on) { fake(serial)->used_elsewhere = on; }
void fake_uncalibrate(int serial, int on) { fake(serial)->reset = on; }
void fake_press(int serial, uint buttons) { fake(serial)->buttons = buttons; }
void fake_type(int serial, int type) { fake(serial)->type = type; }
void fake_hide_serial(int serial) { fake(serial)->serial = 0; }
int fake_open(int serial) { return fake(serial)->open; }
int fake_braked(int serial) { return fake(serial)->braked; }
int fake_forces(int serial) { return fake(serial)->forces; }
int fake_served(void) { return count(is_served); }
int fake_transfers(void) { return transfers; }
double fake_limit(int serial) { return fake(serial)->limit; }
double fake_compensation(int serial) { return fake(serial)->compensation; }

/* The controller switches the forces off, as above a velocity. */
void fake_force_off(int serial, int cause) {
    struct device *d = fake(serial);
    pthread_mutex_lock(&lock);
    d->forces = 0, d->braked = 1, d->off_cause = cause;
    memset(d->rendered, 0, sizeof d->rendered);
    pthread_mutex_unlock(&lock);
}

/* Let transfers wait, or go on. */
void fake_stall(int on) {
    if (on)
        pthread_mutex_lock(&stall);
    else
        pthread_mutex_unlock(&stall);
}

void fake_place(int serial, const double x[3], const double v[3]) {
    struct device *d = fake(serial);
    pthread_mutex_lock(&lock);
    d->placed = 1;
    memcpy(d->x, x, sizeof d->x);
    memcpy(d->v, v, sizeof d->v);
    pthread_mutex_unlock(&lock);
}

void fake_motor_force(int serial, double out[3]) {
    pthread_mutex_lock(&lock);
    memcpy(out, fake(serial)->rendered, 3 * sizeof *out);
    pthread_mutex_unlock(&lock);
}

/* Make a function fail once, after a number of calls that succeed. */
/* Whether the velocity is never known. */
void fake_blind(int is) { blind = is; }

void fake_fail(const char *function, int code, int after) {
    failing_code = code;
    failing_after = after;
    snprintf(failing, sizeof failing, "%s", function);
}
