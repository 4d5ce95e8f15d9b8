/* A lane keeping ECU: what it does with a frame, and what it does every 20 ms. No clock, no bus in here. */
#ifndef ECU_ECU_H
#define ECU_ECU_H

#include "burst.h"
#include "e2e.h"
#include "errors.h"
#include "lane.h"
#include "steering.h"

#define ECU_STEP_NS 20000000LL   /* cycle of the steering request, as the DBC says */
#define ECU_TIMEOUT_CYCLES_2 7   /* a message is missed after 3.5 cycles: three frames did not come */

struct ecu_message {
    struct e2e_receiver receiver;
    int64_t heard_ns;  /* last frame of the right length */
    int64_t good_ns;   /* last frame with a right CRC */
    int64_t longest_ns; /* longest time between two frames */
    bool timed_out;
};

struct ecu {
    bool started; /* the sensor has been heard: from here on its messages are expected */
    int64_t start_ns;
    struct ecu_message messages[MESSAGE_COUNT];
    struct burst burst;
    struct contents contents;
    bool has_image;
    uint16_t image_index;
    uint32_t image_timestamp;
    struct lane_watch watch;
    struct steering steering;
    struct errors errors;
    uint64_t frames, frames_of_others, bursts, images_skipped, steered_by;
    uint64_t requests, requests_without_angle;
    uint8_t request_counter;
    double largest_request_rad;
};

struct ecu_frame {
    uint32_t id;
    uint8_t length;
    uint8_t data[8];
};

void ecu_init(struct ecu *ecu, struct steering_config steering);

/* Take a frame of the bus, received at `t_ns`. Times never go back. */
void ecu_receive(struct ecu *ecu, const struct ecu_frame *frame, int64_t t_ns);

/* Look for missing messages at `t_ns`. */
void ecu_deadlines(struct ecu *ecu, int64_t t_ns);

/* Do a control step at `t_ns` and return the steering request to send. */
struct ecu_frame ecu_step(struct ecu *ecu, int64_t t_ns);

/* Write the report as one line of JSON; `end_ns` is the time at which the ECU ended. */
void ecu_report(const struct ecu *ecu, int64_t end_ns, uint64_t frames_overrun, FILE *file);

#endif
