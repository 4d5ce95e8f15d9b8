#include "lane.h"

#include <math.h>
#include <string.h>

/* The same for both sides; SIDE and side as in the generated names. */
#define READ_LINE(SIDE, side, contents)                                                                 \
    ((struct line){                                                                                     \
        .available = (contents)->side##_line.side##_available                                           \
                     == LDS_LDS_##SIDE##_LINE_##SIDE##_AVAILABLE_YES_CHOICE,                            \
        .measured = (contents)->side##_line.side##_measured                                             \
                    == LDS_LDS_##SIDE##_LINE_##SIDE##_MEASURED_MEASURED_CHOICE,                         \
        .has_numbers =                                                                                  \
            (contents)->side##_line.side##_offset != LDS_LDS_##SIDE##_LINE_##SIDE##_OFFSET_SNA_CHOICE   \
            && (contents)->side##_line.side##_heading                                                   \
                   != LDS_LDS_##SIDE##_LINE_##SIDE##_HEADING_SNA_CHOICE                                 \
            && (contents)->side##_curve.side##_curvature                                                \
                   != LDS_LDS_##SIDE##_CURVE_##SIDE##_CURVATURE_SNA_CHOICE                              \
            && (contents)->side##_curve.side##_curvature_rate                                           \
                   != LDS_LDS_##SIDE##_CURVE_##SIDE##_CURVATURE_RATE_SNA_CHOICE                         \
            && (contents)->markings.side##_range_end                                                    \
                   != LDS_LDS_MARKINGS_##SIDE##_RANGE_END_SNA_CHOICE,                                   \
        .quality = (contents)->side##_line.side##_quality,                                              \
        .order = (contents)->side##_curve.side##_order,                                                 \
        .offset_m = lds_lds_##side##_line_##side##_offset_decode(                                       \
            (contents)->side##_line.side##_offset),                                                     \
        .heading = lds_lds_##side##_line_##side##_heading_decode(                                       \
            (contents)->side##_line.side##_heading),                                                    \
        .curvature_per_m = lds_lds_##side##_curve_##side##_curvature_decode(                            \
            (contents)->side##_curve.side##_curvature),                                                 \
        .rate_per_m2 = lds_lds_##side##_curve_##side##_curvature_rate_decode(                           \
            (contents)->side##_curve.side##_curvature_rate),                                            \
        .start_m = lds_lds_##side##_line_##side##_range_start_decode(                                   \
            (contents)->side##_line.side##_range_start),                                                \
        .end_m = lds_lds_markings_##side##_range_end_decode((contents)->markings.side##_range_end),     \
        .raw = {(contents)->side##_line.side##_offset, (contents)->side##_line.side##_heading,          \
                (contents)->side##_curve.side##_curvature},                                             \
    })

struct lane lane_of(const struct contents *contents)
{
    const unsigned state = contents->status.sensor_state;
    return (struct lane){
        .left = READ_LINE(LEFT, left, contents),
        .right = READ_LINE(RIGHT, right, contents),
        .is_ready = state == LDS_LDS_STATUS_SENSOR_STATE_AVAILABLE_CHOICE
                    || state == LDS_LDS_STATUS_SENSOR_STATE_DEGRADED_CHOICE,
        .state = state,
        .change = contents->status.lane_change,
        .index = contents->image.image_index,
    };
}

bool line_is_near(const struct line *line)
{
    return line->available && line->has_numbers && line->quality >= LEAST_QUALITY && line->start_m <= NEAR_M;
}

double line_y(const struct line *line, double x_m)
{
    return line->offset_m
           + x_m * (line->heading + x_m * (line->curvature_per_m / 2 + x_m * line->rate_per_m2 / 6));
}

/* ---- one image with itself ---- */

static bool line_contradicts(const struct line *line, bool is_ready)
{
    if (line->available)
        return !is_ready || !line->has_numbers || line->quality == 0 || line->quality > 4
               || line->start_m > line->end_m;
    return line->measured || line->quality != 0;
}

static bool contradicts(const struct lane *lane)
{
    const bool crossed = line_is_near(&lane->left) && line_is_near(&lane->right)
                         && lane->left.offset_m <= lane->right.offset_m;
    return crossed || line_contradicts(&lane->left, lane->is_ready)
           || line_contradicts(&lane->right, lane->is_ready);
}

/* ---- one image with the one before ---- */

static bool jumped(const struct line *before, const struct line *now, unsigned images, double *step_m)
{
    if (!line_is_near(before) || !line_is_near(now))
        return false;
    *step_m = now->offset_m - before->offset_m;
    return fabs(*step_m) > MAX_STEP_M * images
           || fabs(now->heading - before->heading) > MAX_HEADING_STEP * images;
}

static void watch_still(unsigned still[3], const struct line *before, const struct line *now, int64_t t_ns,
                        enum message message, struct errors *errors)
{
    const bool measured = before->measured && now->measured;
    for (int k = 0; k < 3; k++) {
        const bool same = measured && now->raw[k] == before->raw[k] && (k < 2 || now->order >= 2);
        still[k] = same ? still[k] + 1 : 0;
        if (still[k] == STUCK_IMAGES)
            errors_add(errors, ERROR_STUCK, k < 2 ? message : message + 1, t_ns, 1, now->raw[k]);
    }
}

static void period(bool *running, bool now, enum error_class class, int64_t t_ns, double value,
                   struct errors *errors)
{
    if (now && !*running)
        errors_add(errors, class, MESSAGE_NONE, t_ns, 1, value);
    *running = now;
}

bool lane_plausible(struct lane_watch *watch, const struct lane *lane, int64_t t_ns, struct errors *errors)
{
    bool fine = true;
    period(&watch->not_ready, !lane->is_ready, ERROR_NOT_READY, t_ns, lane->state, errors);
    period(&watch->lost[0], lane->is_ready && !lane->left.available, ERROR_LEFT_LOST, t_ns, 0, errors);
    period(&watch->lost[1], lane->is_ready && !lane->right.available, ERROR_RIGHT_LOST, t_ns, 0, errors);
    if (contradicts(lane)) {
        errors_add(errors, ERROR_CONTRADICTION, MESSAGE_NONE, t_ns, 1, lane->state);
        fine = false;
    }
    const unsigned images = watch->has_last ? (uint16_t)(lane->index - watch->last.index) : 0;
    if (images >= 1 && images <= COMPARED_IMAGES) {
        const struct line *before[2] = {&watch->last.left, &watch->last.right};
        const struct line *now[2] = {&lane->left, &lane->right};
        const enum message messages[2] = {MESSAGE_LEFT_LINE, MESSAGE_RIGHT_LINE};
        const bool changes = lane->change == 1 || lane->change == 2; /* the lines take new names */
        for (int side = 0; side < 2; side++) {
            double step_m = 0;
            watch_still(watch->still[side], before[side], now[side], t_ns, messages[side], errors);
            if (!changes && jumped(before[side], now[side], images, &step_m)) {
                errors_add(errors, ERROR_JUMP, messages[side], t_ns, 1, step_m);
                fine = false;
            }
        }
    } else {
        memset(watch->still, 0, sizeof watch->still);
    }
    watch->last = *lane;
    watch->has_last = true;
    return fine;
}
