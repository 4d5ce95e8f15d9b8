#include "burst.h"

#define ALL_SEEN ((1u << MESSAGE_COUNT) - 1u)

_Static_assert(MESSAGE_COUNT <= 16, "`seen` has a bit per message");

/* Images go forward: of 16 numbers, the next 7 are newer, the last 8 older. A new image frame always begins
 * a burst, so that a sensor that has started again (its index goes back to 0) is followed at once. */
static bool begins_burst(const struct burst *burst, enum message message, uint8_t image)
{
    const unsigned ahead = (unsigned)(image - burst->image) & 15u;
    const bool again = (burst->seen >> message) & 1u;
    if (!burst->open || (message == MESSAGE_IMAGE && (again || ahead != 0)))
        return true;
    return ahead == 0 ? again : ahead < 8;
}

struct burst_result burst_add(struct burst *burst, enum message message, uint8_t image)
{
    struct burst_result result = {false, false, false};
    if (begins_burst(burst, message, image)) {
        result.incomplete = burst->open && burst->seen != ALL_SEEN;
        *burst = (struct burst){.open = true, .image = image};
    } else if (image != burst->image) {
        result.foreign = true;
        return result;
    }
    burst->seen |= (uint16_t)(1u << message);
    result.complete = burst->seen == ALL_SEEN;
    return result;
}
