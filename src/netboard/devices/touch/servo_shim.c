/* The servo callback in C, so that no Python runs in the servo thread, and a watch over any servo callback.

   It calls the vendor's functions by addresses that it is given, so compiling it needs none of the vendor's files. A
   tick does the same as PythonServo in servo.py: read, take the force, write it, take errors, publish.

   Samples go from the servo thread to Python or to compiled kernels, forces from those to the servo thread, each through a ring buffer with
   one writer. The reader takes the newest slot, and reads again if the writer has overwritten it meanwhile. So neither
   side ever waits for the other, whatever the scheduler does with their threads. */

#include <math.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

enum { SLOTS = 16, WORDS = 9, FAULTS = 256, MOST_ERRORS = 64, TRIES = 8 }; /* FAULTS: KEPT_FAULTS in servo.py */
enum { MACHINE_CLOCK = -1 };
enum { CALLBACK_DONE = 0, CALLBACK_CONTINUE = 1 };
enum {
    CURRENT_BUTTONS = 0x2000,
    CURRENT_INKWELL_SWITCH = 0x2002,
    CURRENT_POSITION = 0x2050,
    CURRENT_VELOCITY = 0x2051,
    CURRENT_FORCE = 0x2700
};

#define ERRORS_LOST 0xFFFF0000u /* in api.py, as is this: */
#define INVALID_HANDLE 0xFFFFFFFFu

struct error_info {
    uint32_t code;
    int32_t internal;
    uint32_t handle;
};

struct library { /* function addresses; Calls in shim.py */
    void (*begin_frame)(uint32_t);
    void (*end_frame)(uint32_t);
    void (*get_doubles)(uint32_t, double *);
    void (*get_integers)(uint32_t, int32_t *);
    void (*get_booleans)(uint32_t, uint8_t *);
    void (*set_doubles)(uint32_t, const double *);
    struct error_info (*get_error)(void);
};

struct sample { /* SAMPLE in access.py */
    int64_t tick;
    int64_t stamp_ns;
    double position[3];
    double velocity[3];
    int32_t buttons;
    int16_t docked;
    int16_t cut;
};

struct force {
    double f[3];
    int64_t stamp_ns;
};

struct ring {
    _Atomic uint64_t newest; /* number of the newest entry, from 1; 0 if empty */
    _Atomic uint64_t words[SLOTS][WORDS];
};

struct servo {
    struct library hd;
    int64_t simulated_ns; /* simulated time, or MACHINE_CLOCK */
    uint32_t handle;
    int64_t timeout_ns;
    int64_t ticks;
    int cut;
    _Atomic int closing; /* 1: only zero is rendered from now on */
    struct force force;  /* last one taken from the ring */
    struct ring samples, forces;
    _Atomic uint64_t faults_made;
    uint64_t faults_taken;
    _Atomic uint32_t faults[FAULTS][3]; /* as in struct error_info */
};

_Static_assert(sizeof(struct sample) == 8 * WORDS, "a sample fills a slot");
_Static_assert(sizeof(struct force) <= 8 * WORDS, "a force fits into a slot");

static int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now); /* the clock of Python's time.monotonic_ns */
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int64_t time_of(const struct servo *servo) {
    return servo->simulated_ns == MACHINE_CLOCK ? now_ns() : servo->simulated_ns;
}

static void put(struct ring *ring, const void *content, size_t words) {
    uint64_t number = atomic_load_explicit(&ring->newest, memory_order_relaxed) + 1, copy[WORDS];
    _Atomic uint64_t *slot = ring->words[number % SLOTS];
    memcpy(copy, content, 8 * words);
    atomic_thread_fence(memory_order_release); /* who sees a word of this entry also sees the previous number */
    for (size_t i = 0; i < words; i++) atomic_store_explicit(&slot[i], copy[i], memory_order_relaxed);
    atomic_store_explicit(&ring->newest, number, memory_order_release);
}

static int take(struct ring *ring, void *content, size_t words) {
    for (int i = 0; i < TRIES; i++) {
        uint64_t number = atomic_load_explicit(&ring->newest, memory_order_acquire), copy[WORDS];
        _Atomic uint64_t *slot = ring->words[number % SLOTS];
        if (number == 0) return 0;
        for (size_t j = 0; j < words; j++) copy[j] = atomic_load_explicit(&slot[j], memory_order_relaxed);
        atomic_thread_fence(memory_order_acquire);
        /* The writer fills a slot before it counts it: SLOTS - 1 entries later this one may be half overwritten. */
        if (atomic_load_explicit(&ring->newest, memory_order_relaxed) - number < SLOTS - 1) {
            memcpy(content, copy, 8 * words);
            return 1;
        }
    }
    return 0;
}

static void drain(struct servo *servo) {
    for (int i = 0; i < MOST_ERRORS; i++) {
        struct error_info fault = servo->hd.get_error();
        if (fault.code == 0) return;
        uint64_t made = atomic_load_explicit(&servo->faults_made, memory_order_relaxed);
        _Atomic uint32_t *slot = servo->faults[made % FAULTS];
        atomic_thread_fence(memory_order_release); /* as in put */
        atomic_store_explicit(&slot[0], fault.code, memory_order_relaxed);
        atomic_store_explicit(&slot[1], (uint32_t)fault.internal, memory_order_relaxed);
        atomic_store_explicit(&slot[2], fault.handle, memory_order_relaxed);
        atomic_store_explicit(&servo->faults_made, made + 1, memory_order_release);
    }
}

