#include "e2e.h"

#define POLYNOMIAL 0x1Du /* x^8 + x^4 + x^3 + x^2 + 1, SAE J1850 */
#define COUNTER_MASK 0x0Fu

uint8_t e2e_crc8(uint8_t crc, const uint8_t *data, size_t length)
{
    for (size_t k = 0; k < length; k++) {
        crc ^= data[k];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint8_t)((unsigned)crc << 1 ^ ((crc & 0x80u) ? POLYNOMIAL : 0u));
    }
    return crc;
}

uint8_t e2e_p01_crc(uint16_t data_id, const uint8_t *data, size_t length)
{
    const uint8_t id[2] = {(uint8_t)(data_id & 0xFFu), (uint8_t)(data_id >> 8)};
    /* The profile starts the CRC library at 0xFF, which XORs it away, and cancels its last XOR too. */
    return e2e_crc8(e2e_crc8(0x00, id, sizeof id), data + 1, length - 1);
}

void e2e_p01_protect(uint16_t data_id, uint8_t counter, uint8_t *data, size_t length)
{
    data[1] = (uint8_t)((data[1] & ~COUNTER_MASK) | (counter & COUNTER_MASK));
    data[0] = e2e_p01_crc(data_id, data, length);
}

static unsigned allowed_delta(unsigned cycles_missed)
{
    unsigned delta = E2E_MAX_DELTA + cycles_missed;
    return delta < E2E_COUNTER_STATES ? delta : E2E_COUNTER_STATES - 1;
}

enum e2e_status e2e_p01_receive(struct e2e_receiver *receiver, uint16_t data_id, const uint8_t *data,
                                size_t length, unsigned cycles_missed, unsigned *lost)
{
    *lost = 0;
    if (data[0] != e2e_p01_crc(data_id, data, length))
        return E2E_WRONG_CRC;
    const uint8_t counter = data[1] & COUNTER_MASK;
    if (counter >= E2E_COUNTER_STATES)
        return E2E_WRONG_SEQUENCE;
    const unsigned delta = (counter + E2E_COUNTER_STATES - receiver->last) % E2E_COUNTER_STATES;
    receiver->last = counter;
    if (!receiver->started || cycles_missed >= E2E_COUNTER_STATES - 1) { /* the counter has gone round */
        receiver->started = true;
        receiver->sync_left = 0;
        return E2E_INITIAL;
    }
    if (delta == 0)
        return E2E_REPEATED;
    if (delta > allowed_delta(cycles_missed)) {
        receiver->sync_left = E2E_SYNC_FRAMES;
        return E2E_WRONG_SEQUENCE;
    }
    *lost = delta - 1;
    if (receiver->sync_left > 0 && --receiver->sync_left > 0)
        return E2E_SYNC;
    return delta == 1 ? E2E_OK : E2E_SOME_LOST;
}

bool e2e_usable(const struct e2e_receiver *receiver, enum e2e_status status)
{
    return !receiver->invalid && (status == E2E_OK || status == E2E_SOME_LOST);
}

bool e2e_note(struct e2e_receiver *receiver, bool bad)
{
    const bool before = receiver->invalid;
    receiver->history = (uint8_t)(((receiver->history << 1) | bad) & ((1u << E2E_WINDOW) - 1));
    unsigned errors = 0;
    for (unsigned k = 0; k < E2E_WINDOW; k++)
        errors += (receiver->history >> k) & 1u;
    if (errors >= E2E_WINDOW_ERRORS)
        receiver->invalid = true;
    else if (errors == 0)
        receiver->invalid = false;
    return receiver->invalid && !before;
}
