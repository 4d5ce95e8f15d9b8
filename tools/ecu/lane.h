/* The own lane of one image in metres, and what cannot be true of it. */
#ifndef ECU_LANE_H
#define ECU_LANE_H

#include "errors.h"
#include "messages.h"

/* y(x) = offset + heading x + curvature x^2 / 2 + rate x^3 / 6, x ahead, y to the left of the rear axle. */
struct line {
    bool available;
    bool measured;
    bool has_numbers; /* none of offset, heading, range end is at its "not available" value */
    unsigned quality;
    unsigned order;
    double offset_m;
    double heading;
    double curvature_per_m;
    double rate_per_m2;
    double start_m;
    double end_m;
    int32_t raw[3]; /* offset, heading, curvature as sent: a stuck one does not move by a bit */
};

struct lane {
    struct line left;
    struct line right;
    bool is_ready; /* sensor available or degraded */
    unsigned state;
    unsigned change; /* 1, 2: a lane change in this image */
    uint16_t index;
};

/* The lane of the last complete burst. */
struct lane lane_of(const struct contents *contents);

#define NEAR_M 12.0     /* a line that begins farther ahead says little of where it would be beside us */
#define LEAST_QUALITY 2 /* 1 is poor */

/* Whether the line is good enough, and seen near enough, to say where it lies. */
bool line_is_near(const struct line *line);

/* y at x in metres. */
double line_y(const struct line *line, double x_m);

/* What is watched from image to image. */
struct lane_watch {
    bool has_last;
    struct lane last;
    unsigned still[2][3]; /* images for which offset, heading, curvature of left, right have not moved */
    bool not_ready;
    bool lost[2];
};

#define STUCK_IMAGES 25      /* one second: noise moves a measured number by a bit long before */
#define MAX_STEP_M 0.5       /* offset from image to image; 5 m/s across the lane are 0.2 m, the rest is noise */
#define MAX_HEADING_STEP 0.1 /* in 40 ms, far beyond any yaw rate */
#define COMPARED_IMAGES 3    /* after a longer gap nothing is compared */

/* Compare an image with itself and with the one before; what is wrong goes into `errors`. Returns whether
 * it may be steered by. */
bool lane_plausible(struct lane_watch *watch, const struct lane *lane, int64_t t_ns, struct errors *errors);

#endif
