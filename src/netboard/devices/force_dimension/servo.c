/* The servo loop of a Force Dimension device, in a thread of its own: read, take the force, write it, publish.

   The SDK has no scheduler; its calls are thread-safe and block for the USB transfer, so this thread is paced by them, and
   runs at 4 kHz at most. It calls the SDK by addresses that it is given, so compiling it needs none of the vendor's files.
   After an error it writes zero force once and ends: what the error means is decided in Python. */

#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>

#include "rings.h"

enum { PRIORITY_STEP = 5 }; /* above a real-time caller, which waits for this thread, as IO_PRIORITY_STEP in realtime.py */

enum { PERIOD_NS = 250000, STATUS_NS = 20000000, STATUSES = 32 }; /* room for more states than the SDK has (17) */
enum { VELOCITY_NS = 100000000 };                                  /* longest time without an estimate of the velocity */
enum { TIMEGUARD = 1 };                                            /* the position is recent enough: not read again */
enum { ERROR_TIMEOUT = 7 };
enum { STATUS_FORCE = 5, STATUS_FORCE_OFF_CAUSE = 14 };
enum { GET_POSITION, GET_VELOCITY, SET_FORCE, GET_STATUS }; /* CALLED in servo.py */

struct library { /* function addresses, in the order of CALLED; the last two cannot fail */
    int (*get_position)(double *, double *, double *, char);
    int (*get_velocity)(double *, double *, double *, char);
    int (*set_force)(double, double, double, char);
    int (*get_status)(int *, char);
    unsigned (*get_buttons)(char);
    int (*last_error)(void); /* of this thread */
};

struct sample { /* SAMPLE in servo.py */
    int64_t tick;
    int64_t stamp_ns;
    double position[3];
    double velocity[3];
    int32_t buttons;
    int16_t off; /* 0: forces are on; otherwise 1 + the cause */
    int16_t cut;
};

struct servo {
    struct library dhd;
    char id;
    int16_t off;
    int64_t status_due_ns;
    int64_t velocity_ns; /* time of the newest estimate of the velocity, or of the start */
    _Atomic int64_t ticks;
    _Atomic int stopping, ended;
    struct exchange exchange;
};

_Static_assert(sizeof(struct sample) == 8 * WORDS, "a sample fills a slot");

static int failed(struct servo *servo, int call) {
    add_fault(&servo->exchange, (struct error_info){(uint32_t)servo->dhd.last_error(), call, (uint32_t)servo->id});
    return 0;
}

static int update_status(struct servo *servo, int64_t at_ns) {
    int status[STATUSES] = {0};
    if (at_ns < servo->status_due_ns) return 1;
    if (servo->dhd.get_status(status, servo->id) < 0) return failed(servo, GET_STATUS);
    servo->off = status[STATUS_FORCE] ? 0 : (int16_t)(1 + status[STATUS_FORCE_OFF_CAUSE]);
    servo->status_due_ns = at_ns + STATUS_NS;
    return 1;
}

/* Run one tick; return 0 after an error. */
static int tick(struct servo *servo) {
    struct sample now = {0};
    double *x = now.position, *v = now.velocity, force[3];
    now.stamp_ns = now_ns();
    int got = servo->dhd.get_position(&x[0], &x[1], &x[2], servo->id);
    if (got < 0) return failed(servo, GET_POSITION);
    if (servo->dhd.get_velocity(&v[0], &v[1], &v[2], servo->id) >= 0) servo->velocity_ns = now.stamp_ns;
    else if (servo->dhd.last_error() != ERROR_TIMEOUT || now.stamp_ns - servo->velocity_ns > VELOCITY_NS)
        return failed(servo, GET_VELOCITY);
    else v[0] = v[1] = v[2] = 0; /* too few positions yet for an estimate */
    if (!update_status(servo, now.stamp_ns)) return 0;
    now.buttons = (int32_t)servo->dhd.get_buttons(servo->id);
    choose(&servo->exchange, now.stamp_ns, force);
    if (servo->dhd.set_force(force[0], force[1], force[2], servo->id) < 0) return failed(servo, SET_FORCE);
    now.tick = ++servo->ticks;
    now.off = servo->off;
    now.cut = (int16_t)servo->exchange.cut;
    if (got != TIMEGUARD) put(&servo->exchange.samples, &now, WORDS);
    return 1;
}

static void *serve(void *data) {
    struct servo *servo = data;
    int64_t due_ns = servo->velocity_ns = now_ns();
    while (!servo->stopping && tick(servo)) {
        due_ns += PERIOD_NS;
        int64_t at_ns = now_ns();
        if (due_ns < at_ns) due_ns = at_ns; /* the transfers took longer: they set the rate */
        struct timespec due = {due_ns / 1000000000, due_ns % 1000000000};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {}
    }
    servo->dhd.set_force(0, 0, 0, servo->id);
    servo->ended = 1;
    return NULL;
}

/* --- called by Python -------------------------------------------------------------------------------------------- */

size_t dhd_servo_size(void) { return sizeof(struct servo); }

void dhd_servo_prepare(struct servo *servo, const struct library *dhd, int id, int64_t timeout_ns) {
    memset(servo, 0, sizeof *servo);
    servo->dhd = *dhd;
    servo->id = (char)id;
    servo->exchange.timeout_ns = timeout_ns;
}

/* Prepare a thread that is real-time if its caller is; by itself a new thread is not (SCHED_RESET_ON_FORK). */
static void follow_caller(pthread_attr_t *how) {
    struct sched_param mine;
    int policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
    if (policy != SCHED_FIFO || sched_getparam(0, &mine)) return;
    mine.sched_priority += PRIORITY_STEP;
    pthread_attr_setinheritsched(how, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(how, policy);
    pthread_attr_setschedparam(how, &mine);
}

/* Start the thread; return 0, or an error number. */
int dhd_servo_start(struct servo *servo) {
    pthread_t thread;
    pthread_attr_t how;
    pthread_attr_init(&how);
    pthread_attr_setdetachstate(&how, PTHREAD_CREATE_DETACHED);
    follow_caller(&how);
    int error = pthread_create(&thread, &how, serve, servo);
    if (error == EPERM) { /* not as real-time as its caller */
        pthread_attr_setinheritsched(&how, PTHREAD_INHERIT_SCHED);
        error = pthread_create(&thread, &how, serve, servo);
    }
    pthread_attr_destroy(&how);
    if (error) servo->ended = 1;
    return error;
}

void dhd_servo_put(struct servo *servo, double x, double y, double z) {
    struct force force = {{x, y, z}, now_ns()};
    put(&servo->exchange.forces, &force, sizeof force / 8);
}

void dhd_servo_close(struct servo *servo) { atomic_store_explicit(&servo->exchange.closing, 1, memory_order_release); }

void dhd_servo_stop(struct servo *servo) { servo->stopping = 1; }

int dhd_servo_ended(struct servo *servo) { return servo->ended; }

int64_t dhd_servo_ticks(struct servo *servo) { return servo->ticks; }

int dhd_servo_take(struct servo *servo, struct sample *out) { return take(&servo->exchange.samples, out, WORDS); }

int dhd_servo_next_fault(struct servo *servo, struct error_info *out) { return next_fault(&servo->exchange, out); }
