/* Lock step for Betaflight's software-in-the-loop target: its clock is the simulation's.
 *
 * This file is linked with the object files of Betaflight's target SITL. The linker replaces some
 * functions of the C library by those below (option --wrap), so that the source of the firmware
 * stays as it is:
 *
 *   clock_gettime, nanosleep   the time is a counter, which each pass of the main loop advances
 *   pthread_*                  the firmware's threads for sockets are not started
 *   bind, sendto               no socket is opened; the motor commands are kept
 *
 * Each period of simulated time the main loop stops and exchanges one message: requests come from the
 * standard input, replies go to a file descriptor of their own, as the firmware prints to stdout. As nothing depends on the wall's clock, equal requests give equal
 * replies to the last bit.
 *
 * Environment: QUADSIM_PERIOD_US, the period of the exchange [us], a multiple of 50;
 * QUADSIM_REPLIES, the file descriptor of the replies.
 *
 * All numbers are in the units of quadsim: rad/s, m/s^2, the body frame with x forward, y to the
 * left and z up.
 */
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "platform.h"

#include "cli/cli.h"
#include "drivers/accgyro/accgyro.h"
#include "drivers/accgyro/accgyro_virtual.h"
#include "drivers/serial.h"
#include "drivers/time.h"
#include "fc/core.h"
#include "fc/rc.h"
#include "fc/runtime_config.h"
#include "flight/imu.h"
#include "rx/rx.h"

#define REQUESTS 0
#define MOTORS 4
#define CHANNELS 16
#define LONGEST_LINE 1024
#define LONGEST_REPLY (1 << 20)
#define MAIN_LOOP_NS 50000

/* Scales of the virtual sensors, per degree per second and per m/s^2. */
static const double GYRO_SCALE = 16.4 * 180.0 / M_PI;
static const double ACCELEROMETER_SCALE = 256.0 / 9.80665;

enum kind { STEP = 1, COMMAND_LINE = 2 };

struct step_request {
    double gyro[3];
    double acceleration[3];  /* specific force */
    double attitude[4];      /* wxyz */
    double periods;          /* for how many the request counts, at least 1 */
    double frame_every;      /* a frame of the radio link arrives every so many of them; 0: none */
    double channels[CHANNELS];  /* 1000 to 2000 us, in the order roll, pitch, throttle, yaw, AUX */
};

struct step_reply {
    double motors[MOTORS];  /* 0 to 1, of the motors 1 to 4 */
    double setpoint[3];     /* body rates that the sticks ask for [deg/s], roll, pitch, yaw */
    double armed;
    double arming_flags;    /* what prevents arming, a bit each */
};

extern rxRuntimeState_t rxRuntimeState;

static uint64_t now_ns = 1000000000;
static uint64_t next_exchange_ns;
static uint64_t period_ns;
static int replies_fd;
static bool running;
static bool frame_waiting;
static uint64_t periods_left, periods_done;
static struct step_request request;
static struct step_reply reply;

/* ---- messages ---- */

/* End the process, with its log written, when the simulation has closed its side. */
static void receive(void *data, size_t size) {
    char *next = data;
    while (size) {
        ssize_t count = read(REQUESTS, next, size);
        if (count <= 0) exit(0);
        next += count;
        size -= count;
    }
}

static void send_all(const void *data, size_t size) {
    const char *next = data;
    while (size) {
        ssize_t count = write(replies_fd, next, size);
        if (count <= 0) exit(0);
        next += count;
        size -= count;
    }
}

/* ---- the command line, on a serial port in memory ---- */

static char line[LONGEST_LINE];
static uint32_t line_size, line_read;
static char answer[LONGEST_REPLY];
static uint32_t answer_size;

static void port_write(serialPort_t *port, uint8_t byte) {
    (void)port;
    if (answer_size < LONGEST_REPLY) answer[answer_size++] = byte;
}
static void port_write_all(serialPort_t *port, const void *data, int count) {
    const uint8_t *bytes = data;
    for (int i = 0; i < count; i++) port_write(port, bytes[i]);
}
static uint32_t port_waiting(const serialPort_t *port) { (void)port; return line_size - line_read; }
static uint32_t port_free(const serialPort_t *port) { (void)port; return LONGEST_LINE; }
static uint8_t port_read(serialPort_t *port) { (void)port; return line[line_read++]; }
static void port_set_rate(serialPort_t *port, uint32_t rate) { (void)port; (void)rate; }
static bool port_is_sent(const serialPort_t *port) { (void)port; return true; }
static void port_set_mode(serialPort_t *port, portMode_e mode) { (void)port; (void)mode; }
static void port_begin(serialPort_t *port) { (void)port; }

static const struct serialPortVTable port_functions = {
    .serialWrite = port_write,
    .serialTotalRxWaiting = port_waiting,
    .serialTotalTxFree = port_free,
    .serialRead = port_read,
    .serialSetBaudRate = port_set_rate,
    .isSerialTransmitBufferEmpty = port_is_sent,
    .setMode = port_set_mode,
    .writeBuf = port_write_all,
    .beginWrite = port_begin,
    .endWrite = port_begin,
};
static serialPort_t port = {.vTable = &port_functions, .mode = MODE_RXTX};

