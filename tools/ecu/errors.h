/* What went wrong, counted by class and message, and a log of the first cases with their times. */
#ifndef ECU_ERRORS_H
#define ECU_ERRORS_H

#include <stdint.h>
#include <stdio.h>

#include "messages.h"

/* X(CONSTANT, name in the report) */
#define ECU_ERRORS(X)                                                                                   \
    X(LENGTH, length)                         /* a frame shorter or longer than its message */          \
    X(CRC, crc)                               /* the check value is wrong */                            \
    X(REPEATED, counter_repeated)             /* the alive counter stood still */                       \
    X(LOST, counter_lost)                     /* frames that the counter says were sent and never came */ \
    X(SEQUENCE, counter_wrong_sequence)       /* the counter jumped further than frames can be missing */ \
    X(INVALID, e2e_invalid)                   /* too many bad checks in a row: not used until they end */ \
    X(TIMEOUT, timeout)                       /* three frames in a row did not come */                  \
    X(MISMATCH, burst_mismatch)               /* a frame of another image within a burst */             \
    X(INCOMPLETE, burst_incomplete)           /* a burst ended before its last frame */                 \
    X(FROZEN, image_frozen)                   /* new frames with the image, or the time, of the last ones */ \
    X(BACKWARDS, image_backwards)             /* the image's index went back */                         \
    X(NOT_READY, sensor_not_ready)            /* periods: the sensor is neither available nor degraded */ \
    X(LEFT_LOST, left_not_available)          /* periods without a left line while the sensor is ready */ \
    X(RIGHT_LOST, right_not_available)        /* the same on the right */                               \
    X(STUCK, signal_stuck)                    /* periods in which a measured number did not move at all */ \
    X(JUMP, implausible_jump)                 /* a line moved faster than a vehicle can */              \
    X(CONTRADICTION, contradiction)           /* signals that cannot be true together */

enum error_class {
#define X(CONSTANT, name) ERROR_##CONSTANT,
    ECU_ERRORS(X)
#undef X
        ERROR_COUNT,
};

#define ERROR_LOG_SIZE 200

struct error_entry {
    int64_t t_ns;
    enum error_class class;
    enum message message; /* MESSAGE_NONE: of the whole image */
    double value;         /* what it was about: frames lost, metres jumped, the sensor's state */
};

struct errors {
    uint64_t counts[ERROR_COUNT][MESSAGE_COUNT + 1];
    struct error_entry log[ERROR_LOG_SIZE];
    uint64_t total; /* entries, also those that found no place */
};

void errors_add(struct errors *errors, enum error_class class, enum message message, int64_t t_ns,
                uint64_t count, double value);

/* The counts of a class over all messages. */
uint64_t errors_of(const struct errors *errors, enum error_class class);

/* Write `"errors": {...}, "by_message": {...}, "log": [...], "log_left_out": n`, times from `start_ns`. */
void errors_write(const struct errors *errors, int64_t start_ns, FILE *file);

#endif
