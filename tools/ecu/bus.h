/* A raw SocketCAN socket: what is heard bears the kernel's time. */
#ifndef ECU_BUS_H
#define ECU_BUS_H

#include "ecu.h"

struct bus {
    int socket;
    uint64_t overrun; /* frames that the kernel threw away because we read too late */
};

/* Open an interface; false with the reason on standard error. */
bool bus_open(struct bus *bus, const char *interface);

/* Fetch the next frame without waiting; false if there is none. Times count from 1970. */
bool bus_receive(struct bus *bus, struct ecu_frame *frame, int64_t *t_ns);

/* Send; false where the kernel refuses it. */
bool bus_send(struct bus *bus, const struct ecu_frame *frame);

#endif
