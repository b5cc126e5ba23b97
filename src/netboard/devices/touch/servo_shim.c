/* The servo callback in C, so that no Python runs in the servo thread, and a watch over any servo callback.

   It calls the vendor's functions by addresses that it is given, so compiling it needs none of the vendor's files. A
   tick does the same as PythonServo in servo.py: read, take the force, write it, take errors, publish. rings.h says how
   samples and forces go between the threads. */

#include "rings.h"

enum { MOST_ERRORS = 64 };
enum { MACHINE_CLOCK = -1 };
enum { CALLBACK_DONE = 0, CALLBACK_CONTINUE = 1 };
enum {
    CURRENT_BUTTONS = 0x2000,
    CURRENT_INKWELL_SWITCH = 0x2002,
    CURRENT_POSITION = 0x2050,
    CURRENT_VELOCITY = 0x2051,
    CURRENT_FORCE = 0x2700
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

struct servo {
    struct library hd;
    int64_t simulated_ns; /* simulated time, or MACHINE_CLOCK */
    uint32_t handle;
    int64_t ticks;
    struct exchange exchange;
};

_Static_assert(sizeof(struct sample) == 8 * WORDS, "a sample fills a slot");

static int64_t time_of(const struct servo *servo) {
    return servo->simulated_ns == MACHINE_CLOCK ? now_ns() : servo->simulated_ns;
}

static void drain(struct servo *servo) {
    for (int i = 0; i < MOST_ERRORS; i++) {
        struct error_info fault = servo->hd.get_error();
        if (fault.code == 0) return;
        add_fault(&servo->exchange, fault);
    }
}

/* --- called by Python and by compiled kernels ------------------------------------------------------------------ */

size_t servo_size(void) { return sizeof(struct servo); }

void servo_prepare(struct servo *servo, const struct library *hd, uint32_t handle, int64_t timeout_ns) {
    memset(servo, 0, sizeof *servo);
    servo->hd = *hd;
    servo->simulated_ns = MACHINE_CLOCK;
    servo->handle = handle;
    servo->exchange.timeout_ns = timeout_ns;
}

void servo_simulate(struct servo *servo, int64_t time_ns) { servo->simulated_ns = time_ns; }

void servo_put(struct servo *servo, double x, double y, double z) {
    struct force force = {{x, y, z}, time_of(servo)};
    put(&servo->exchange.forces, &force, sizeof force / 8);
}

void servo_close(struct servo *servo) { atomic_store_explicit(&servo->exchange.closing, 1, memory_order_release); }

int servo_take(struct servo *servo, struct sample *out) { return take(&servo->exchange.samples, out, WORDS); }

int servo_has_fault(struct servo *servo) { return has_fault(&servo->exchange); }

int servo_next_fault(struct servo *servo, struct error_info *out) { return next_fault(&servo->exchange, out); }

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
    choose(&servo->exchange, now.stamp_ns, force);
    servo->hd.set_doubles(CURRENT_FORCE, force);
    servo->hd.end_frame(servo->handle);
    drain(servo);
    now.tick = ++servo->ticks;
    now.docked = docked != 0;
    now.cut = (int16_t)servo->exchange.cut;
    put(&servo->exchange.samples, &now, WORDS);
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
