#include "messages.h"

#define MS 1000000LL

const struct message_plan message_plans[MESSAGE_COUNT] = {
#define X(MACRO, part)                                                                                  \
    [MESSAGE_##MACRO] = {.name = LDS_LDS_##MACRO##_NAME,                                                \
                         .id = LDS_LDS_##MACRO##_FRAME_ID,                                              \
                         .data_id = LDS_LDS_##MACRO##_FRAME_ID, /* ids and data ids are the same */     \
                         .length = LDS_LDS_##MACRO##_LENGTH,                                            \
                         .cycle_ns = LDS_LDS_##MACRO##_CYCLE_TIME_MS * MS},
    ECU_MESSAGES(X)
#undef X
};

enum message message_of(uint32_t id)
{
    for (int message = 0; message < MESSAGE_COUNT; message++)
        if (message_plans[message].id == id)
            return (enum message)message;
    return MESSAGE_NONE;
}

uint8_t message_unpack(struct contents *contents, enum message message, const uint8_t *data, size_t length)
{
    switch (message) {
#define X(MACRO, part)                                                                                  \
    case MESSAGE_##MACRO:                                                                               \
        (void)lds_lds_##part##_unpack(&contents->part, data, length);                                   \
        return contents->part.part##_burst;
        ECU_MESSAGES(X)
#undef X
    default:
        return 0;
    }
}
