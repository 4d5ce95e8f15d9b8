#include "steering.h"

#include <math.h>

#define HOLD_NS 250000000LL   /* the last lane is good for six images */
#define RAMP_IN_S 0.5
#define RAMP_OUT_S 1.0
#define INTEGRAL_PER_M2_S 4e-4 /* curvature per metre of offset and second */
#define MAX_INTEGRAL_PER_M 0.004
#define MAX_GAP_S 0.1         /* longer ones are not integrated over */
#define MAX_ANGLE_RAD 0.35
#define MAX_RATE_RADPS 0.5
#define LEAST_PREVIEW_M 8.0
#define WIDTH_FILTER 0.05

static double clamp(double value, double limit)
{
    return fmin(fmax(value, -limit), limit);
}

void steering_init(struct steering *steering, struct steering_config config)
{
    *steering = (struct steering){.config = config, .half_width_m = 1.75};
}

static bool can_steer_by(const struct line *line)
{
    return line_is_near(line) && line->end_m >= LEAST_PREVIEW_M;
}

/* The lane's centre y at x from whichever lines there are. */
static double centre(const struct steering *steering, const struct line *left, const struct line *right,
                     double x_m)
{
    if (left && right)
        return (line_y(left, x_m) + line_y(right, x_m)) / 2;
    return left ? line_y(left, x_m) - steering->half_width_m : line_y(right, x_m) + steering->half_width_m;
}

void steering_see(struct steering *steering, const struct lane *lane, int64_t t_ns)
{
    const struct line *left = can_steer_by(&lane->left) ? &lane->left : NULL;
    const struct line *right = can_steer_by(&lane->right) ? &lane->right : NULL;
    if (!lane->is_ready || (!left && !right))
        return;
    if (left && right)
        steering->half_width_m
            += WIDTH_FILTER * ((left->offset_m - right->offset_m) / 2 - steering->half_width_m);
    double x_m = steering->config.preview_m;
    if (left)
        x_m = fmin(x_m, left->end_m);
    if (right)
        x_m = fmin(x_m, right->end_m);
    const double y_m = centre(steering, left, right, x_m);
    /* The circle through the rear axle, along the vehicle, and through (x, y). On a bend, which the lines
     * show at the preview already, this is the bend's own curvature: the feed-forward is in it. */
    steering->curvature_per_m = 2 * y_m / (x_m * x_m + y_m * y_m);
    const double gap_s = (double)(t_ns - steering->lane_ns) / 1e9;
    if (steering->has_lane && gap_s < MAX_GAP_S && steering->authority >= 1)
        steering->integral_per_m = clamp(
            steering->integral_per_m + INTEGRAL_PER_M2_S * gap_s * centre(steering, left, right, 0),
            MAX_INTEGRAL_PER_M);
    steering->has_lane = true;
    steering->lane_ns = t_ns;
}

double steering_step(struct steering *steering, int64_t t_ns, double step_s)
{
    const bool sees = steering->has_lane && t_ns - steering->lane_ns <= HOLD_NS;
    steering->authority += sees ? step_s / RAMP_IN_S : -step_s / RAMP_OUT_S;
    steering->authority = fmin(fmax(steering->authority, 0), 1);
    if (steering->authority <= 0) {
        steering->integral_per_m = 0;
        steering->angle_rad = 0;
        return NAN;
    }
    const double wanted
        = atan(steering->config.wheelbase_m * (steering->curvature_per_m + steering->integral_per_m));
    const double step = clamp(clamp(steering->authority * wanted, MAX_ANGLE_RAD) - steering->angle_rad,
                              MAX_RATE_RADPS * step_s);
    steering->angle_rad += step;
    return steering->angle_rad;
}
