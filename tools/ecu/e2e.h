/* AUTOSAR E2E profile 1, variant A (both bytes of the data id), for frames with the CRC in byte 0 and
 * the alive counter in the low nibble of byte 1. Written from the standard, not from the sender's code. */
#ifndef ECU_E2E_H
#define ECU_E2E_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define E2E_COUNTER_STATES 15u /* 0 to 14; 15 is never sent */
#define E2E_MAX_DELTA 2u       /* one frame may be missing before its lateness has shown it */
#define E2E_SYNC_FRAMES 2u     /* consecutive frames needed after a wrong sequence */
#define E2E_WINDOW 5u          /* checks that decide on valid or invalid */
#define E2E_WINDOW_ERRORS 3u   /* so many bad ones among them make the message invalid */

enum e2e_status {
    E2E_OK,
    E2E_SOME_LOST,      /* within tolerance: usable */
    E2E_INITIAL,        /* first frame: nothing to compare its counter with */
    E2E_SYNC,           /* in sequence again, not yet trusted */
    E2E_REPEATED,       /* the counter stood still */
    E2E_WRONG_SEQUENCE, /* the counter jumped by more than the time that has passed explains */
    E2E_WRONG_CRC,
};

/* What a consumer remembers of one message. All zero before the first frame. */
struct e2e_receiver {
    bool started;
    uint8_t last;      /* counter of the last frame with a right CRC */
    uint8_t sync_left; /* frames still to come in sequence */
    uint8_t history;   /* bit 0: the last check; 1 = bad */
    bool invalid;
};

/* CRC-8 SAE J1850 without its first and last XOR, started at `crc`. */
uint8_t e2e_crc8(uint8_t crc, const uint8_t *data, size_t length);

/* The CRC of profile 1 over data id (low, high byte) and the frame without its byte 0. */
uint8_t e2e_p01_crc(uint16_t data_id, const uint8_t *data, size_t length);

/* Write counter and CRC into a frame. */
void e2e_p01_protect(uint16_t data_id, uint8_t counter, uint8_t *data, size_t length);

/* Judge a frame; `cycles_missed`: whole cycles without a good frame before it. `lost`: frames skipped. */
enum e2e_status e2e_p01_receive(struct e2e_receiver *receiver, uint16_t data_id, const uint8_t *data,
                                size_t length, unsigned cycles_missed, unsigned *lost);

/* Whether the signals of a frame with this status may be used. */
bool e2e_usable(const struct e2e_receiver *receiver, enum e2e_status status);

/* Note a check that went wrong before the CRC was looked at, or any other. Returns true where the message
 * became invalid by it. */
bool e2e_note(struct e2e_receiver *receiver, bool bad);

#endif