/* Choose the force to write: the latest one, or zero from a timeout or a force that is not finite until a zero force is
   set. A closing servo writes zero only, so it does not matter who still sets forces. */
static void choose(struct servo *servo, int64_t at_ns, double out[3]) {
    struct force *force = &servo->force;
    take(&servo->forces, force, sizeof *force / 8);
    if (atomic_load_explicit(&servo->closing, memory_order_acquire) || !isfinite(force->f[0]) ||
        !isfinite(force->f[1]) || !isfinite(force->f[2]))
        servo->cut = 1;
    else if (force->f[0] == 0 && force->f[1] == 0 && force->f[2] == 0)
        servo->cut = 0;
    else if (at_ns - force->stamp_ns > servo->timeout_ns)
        servo->cut = 1;
    for (int i = 0; i < 3; i++) out[i] = servo->cut ? 0 : force->f[i];
}

/* --- called by Python and by compiled kernels ------------------------------------------------------------------ */

size_t servo_size(void) { return sizeof(struct servo); }

void servo_prepare(struct servo *servo, const struct library *hd, uint32_t handle, int64_t timeout_ns) {
    memset(servo, 0, sizeof *servo);
    servo->hd = *hd;
    servo->simulated_ns = MACHINE_CLOCK;
    servo->handle = handle;
    servo->timeout_ns = timeout_ns;
}

void servo_simulate(struct servo *servo, int64_t time_ns) { servo->simulated_ns = time_ns; }

void servo_put(struct servo *servo, double x, double y, double z) {
    struct force force = {{x, y, z}, time_of(servo)};
    put(&servo->forces, &force, sizeof force / 8);
}

void servo_close(struct servo *servo) { atomic_store_explicit(&servo->closing, 1, memory_order_release); }

int servo_take(struct servo *servo, struct sample *out) { return take(&servo->samples, out, WORDS); }

int servo_has_fault(struct servo *servo) {
    return atomic_load_explicit(&servo->faults_made, memory_order_acquire) != servo->faults_taken;
}

/* Take the oldest error. If the servo has made more than are kept, one error says so in place of the lost ones. */
int servo_next_fault(struct servo *servo, struct error_info *out) {
    uint64_t made = atomic_load_explicit(&servo->faults_made, memory_order_acquire);
    if (made == servo->faults_taken) return 0;
    _Atomic uint32_t *slot = servo->faults[servo->faults_taken % FAULTS];
    out->code = atomic_load_explicit(&slot[0], memory_order_relaxed);
    out->internal = (int32_t)atomic_load_explicit(&slot[1], memory_order_relaxed);
    out->handle = atomic_load_explicit(&slot[2], memory_order_relaxed);
    atomic_thread_fence(memory_order_acquire);
    made = atomic_load_explicit(&servo->faults_made, memory_order_relaxed);
    if (made - servo->faults_taken < FAULTS) { /* otherwise the slot may be half overwritten, as in take */
        servo->faults_taken++;
        return 1;
    }
    servo->faults_taken = made - (FAULTS - 1);
    *out = (struct error_info){ERRORS_LOST, 0, INVALID_HANDLE};
    return 1;
}

/* --- called by the servo thread -------------------------------------------------------------------------------- */

uint32_t servo_tick(void *data) {
    struct servo *servo = data;
    struct sample now = {0};
    double force[3];
    uint8_t docked = 0;
    servo->hd.begin_frame(servo->handle);
    now.stamp_ns = time_of(servo);
    servo->hd.get_doubles(CURRENT_POSITION, now.position);
    servo->hd.get_doubles(CURRENT_VELOCITY, now.velocity);
    servo->hd.get_integers(CURRENT_BUTTONS, &now.buttons);
    servo->hd.get_booleans(CURRENT_INKWELL_SWITCH, &docked);
    choose(servo, now.stamp_ns, force);
    servo->hd.set_doubles(CURRENT_FORCE, force);
    servo->hd.end_frame(servo->handle);
    drain(servo);
    now.tick = ++servo->ticks;
    now.docked = docked != 0;
    now.cut = (int16_t)servo->cut;
    put(&servo->samples, &now, WORDS);
    return CALLBACK_CONTINUE;
}

/* --- a watch over a servo callback, for measurements ----------------------------------------------------------- */

struct watch { /* WatchState in shim.py */
    uint32_t (*callback)(void *); /* watched callback; NULL for an empty tick */
    void *data;
    int64_t *times; /* capacity for pairs: start and end of each tick */
    uint64_t room;
    _Atomic uint64_t count;
};

uint32_t watch_tick(void *data) {
    struct watch *watch = data;
    int64_t began = now_ns();
    uint32_t after = watch->callback ? watch->callback(watch->data) : CALLBACK_CONTINUE;
    uint64_t count = atomic_load_explicit(&watch->count, memory_order_relaxed);
    if (count < watch->room) {
        watch->times[2 * count] = began;
        watch->times[2 * count + 1] = now_ns();
        atomic_store_explicit(&watch->count, count + 1, memory_order_release);
    }
    return after;
}
