#include "ecu.h"

#include <inttypes.h>
#include <math.h>

#include "vehicle.h"

#define REQUEST_DATA_ID VEHICLE_ECU_STEERING_FRAME_ID

void ecu_init(struct ecu *ecu, struct steering_config steering)
{
    *ecu = (struct ecu){0};
    steering_init(&ecu->steering, steering);
}

static void start(struct ecu *ecu, int64_t t_ns)
{
    ecu->started = true;
    ecu->start_ns = t_ns;
    for (int message = 0; message < MESSAGE_COUNT; message++)
        ecu->messages[message].heard_ns = ecu->messages[message].good_ns = t_ns;
}

void ecu_deadlines(struct ecu *ecu, int64_t t_ns)
{
    for (int k = 0; ecu->started && k < MESSAGE_COUNT; k++) {
        struct ecu_message *message = &ecu->messages[k];
        const int64_t age_ns = t_ns - message->heard_ns;
        if (age_ns * 2 > ECU_TIMEOUT_CYCLES_2 * message_plans[k].cycle_ns && !message->timed_out) {
            message->timed_out = true;
            errors_add(&ecu->errors, ERROR_TIMEOUT, (enum message)k, t_ns, 1, (double)age_ns / 1e9);
        }
    }
}

/* ---- one frame ---- */

static unsigned cycles_missed(const struct ecu_message *message, int64_t cycle_ns, int64_t t_ns)
{
    const int64_t cycles = (t_ns - message->good_ns + cycle_ns / 2) / cycle_ns;
    return cycles > 1 ? (unsigned)(cycles < 1000 ? cycles - 1 : 1000) : 0;
}

static void note(struct ecu *ecu, enum message which, bool bad, int64_t t_ns)
{
    if (e2e_note(&ecu->messages[which].receiver, bad))
        errors_add(&ecu->errors, ERROR_INVALID, which, t_ns, 1, 0);
}

/* Check length, CRC and counter; returns whether the content may be used. */
static bool check(struct ecu *ecu, enum message which, const struct ecu_frame *frame, int64_t t_ns)
{
    const struct message_plan *plan = &message_plans[which];
    struct ecu_message *message = &ecu->messages[which];
    if (frame->length != plan->length) {
        errors_add(&ecu->errors, ERROR_LENGTH, which, t_ns, 1, frame->length);
        note(ecu, which, true, t_ns);
        return false;
    }
    if (t_ns - message->heard_ns > message->longest_ns)
        message->longest_ns = t_ns - message->heard_ns;
    message->heard_ns = t_ns;
    message->timed_out = false;
    unsigned lost = 0;
    const unsigned missed = cycles_missed(message, plan->cycle_ns, t_ns);
    const enum e2e_status status
        = e2e_p01_receive(&message->receiver, plan->data_id, frame->data, frame->length, missed, &lost);
    if (status == E2E_WRONG_CRC)
        errors_add(&ecu->errors, ERROR_CRC, which, t_ns, 1, frame->data[0]);
    else
        message->good_ns = t_ns;
    if (status == E2E_REPEATED)
        errors_add(&ecu->errors, ERROR_REPEATED, which, t_ns, 1, message->receiver.last);
    if (status == E2E_WRONG_SEQUENCE)
        errors_add(&ecu->errors, ERROR_SEQUENCE, which, t_ns, 1, frame->data[1] & 15u);
    if (lost > 0)
        errors_add(&ecu->errors, ERROR_LOST, which, t_ns, lost, lost);
    note(ecu, which, status >= E2E_REPEATED, t_ns);
    return e2e_usable(&message->receiver, status);
}

/* ---- images ---- */

static void check_image(struct ecu *ecu, int64_t t_ns)
{
    const struct lds_lds_image_t *image = &ecu->contents.image;
    const uint16_t step = (uint16_t)(image->image_index - ecu->image_index);
    const uint32_t step_ms = image->image_timestamp - ecu->image_timestamp;
    if (ecu->has_image && (step == 0 || step_ms == 0))
        errors_add(&ecu->errors, ERROR_FROZEN, MESSAGE_IMAGE, t_ns, 1, image->image_index);
    else if (ecu->has_image && (step > UINT16_MAX / 2 || step_ms > UINT32_MAX / 2))
        errors_add(&ecu->errors, ERROR_BACKWARDS, MESSAGE_IMAGE, t_ns, 1, image->image_index);
    else if (ecu->has_image)
        ecu->images_skipped += step - 1u;
    ecu->has_image = true;
    ecu->image_index = image->image_index;
    ecu->image_timestamp = image->image_timestamp;
}

