/* A small steering law: pursue the lane's centre at a preview distance, integrate what remains. */
#ifndef ECU_STEERING_H
#define ECU_STEERING_H

#include "lane.h"

struct steering_config {
    double wheelbase_m;
    double preview_m;
};

struct steering {
    struct steering_config config;
    bool has_lane;
    int64_t lane_ns;        /* when the last lane that could be steered by came */
    double half_width_m;    /* for the time in which only one line is seen */
    double integral_per_m;  /* curvature that holds the centre against what the law does not know */
    double curvature_per_m; /* wanted, before authority */
    double authority;       /* 0: nothing is asked for; 1: all of the law */
    double angle_rad;       /* last request */
};

void steering_init(struct steering *steering, struct steering_config config);

/* Take the lane of a new image. */
void steering_see(struct steering *steering, const struct lane *lane, int64_t t_ns);

/* One control step of `step_s`; returns the angle of the front wheels in rad, NAN where none is asked for. */
double steering_step(struct steering *steering, int64_t t_ns, double step_s);

#endif
