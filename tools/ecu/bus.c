#define _GNU_SOURCE
#include "bus.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define RECEIVE_BUFFER (4 << 20) /* the default holds some 270 frames: less than a second of the sensor */

static bool complain(const char *what, const char *interface)
{
    fprintf(stderr, "ecu: %s: %s: %s\n", interface, what, strerror(errno));
    return false;
}

bool bus_open(struct bus *bus, const char *interface)
{
    const int on = 1, size = RECEIVE_BUFFER;
    *bus = (struct bus){.socket = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)};
    if (bus->socket < 0)
        return complain("no CAN socket", interface);
    const unsigned index = if_nametoindex(interface);
    if (index == 0)
        return complain("no such interface", interface);
    if (setsockopt(bus->socket, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) < 0) /* needs root */
        (void)setsockopt(bus->socket, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    if (setsockopt(bus->socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) < 0
        || setsockopt(bus->socket, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) < 0)
        return complain("no time stamps", interface);
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)index};
    if (bind(bus->socket, (struct sockaddr *)&address, sizeof address) < 0)
        return complain("cannot be opened", interface);
    return true;
}

static void read_control(struct bus *bus, struct msghdr *message, int64_t *t_ns)
{
    for (struct cmsghdr *part = CMSG_FIRSTHDR(message); part; part = CMSG_NXTHDR(message, part)) {
        if (part->cmsg_level != SOL_SOCKET)
            continue;
        if (part->cmsg_type == SO_TIMESTAMPNS) {
            struct timespec stamp;
            memcpy(&stamp, CMSG_DATA(part), sizeof stamp);
            *t_ns = (int64_t)stamp.tv_sec * 1000000000LL + stamp.tv_nsec;
        } else if (part->cmsg_type == SO_RXQ_OVFL) {
            uint32_t lost;
            memcpy(&lost, CMSG_DATA(part), sizeof lost);
            bus->overrun = lost;
        }
    }
}

bool bus_receive(struct bus *bus, struct ecu_frame *frame, int64_t *t_ns)
{
    struct can_frame raw;
    union { /* aligned as a control message must be */
        char bytes[256];
        struct cmsghdr align;
    } control;
    struct iovec part = {.iov_base = &raw, .iov_len = sizeof raw};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = &control, .msg_controllen = sizeof control};
    for (;;) {
        if (recvmsg(bus->socket, &message, 0) != (ssize_t)sizeof raw)
            return false;
        read_control(bus, &message, t_ns);
        if (!(raw.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)))
            break;
        message.msg_controllen = sizeof control;
    }
    *frame = (struct ecu_frame){.id = raw.can_id & CAN_SFF_MASK, .length = raw.can_dlc};
    memcpy(frame->data, raw.data, sizeof frame->data);
    return true;
}

bool bus_send(struct bus *bus, const struct ecu_frame *frame)
{
    struct can_frame raw = {.can_id = frame->id, .can_dlc = frame->length};
    memcpy(raw.data, frame->data, sizeof raw.data);
    return write(bus->socket, &raw, sizeof raw) == (ssize_t)sizeof raw;
}
