/* The frames of one image: 13 of them, in order, all with the lowest four bits of the image's index. */
#ifndef ECU_BURST_H
#define ECU_BURST_H

#include "messages.h"

struct burst {
    bool open;
    uint8_t image; /* index modulo 16 */
    uint16_t seen; /* bit per message */
};

struct burst_result {
    bool foreign;    /* this frame belongs to an older image: it is left out */
    bool incomplete; /* the burst before this frame ended too early */
    bool complete;   /* this frame was the last one missing */
};

/* Take a frame of the burst `image`. */
struct burst_result burst_add(struct burst *burst, enum message message, uint8_t image);

#endif
