/* ecu --bus INTERFACE [--duration SECONDS] | --log FILE [--requests FILE]: a lane keeping ECU.
 *
 * Listens to the lane sensor of dbc/lds.dbc, checks it as a consumer has to, sends its steering request of
 * dbc/vehicle.dbc every 20 ms. At its end (after SECONDS from the sensor's first frame, on SIGTERM or SIGINT,
 * at the end of the log) it prints what it found as one line of JSON. Exit status 2: cannot run. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bus.h"
#include "candump.h"

#define CANNOT_RUN 2
#define SECOND_NS 1000000000LL

struct options {
    const char *bus, *log, *requests;
    double duration_s;
    struct steering_config steering;
};

static volatile sig_atomic_t stopped;

static void stop(int number)
{
    (void)number;
    stopped = 1;
}

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now); /* as the kernel stamps frames */
    return (int64_t)now.tv_sec * SECOND_NS + now.tv_nsec;
}

/* ---- command line ---- */

static bool read_number(const char *text, double *number)
{
    char *end = NULL;
    *number = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*number) && *number > 0;
}

static bool read_options(int count, char *words[], struct options *options)
{
    static const struct option known[] = {
        {"bus", required_argument, NULL, 'b'},        {"log", required_argument, NULL, 'l'},
        {"requests", required_argument, NULL, 'r'},   {"duration", required_argument, NULL, 'd'},
        {"wheelbase-m", required_argument, NULL, 'w'}, {"preview-m", required_argument, NULL, 'p'},
        {NULL, 0, NULL, 0},
    };
    *options = (struct options){.duration_s = INFINITY, .steering = {.wheelbase_m = 2.8, .preview_m = 16}};
    for (int letter; (letter = getopt_long(count, words, "", known, NULL)) != -1;) {
        double *number = letter == 'd'   ? &options->duration_s
                         : letter == 'w' ? &options->steering.wheelbase_m
                         : letter == 'p' ? &options->steering.preview_m
                                         : NULL;
        if (letter == 'b')
            options->bus = optarg;
        else if (letter == 'l')
            options->log = optarg;
        else if (letter == 'r')
            options->requests = optarg;
        else if (!number || !read_number(optarg, number))
            return false;
    }
    return optind == count && !options->bus != !options->log;
}

/* ---- the two ways to run ---- */

static int run_log(struct ecu *ecu, const struct options *options)
{
    FILE *log = fopen(options->log, "r");
    FILE *requests = options->requests ? fopen(options->requests, "w") : NULL;
    if (!log || (options->requests && !requests)) {
        fprintf(stderr, "ecu: %s: %s\n", log ? options->requests : options->log, strerror(errno));
        return CANNOT_RUN;
    }
    if (requests)
        setvbuf(requests, NULL, _IOLBF, 0); /* whoever makes the log while we read it waits for the answers */
    unsigned line = 0;
    const int64_t end_ns = candump_run(ecu, log, requests, &line);
    if (end_ns < 0)
        fprintf(stderr, "ecu: %s: line %u is no frame as candump -L writes it\n", options->log, line);
    else
        ecu_report(ecu, end_ns, 0, stdout);
    fclose(log);
    if (requests)
        fclose(requests);
    return end_ns < 0 ? CANNOT_RUN : 0;
}

/* Take all that has come: only then deadlines may be judged, however late this process is. */
static void drain(struct ecu *ecu, struct bus *bus)
{
    struct ecu_frame frame;
    int64_t t_ns;
    while (bus_receive(bus, &frame, &t_ns))
        ecu_receive(ecu, &frame, t_ns);
}

static bool is_over(const struct ecu *ecu, const struct options *options, int64_t t_ns)
{
    return stopped || (ecu->started && (double)(t_ns - ecu->start_ns) / 1e9 >= options->duration_s);
}

static int run_bus(struct ecu *ecu, const struct options *options)
{
    struct bus bus;
    if (!bus_open(&bus, options->bus))
        return CANNOT_RUN;
    fprintf(stderr, "ecu: listening on %s\n", options->bus);
    int64_t step_ns = now_ns();
    while (!is_over(ecu, options, now_ns())) {
        const int64_t wait_ns = step_ns - now_ns();
        struct pollfd heard = {.fd = bus.socket, .events = POLLIN};
        if (wait_ns > 0)
            (void)poll(&heard, 1, (int)(wait_ns / 1000000) + 1);
        const int64_t before_ns = now_ns(); /* what comes later is not missing at this time */
        drain(ecu, &bus);
        if (before_ns < step_ns)
            continue;
        const struct ecu_frame request = ecu_step(ecu, before_ns);
        (void)bus_send(&bus, &request);
        step_ns += ECU_STEP_NS;
        if (step_ns < before_ns) /* after a stall: no burst of requests */
            step_ns = before_ns + ECU_STEP_NS;
    }
    drain(ecu, &bus); /* what had come before the signal */
    ecu_report(ecu, now_ns(), bus.overrun, stdout);
    return 0;
}

int main(int count, char *words[])
{
    static struct ecu ecu; /* its error log is larger than a stack frame should be */
    struct options options;
    if (!read_options(count, words, &options)) {
        fputs("usage: ecu --bus INTERFACE [--duration SECONDS] | --log FILE [--requests FILE]\n"
              "           [--wheelbase-m M] [--preview-m M]\n",
              stderr);
        return CANNOT_RUN;
    }
    const struct sigaction action = {.sa_handler = stop};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    ecu_init(&ecu, options.steering);
    return options.log ? run_log(&ecu, &options) : run_bus(&ecu, &options);
}
