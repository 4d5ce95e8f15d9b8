#include "errors.h"

#include <inttypes.h>

static const char *const class_names[ERROR_COUNT] = {
#define X(CONSTANT, name) [ERROR_##CONSTANT] = #name,
    ECU_ERRORS(X)
#undef X
};

static const char *message_name(int message)
{
    return message == MESSAGE_NONE ? "" : message_plans[message].name;
}

void errors_add(struct errors *errors, enum error_class class, enum message message, int64_t t_ns,
                uint64_t count, double value)
{
    errors->counts[class][message] += count;
    if (errors->total < ERROR_LOG_SIZE)
        errors->log[errors->total] = (struct error_entry){t_ns, class, message, value};
    errors->total++;
}

uint64_t errors_of(const struct errors *errors, enum error_class class)
{
    uint64_t sum = 0;
    for (int message = 0; message <= MESSAGE_COUNT; message++)
        sum += errors->counts[class][message];
    return sum;
}

static void write_by_message(const struct errors *errors, FILE *file)
{
    const char *between = "";
    fputs("\"by_message\": {", file);
    for (int message = 0; message < MESSAGE_COUNT; message++) {
        const char *inner = "";
        for (int class = 0; class < ERROR_COUNT; class++) {
            if (errors->counts[class][message] == 0)
                continue;
            if (*inner == '\0')
                fprintf(file, "%s\"%s\": {", between, message_name(message));
            fprintf(file, "%s\"%s\": %" PRIu64, inner, class_names[class], errors->counts[class][message]);
            inner = ", ";
            between = "}, ";
        }
    }
    fputs(*between ? "}}" : "}", file);
}

static void write_log(const struct errors *errors, int64_t start_ns, FILE *file)
{
    const uint64_t kept = errors->total < ERROR_LOG_SIZE ? errors->total : ERROR_LOG_SIZE;
    fputs("\"log\": [", file);
    for (uint64_t k = 0; k < kept; k++) {
        const struct error_entry *entry = &errors->log[k];
        fprintf(file, "%s{\"t_s\": %.3f, \"error\": \"%s\", \"message\": \"%s\", \"value\": %.6g}",
                k ? ", " : "", (double)(entry->t_ns - start_ns) / 1e9, class_names[entry->class],
                message_name((int)entry->message), entry->value);
    }
    fprintf(file, "], \"log_left_out\": %" PRIu64, errors->total - kept);
}

void errors_write(const struct errors *errors, int64_t start_ns, FILE *file)
{
    fputs("\"errors\": {", file);
    for (int class = 0; class < ERROR_COUNT; class++)
        fprintf(file, "%s\"%s\": %" PRIu64, class ? ", " : "", class_names[class],
                errors_of(errors, (enum error_class)class));
    fputs("}, ", file);
    write_by_message(errors, file);
    fputs(", ", file);
    write_log(errors, start_ns, file);
}
