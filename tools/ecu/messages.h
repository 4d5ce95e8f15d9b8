/* The messages of the lane sensor, by the names that cantools generates from dbc/lds.dbc. */
#ifndef ECU_MESSAGES_H
#define ECU_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lds.h"

/* X(name in macros, in functions), in the order of a burst. */
#define ECU_MESSAGES(X)                                                                                 \
    X(IMAGE, image)                                                                                     \
    X(STATUS, status)                                                                                   \
    X(LANE, lane)                                                                                       \
    X(LEFT_LINE, left_line)                                                                             \
    X(LEFT_CURVE, left_curve)                                                                           \
    X(RIGHT_LINE, right_line)                                                                           \
    X(RIGHT_CURVE, right_curve)                                                                         \
    X(NEXT_LEFT_LINE, next_left_line)                                                                   \
    X(NEXT_LEFT_CURVE, next_left_curve)                                                                 \
    X(NEXT_RIGHT_LINE, next_right_line)                                                                 \
    X(NEXT_RIGHT_CURVE, next_right_curve)                                                               \
    X(MARKINGS, markings)                                                                               \
    X(NEXT_MARKINGS, next_markings)

enum message {
#define X(MACRO, name) MESSAGE_##MACRO,
    ECU_MESSAGES(X)
#undef X
        MESSAGE_COUNT,
    MESSAGE_NONE = MESSAGE_COUNT,
};

/* The last usable content of every message, as the generated code unpacked it. */
struct contents {
#define X(MACRO, name) struct lds_lds_##name##_t name;
    ECU_MESSAGES(X)
#undef X
};

struct message_plan {
    const char *name;
    uint32_t id;
    uint16_t data_id; /* the DBC's attribute E2EDataId; the generator leaves attributes out */
    size_t length;
    int64_t cycle_ns;
};

extern const struct message_plan message_plans[MESSAGE_COUNT];

/* The message with this identifier, MESSAGE_NONE if it is none of the sensor's. */
enum message message_of(uint32_t id);

/* Unpack a frame into its place; returns its burst signal, the lowest four bits of the image's index. */
uint8_t message_unpack(struct contents *contents, enum message message, const uint8_t *data, size_t length);

#endif
