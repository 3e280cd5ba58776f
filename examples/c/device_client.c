/* The device's end of the device protocol (docs/device-protocol.md), in plain C99 and POSIX sockets.
 *
 *     cc -O2 -std=c99 -o device_client examples/c/device_client.c -lm
 *     ./device_client 127.0.0.1 9750 10
 *
 * It plays a tool that circles on a plane, pressed with 1 N, for some seconds, and prints what it was told to drive. An
 * OpenHaptics or CHAI3D program calls the same three functions from its servo loop: put what the device senses into
 * `sensed`, call exchange(), and drive what came back.
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { STATE_BYTES = 120, COMMAND_BYTES = 72, HEADER_BYTES = 24 };

/* SI units: m, rad, N, N m. */
struct sensed {
    double position[3], orientation[3], force[3], torque[3];
};

/* N, A, A; `running` is 0 when the graph has ended. */
struct driven {
    double force[3], current, brake;
    int running;
};

static void put(uint8_t *at, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        at[i] = (uint8_t)(value >> (8 * i));
}

static uint64_t get(const uint8_t *at, int bytes)
{
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++)
        value |= (uint64_t)at[i] << (8 * i);
    return value;
}

static void put_number(uint8_t *at, double number)
{
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    put(at, bits, 8);
}

static double get_number(const uint8_t *at)
{
    uint64_t bits = get(at, 8);
    double number;
    memcpy(&number, &bits, sizeof number);
    return number;
}

static uint64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

/* Opens a socket to haptograph; answers that take longer than the watchdog's time are not waited for. */
static int open_device(const char *host, int port, int watchdog_ms)
{
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_port = htons((uint16_t)port) };
    struct timeval wait = { watchdog_ms / 1000, watchdog_ms % 1000 * 1000 };
    int device = socket(AF_INET, SOCK_DGRAM, 0);
    if (device < 0)
        return -1;
    if (inet_pton(AF_INET, host, &to.sin_addr) == 1
        && setsockopt(device, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait) == 0
        && connect(device, (struct sockaddr *)&to, sizeof to) == 0)
        return device;
    close(device);
    return -1;
}

/* Sends what is sensed and waits for the answer to it. Returns the round trip in ns, or 0 when there was none within the
 * watchdog's time: then `driven` is zero, and that is what has to be driven. */
static uint64_t exchange(int device, uint32_t sequence, const struct sensed *sensed, struct driven *driven)
{
    uint8_t state[STATE_BYTES] = { 'H', 'G', 'R', 'F', 1, 0, 1, 0 };
    const double *numbers[4] = { sensed->position, sensed->orientation, sensed->force, sensed->torque };
    uint8_t answer[COMMAND_BYTES + 1];
    memset(driven, 0, sizeof *driven);
    put(state + 8, sequence, 4);
    put(state + 16, now_ns(), 8);
    for (int part = 0; part < 4; part++)
        for (int i = 0; i < 3; i++)
            put_number(state + HEADER_BYTES + 24 * part + 8 * i, numbers[part][i]);
    /* That nobody listened to an earlier packet is told by an error of a later call; the last answer may still wait. */
    if (send(device, state, sizeof state, 0) != (ssize_t)sizeof state && errno != ECONNREFUSED)
        return 0;
    for (;;) {
        ssize_t length = recv(device, answer, sizeof answer, 0);
        if (length < 0 && (errno == EINTR || errno == ECONNREFUSED))
            continue;
        if (length < 0)
            return 0;
        if (length != COMMAND_BYTES || memcmp(answer, "HGRF\1\0\2\0", 8) != 0)
            continue; /* not for us */
        driven->running = get_number(answer + 64) != 0.0;
        if (driven->running && get(answer + 12, 4) != sequence)
            continue; /* the late answer to an earlier state */
        for (int i = 0; i < 3; i++)
            driven->force[i] = get_number(answer + HEADER_BYTES + 8 * i);
        driven->current = get_number(answer + 48);
        driven->brake = get_number(answer + 56);
        return now_ns() - get(answer + 16, 8);
    }
}

/* The largest of what is driven: the length of the force, N, and both currents, A. */
static double size(const struct driven *driven)
{
    const double *f = driven->force;
    double force = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    return fmax(force, fmax(fabs(driven->current), fabs(driven->brake)));
}

int main(int count, char **words)
{
    const char *host = count > 1 ? words[1] : "127.0.0.1";
    int port = count > 2 ? atoi(words[2]) : 9750;
    double seconds = count > 3 ? atof(words[3]) : 10.0;
    struct in_addr address;
    if (inet_pton(AF_INET, host, &address) != 1 || port < 1 || port > 65535) {
        fprintf(stderr, "usage: %s [ADDRESS [PORT [SECONDS]]], with an address in numbers: 127.0.0.1 9750 10\n", words[0]);
        return 1;
    }
    int device = open_device(host, port, 20);
    if (device < 0) {
        perror("cannot open a socket");
        return 1;
    }
    uint64_t start = now_ns(), longest = 0, answers = 0;
    double largest = 0.0;
    struct driven driven = { .running = 1 };
    for (uint32_t sequence = 0; (double)(now_ns() - start) < 1e9 * seconds; sequence++) {
        double t = 1e-9 * (double)(now_ns() - start), angle = 2.0 * 3.14159265358979 * t;
        struct sensed sensed = { .position = { 0.02 * cos(angle), 0.02 * sin(angle), 0.0 }, .force = { 0.0, 0.0, 1.0 } };
        uint64_t took = exchange(device, sequence, &sensed, &driven);
        if (took > 0) {
            answers++;
            if (!driven.running)
                break;
            if (took > longest)
                longest = took;
            largest = fmax(largest, size(&driven));
        }
        struct timespec rest = { 0, 1000000 };
        nanosleep(&rest, NULL);
    }
    printf("%llu answers, longest round trip %.3f ms, largest drive (N or A) %g\n", (unsigned long long)answers,
           1e-6 * (double)longest, largest);
    close(device);
    return answers > 0 ? 0 : 2;
}
