/* Logs as `candump -L` writes them: what was heard is run through the ECU in no time. */
#ifndef ECU_CANDUMP_H
#define ECU_CANDUMP_H

#include "ecu.h"

/* Run a log through the ECU, with its control steps in between at 20 ms of the log's time; the requests go to
 * `requests` if that is not NULL. Returns the time of the last step, or -1 where a line is no frame (then
 * `*line` is its number). */
int64_t candump_run(struct ecu *ecu, FILE *log, FILE *requests, unsigned *line);

#endif