static void see(struct ecu *ecu, int64_t t_ns)
{
    const struct lane lane = lane_of(&ecu->contents);
    const bool is_new = !ecu->watch.has_last || lane.index != ecu->watch.last.index;
    ecu->bursts++;
    if (lane_plausible(&ecu->watch, &lane, t_ns, &ecu->errors) && is_new) {
        ecu->steered_by++;
        steering_see(&ecu->steering, &lane, t_ns);
    }
}

void ecu_receive(struct ecu *ecu, const struct ecu_frame *frame, int64_t t_ns)
{
    const enum message which = message_of(frame->id);
    if (which == MESSAGE_NONE) {
        ecu->frames_of_others++;
        return;
    }
    if (!ecu->started)
        start(ecu, t_ns);
    ecu_deadlines(ecu, t_ns);
    ecu->frames++;
    if (!check(ecu, which, frame, t_ns))
        return;
    const uint8_t image = message_unpack(&ecu->contents, which, frame->data, frame->length);
    if (which == MESSAGE_IMAGE)
        check_image(ecu, t_ns);
    const struct burst_result result = burst_add(&ecu->burst, which, image);
    if (result.foreign)
        errors_add(&ecu->errors, ERROR_MISMATCH, which, t_ns, 1, image);
    if (result.incomplete)
        errors_add(&ecu->errors, ERROR_INCOMPLETE, MESSAGE_NONE, t_ns, 1, image);
    if (result.complete)
        see(ecu, t_ns);
}

/* ---- steering ---- */

static struct ecu_frame request(struct ecu *ecu, double angle_rad)
{
    struct ecu_frame frame = {.id = VEHICLE_ECU_STEERING_FRAME_ID, .length = VEHICLE_ECU_STEERING_LENGTH};
    struct vehicle_ecu_steering_t content = {0};
    content.requested_wheel_angle
        = isnan(angle_rad) ? VEHICLE_ECU_STEERING_REQUESTED_WHEEL_ANGLE_SNA_CHOICE
                           : vehicle_ecu_steering_requested_wheel_angle_encode(angle_rad);
    (void)vehicle_ecu_steering_pack(frame.data, &content, sizeof frame.data);
    e2e_p01_protect(REQUEST_DATA_ID, ecu->request_counter, frame.data, frame.length);
    ecu->request_counter = (uint8_t)((ecu->request_counter + 1u) % E2E_COUNTER_STATES);
    return frame;
}

struct ecu_frame ecu_step(struct ecu *ecu, int64_t t_ns)
{
    ecu_deadlines(ecu, t_ns);
    const double angle_rad = steering_step(&ecu->steering, t_ns, (double)ECU_STEP_NS / 1e9);
    ecu->requests++;
    ecu->requests_without_angle += isnan(angle_rad) ? 1 : 0;
    if (fabs(angle_rad) > ecu->largest_request_rad)
        ecu->largest_request_rad = fabs(angle_rad);
    return request(ecu, angle_rad);
}

void ecu_report(const struct ecu *ecu, int64_t end_ns, uint64_t frames_overrun, FILE *file)
{
    int64_t longest_ns = 0;
    for (int k = 0; k < MESSAGE_COUNT; k++)
        if (ecu->messages[k].longest_ns > longest_ns)
            longest_ns = ecu->messages[k].longest_ns;
    fprintf(file,
            "{\"seconds\": %.3f, \"frames\": %" PRIu64 ", \"frames_of_others\": %" PRIu64
            ", \"frames_overrun\": %" PRIu64 ", \"bursts\": %" PRIu64 ", \"images_skipped\": %" PRIu64
            ", \"images_steered_by\": %" PRIu64 ", \"longest_gap_ms\": %.3f, ",
            ecu->started ? (double)(end_ns - ecu->start_ns) / 1e9 : 0.0, ecu->frames,
            ecu->frames_of_others, frames_overrun, ecu->bursts, ecu->images_skipped, ecu->steered_by,
            (double)longest_ns / 1e6);
    fprintf(file,
            "\"requests\": %" PRIu64 ", \"requests_without_angle\": %" PRIu64
            ", \"largest_request_rad\": %.5f, ",
            ecu->requests, ecu->requests_without_angle, ecu->largest_request_rad);
    errors_write(&ecu->errors, ecu->start_ns, file);
    fputs("}\n", file);
}
