#include "candump.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#define LINE_LENGTH 256
#define SECOND_NS 1000000000LL

static bool read_time(const char **text, int64_t *t_ns)
{
    char *end = NULL;
    if (**text != '(')
        return false;
    const long long seconds = strtoll(*text + 1, &end, 10);
    if (*end != '.')
        return false;
    int64_t unit_ns = SECOND_NS / 10, part_ns = 0;
    for (end++; isdigit((unsigned char)*end); end++, unit_ns /= 10)
        part_ns += (*end - '0') * unit_ns;
    *t_ns = seconds * SECOND_NS + part_ns;
    *text = end;
    return *end == ')';
}

static int digit(char letter)
{
    return isdigit((unsigned char)letter) ? letter - '0' : tolower((unsigned char)letter) - 'a' + 10;
}

/* "(seconds) channel id#data"; data of classic frames, anything longer is cut. */
static bool read_line(const char *text, int64_t *t_ns, struct ecu_frame *frame)
{
    char *end = NULL;
    *frame = (struct ecu_frame){0};
    if (!read_time(&text, t_ns) || !(text = strchr(text, ' ')) || !(text = strchr(text + 1, ' ')))
        return false;
    frame->id = (uint32_t)strtoul(text + 1, &end, 16);
    if (*end != '#')
        return false;
    for (end++; isxdigit((unsigned char)end[0]) && isxdigit((unsigned char)end[1]); end += 2)
        if (frame->length < sizeof frame->data)
            frame->data[frame->length++] = (uint8_t)(digit(end[0]) << 4 | digit(end[1]));
    return true;
}

static void write_request(FILE *file, const struct ecu_frame *frame, int64_t t_ns)
{
    fprintf(file, "(%lld.%06lld) vcan0 %03X#", (long long)(t_ns / SECOND_NS),
            (long long)(t_ns % SECOND_NS / 1000), (unsigned)frame->id);
    for (int k = 0; k < frame->length; k++)
        fprintf(file, "%02X", frame->data[k]);
    fputc('\n', file);
}

int64_t candump_run(struct ecu *ecu, FILE *log, FILE *requests, unsigned *line)
{
    char text[LINE_LENGTH];
    int64_t t_ns = 0, step_ns = 0;
    for (*line = 1; fgets(text, sizeof text, log); (*line)++) {
        struct ecu_frame frame;
        if (!read_line(text, &t_ns, &frame))
            return -1;
        for (step_ns = step_ns ? step_ns : t_ns; step_ns < t_ns; step_ns += ECU_STEP_NS) {
            const struct ecu_frame answer = ecu_step(ecu, step_ns);
            if (requests)
                write_request(requests, &answer, step_ns);
        }
        ecu_receive(ecu, &frame, t_ns);
    }
    return t_ns;
}