/* Have the firmware carry out one line, and send what it prints. `save` ends the process. */
static void carry_out_line(void) {
    uint32_t size;
    receive(&size, sizeof size);
    if (size > LONGEST_LINE) _exit(2);
    receive(line, size);
    line_size = size;
    line_read = 0;
    answer_size = 0;
    if (!cliMode) cliEnter(&port, false);
    cliProcess();
    send_all(&answer_size, sizeof answer_size);
    send_all(answer, answer_size);
}

/* ---- the radio link ---- */

static float channel(const rxRuntimeState_t *state, uint8_t number) {
    (void)state;
    return (float)request.channels[number];
}

static uint8_t frame_status(rxRuntimeState_t *state) {
    if (!frame_waiting) return RX_FRAME_PENDING;
    frame_waiting = false;
    state->lastRcFrameTimeUs = micros();
    return RX_FRAME_COMPLETE;
}

static void connect_link(void) {
    for (int i = 0; i < CHANNELS; i++) request.channels[i] = 1500;
    rxRuntimeState.channelCount = CHANNELS;
    rxRuntimeState.rcReadRawFn = channel;
    rxRuntimeState.rcFrameStatusFn = frame_status;
    rxRuntimeState.rxProvider = RX_PROVIDER_UDP;
}

/* ---- sensors and motors ---- */

static int16_t counts(double value) {
    double rounded = rint(value);
    return (int16_t)(rounded < -32767 ? -32767 : rounded > 32767 ? 32767 : rounded);
}

static void set_sensors(void) {
    const double *w = request.gyro;
    const double *a = request.acceleration;
    const double *q = request.attitude;
    virtualGyroSet(
        virtualGyroDev,
        counts(w[0] * GYRO_SCALE), counts(w[1] * GYRO_SCALE), counts(w[2] * GYRO_SCALE));
    virtualAccSet(
        virtualAccDev,
        counts(a[0] * ACCELEROMETER_SCALE),
        counts(a[1] * ACCELEROMETER_SCALE),
        counts(a[2] * ACCELEROMETER_SCALE));
    imuSetAttitudeQuat(q[0], q[1], q[2], q[3]);
}

/* Note that a period of the request begins, with or without a frame of the link. */
static void begin_period(void) {
    uint64_t every = (uint64_t)request.frame_every;
    if (every && periods_done % every == 0) frame_waiting = true;
    periods_done++;
    periods_left--;
}

/* Send the reply to the last request, wait for the next one, and begin its first period. */
static void exchange(void) {
    if (periods_left) {
        begin_period();
        return;
    }
    for (int axis = 0; axis < 3; axis++) reply.setpoint[axis] = getSetpointRate(axis);
    reply.armed = ARMING_FLAG(ARMED) ? 1 : 0;
    reply.arming_flags = getArmingDisableFlags();
    send_all(&reply, sizeof reply);

    for (;;) {
        uint32_t kind;
        receive(&kind, sizeof kind);
        if (kind == COMMAND_LINE) {
            carry_out_line();
            continue;
        }
        if (kind != STEP) _exit(2);
        receive(&request, sizeof request);
        break;
    }
    periods_left = request.periods > 1 ? (uint64_t)request.periods : 1;
    periods_done = 0;
    set_sensors();
    begin_period();
}

/* ---- what the linker puts in place of the C library's functions ---- */

int __wrap_clock_gettime(clockid_t clock, struct timespec *time) {
    (void)clock;
    time->tv_sec = now_ns / 1000000000;
    time->tv_nsec = now_ns % 1000000000;
    return 0;
}

/* The main loop sleeps 50 us after each pass; other sleeps are those of the start and of resets. */
int __wrap_nanosleep(const struct timespec *asked, struct timespec *left) {
    (void)left;
    now_ns += asked->tv_sec * 1000000000ull + asked->tv_nsec;
    if (asked->tv_sec != 0 || asked->tv_nsec != MAIN_LOOP_NS) return 0;
    if (!running) {
        running = true;
        const char *period = getenv("QUADSIM_PERIOD_US");
        period_ns = 1000ull * (period ? atoi(period) : 1000);
        const char *replies = getenv("QUADSIM_REPLIES");
        replies_fd = replies ? atoi(replies) : 1;
        next_exchange_ns = now_ns;
        connect_link();
    }
    while (now_ns >= next_exchange_ns) {
        exchange();
        next_exchange_ns += period_ns;
    }
    return 0;
}

int __wrap_pthread_create(
    pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument) {
    (void)thread; (void)attributes; (void)function; (void)argument;
    return 0;
}
int __wrap_pthread_join(pthread_t thread, void **result) { (void)thread; (void)result; return 0; }
int __wrap_pthread_mutex_trylock(pthread_mutex_t *mutex) { (void)mutex; return 0; }
int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex) { (void)mutex; return 0; }
int __wrap_pthread_mutex_unlock(pthread_mutex_t *mutex) { (void)mutex; return 0; }

int __wrap_bind(int socket, const struct sockaddr *address, socklen_t size) {
    (void)socket; (void)address; (void)size;
    return 0;
}

/* The firmware sends the four motor commands as floats, in the order of motors 2, 3, 4 and 1. */
ssize_t __wrap_sendto(
    int socket, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t to_size) {
    (void)socket; (void)flags; (void)to; (void)to_size;
    float sent[MOTORS];
    if (size == sizeof sent) {
        memcpy(sent, data, size);
        for (int i = 0; i < MOTORS; i++) reply.motors[(i + 1) % MOTORS] = sent[i];
    }
    return size;
}
