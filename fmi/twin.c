/* Content of a unit: the simulated instrument, in a Python process of its own (twin_process.py in the folder `resources`).

   Python is not loaded into the importer, which may have another one loaded, such as MATLAB, or FMPy. POSIX only. */

#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "unit.h"

#ifndef MSG_NOSIGNAL /* macOS: SO_NOSIGPIPE */
#define MSG_NOSIGNAL 0
#endif

extern char **environ;

typedef struct {
    pid_t process;
    int channel;
} Twin;

/* Receives from the process; 0, with a message, if it has ended or has not answered for `limit` seconds.

   Seconds of waiting are counted, so that the time for which the importer itself was stopped, as by Ctrl-Z, does not count. */
static int receive_all(const Unit *unit, void *data, size_t length, long limit) {
    struct pollfd channel = {.fd = ((Twin *)unit->content)->channel, .events = POLLIN};
    long seconds = 0;
    for (char *next = data; length > 0;) {
        const int ready = poll(&channel, 1, 1000);
        if (ready > 0) {
            const ssize_t received = recv(channel.fd, next, length, 0);
            if (received <= 0) {
                unit_log(unit, fmi3Error, "the Python process has ended; was it started? Parameter python: %s", unit->text);
                return 0;
            }
            next += received;
            length -= (size_t)received;
        } else if ((ready == 0 || errno != EINTR) && ++seconds >= limit) {
            unit_log(unit, fmi3Error,
                     "the Python process has not answered for %ld s. Reset and initialize the unit: this ends the process and "
                     "starts another. Parameter python: %s",
                     seconds, unit->text);
            return 0;
        }
    }
    return 1;
}

/* A reply is a number: 0 and then the outputs in the order of the variables, or else the length of a message and the message. */
static fmi3Status receive_outputs(Unit *unit, long periods) {
    const long limit = TIME_LIMIT + periods;
    double length, outputs[OUTPUTS];
    char message[TEXT_LENGTH] = "";
    if (!receive_all(unit, &length, sizeof length, limit)) {
        return fmi3Error;
    }
    if (length > 0.0) {
        if (receive_all(unit, message, length < TEXT_LENGTH - 1 ? (size_t)length : TEXT_LENGTH - 1, limit)) {
            unit_log(unit, fmi3Error, "%s", message);
        }
        return fmi3Error;
    }
    if (!receive_all(unit, outputs, sizeof outputs, limit)) {
        return fmi3Error;
    }
    memcpy(unit->values + APPLIED, outputs, sizeof outputs);
    return fmi3OK;
}

fmi3Status content_start(Unit *unit) {
    char script[2 * TEXT_LENGTH], config[2 * TEXT_LENGTH], seed[16];
    char *has_camera = unit->values[HAS_CAMERA] != 0.0 ? "1" : "0";
    char *arguments[] = {unit->text, script, config, seed, has_camera, NULL};
    posix_spawn_file_actions_t actions;
    int channels[2], error;
    Twin *twin = calloc(1, sizeof *twin);
    unit_resource(unit, "twin_process.py", script, sizeof script);
    unit_resource(unit, "config.toml", config, sizeof config);
    snprintf(seed, sizeof seed, "%ld", (long)unit->values[SEED]);
    if (!twin || socketpair(AF_UNIX, SOCK_STREAM, 0, channels) != 0) {
        unit_log(unit, fmi3Error, "no socket: %s", strerror(errno));
        free(twin);
        return fmi3Error;
    }
    /* Only the end that is its standard input remains open in the process. */
    fcntl(channels[0], F_SETFD, FD_CLOEXEC);
    fcntl(channels[1], F_SETFD, FD_CLOEXEC);
#ifdef SO_NOSIGPIPE
    setsockopt(channels[0], SOL_SOCKET, SO_NOSIGPIPE, &(int){1}, sizeof(int));
#endif
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, channels[1], 0);
    posix_spawn_file_actions_adddup2(&actions, 2, 1);
    error = posix_spawnp(&twin->process, unit->text, &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(channels[1]);
    twin->channel = channels[0];
    if (error != 0) {
        unit_log(unit, fmi3Error, "parameter python: %s cannot be started: %s", unit->text, strerror(error));
        close(twin->channel);
        free(twin);
        return fmi3Error;
    }
    unit->content = twin;
    return receive_outputs(unit, 0);
}

fmi3Status content_step(Unit *unit, double time, long periods) {
    const double *command = unit->values + COMMAND;
    const double request[4] = {(double)periods, command[0], command[1], command[2]};
    (void)time;
    /* It does not block, as the process has read the one before. A process that has ended may have left a message. */
    (void)send(((Twin *)unit->content)->channel, request, sizeof request, MSG_NOSIGNAL);
    return receive_outputs(unit, periods);
}

/* The process ends when its channel is closed, but one that hangs does not notice that. */
void content_stop(Unit *unit) {
    Twin *twin = unit->content;
    if (twin) {
        close(twin->channel);
        if (waitpid(twin->process, NULL, WNOHANG) == 0) {
            kill(twin->process, SIGKILL);
            while (waitpid(twin->process, NULL, 0) < 0 && errno == EINTR) {
            }
        }
        free(twin);
        unit->content = NULL;
    }
}
