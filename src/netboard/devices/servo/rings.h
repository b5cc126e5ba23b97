/* What a servo thread and the agent exchange, in C: samples one way, forces and errors the other, through ring buffers with
   one writer each. The reader takes the newest slot, and reads again if the writer has overwritten it meanwhile. So neither
   side ever waits for the other, whatever the scheduler does with their threads. */

#ifndef NETBOARD_RINGS_H
#define NETBOARD_RINGS_H

#include <math.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

enum { SLOTS = 16, WORDS = 9, FAULTS = 256, TRIES = 8 };

#define ERRORS_LOST 0xFFFF0000u
#define INVALID_HANDLE 0xFFFFFFFFu

struct error_info {
    uint32_t code;
    int32_t internal;
    uint32_t handle;
};

struct force {
    double f[3];
    int64_t stamp_ns;
};

struct ring {
    _Atomic uint64_t newest; /* number of the newest entry, from 1; 0 if empty */
    _Atomic uint64_t words[SLOTS][WORDS];
};

struct exchange {
    int64_t timeout_ns; /* age above which a force is cut to zero */
    int cut;
    _Atomic int closing; /* 1: only zero is rendered from now on */
    struct force force;  /* last one taken from the ring */
    struct ring samples, forces;
    _Atomic uint64_t faults_made;
    uint64_t faults_taken;
    _Atomic uint32_t faults[FAULTS][3]; /* as in struct error_info */
};

_Static_assert(sizeof(struct force) <= 8 * WORDS, "a force fits into a slot");

static inline int64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now); /* the clock of Python's time.monotonic_ns */
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static inline void put(struct ring *ring, const void *content, size_t words) {
    uint64_t number = atomic_load_explicit(&ring->newest, memory_order_relaxed) + 1, copy[WORDS];
    _Atomic uint64_t *slot = ring->words[number % SLOTS];
    memcpy(copy, content, 8 * words);
    atomic_thread_fence(memory_order_release); /* who sees a word of this entry also sees the previous number */
    for (size_t i = 0; i < words; i++) atomic_store_explicit(&slot[i], copy[i], memory_order_relaxed);
    atomic_store_explicit(&ring->newest, number, memory_order_release);
}

static inline int take(struct ring *ring, void *content, size_t words) {
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

static inline void add_fault(struct exchange *exchange, struct error_info fault) {
    uint64_t made = atomic_load_explicit(&exchange->faults_made, memory_order_relaxed);
    _Atomic uint32_t *slot = exchange->faults[made % FAULTS];
    atomic_thread_fence(memory_order_release); /* as in put */
    atomic_store_explicit(&slot[0], fault.code, memory_order_relaxed);
    atomic_store_explicit(&slot[1], (uint32_t)fault.internal, memory_order_relaxed);
    atomic_store_explicit(&slot[2], fault.handle, memory_order_relaxed);
    atomic_store_explicit(&exchange->faults_made, made + 1, memory_order_release);
}

static inline int has_fault(struct exchange *exchange) {
    return atomic_load_explicit(&exchange->faults_made, memory_order_acquire) != exchange->faults_taken;
}

/* Take the oldest error. If the servo has made more than are kept, one error says so in place of the lost ones. */
static inline int next_fault(struct exchange *exchange, struct error_info *out) {
    uint64_t made = atomic_load_explicit(&exchange->faults_made, memory_order_acquire);
    if (made == exchange->faults_taken) return 0;
    _Atomic uint32_t *slot = exchange->faults[exchange->faults_taken % FAULTS];
    out->code = atomic_load_explicit(&slot[0], memory_order_relaxed);
    out->internal = (int32_t)atomic_load_explicit(&slot[1], memory_order_relaxed);
    out->handle = atomic_load_explicit(&slot[2], memory_order_relaxed);
    atomic_thread_fence(memory_order_acquire);
    made = atomic_load_explicit(&exchange->faults_made, memory_order_relaxed);
    if (made - exchange->faults_taken < FAULTS) { /* otherwise the slot may be half overwritten, as in take */
        exchange->faults_taken++;
        return 1;
    }
    exchange->faults_taken = made - (FAULTS - 1);
    *out = (struct error_info){ERRORS_LOST, 0, INVALID_HANDLE};
    return 1;
}

/* Choose the force to write: the latest one, or zero from a timeout or a force that is not finite until a zero force is
   set. A closing servo writes zero only, so it does not matter who still sets forces. */
static inline void choose(struct exchange *exchange, int64_t at_ns, double out[3]) {
    struct force *force = &exchange->force;
    take(&exchange->forces, force, sizeof *force / 8);
    if (atomic_load_explicit(&exchange->closing, memory_order_acquire) || !isfinite(force->f[0]) ||
        !isfinite(force->f[1]) || !isfinite(force->f[2]))
        exchange->cut = 1;
    else if (force->f[0] == 0 && force->f[1] == 0 && force->f[2] == 0)
        exchange->cut = 0;
    else if (at_ns - force->stamp_ns > exchange->timeout_ns)
        exchange->cut = 1;
    for (int i = 0; i < 3; i++) out[i] = exchange->cut ? 0 : force->f[i];
}

#endif
