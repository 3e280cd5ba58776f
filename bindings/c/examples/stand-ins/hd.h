// A stand-in for the few functions of a device API in the style of OpenHaptics' HD that hd.c calls. It is not the vendor's
// header: written here, simulated, without a device. A program for an arm includes <HD/hd.h> in its place.
//
// Simulated: a hand of 50 g on a spring that strokes across the top of a ball of 100 mm. hdStartScheduler() calls what was
// scheduled 2000 times, 1 ms of the arm's time apart, and returns; a vendor's scheduler does so in a thread of its own.
#ifndef HAPTOGRAPH_STAND_IN_HD_H
#define HAPTOGRAPH_STAND_IN_HD_H

#include <math.h>

typedef unsigned int HHD;
typedef unsigned int HDenum;
typedef unsigned int HDCallbackCode;
typedef double HDdouble;
typedef HDCallbackCode (*HDSchedulerCallback)(void *);

#define HD_DEFAULT_DEVICE 0
enum { HD_CALLBACK_DONE = 0, HD_CALLBACK_CONTINUE = 1, HD_DEFAULT_SCHEDULER_PRIORITY = 100 };
enum { HD_FORCE_OUTPUT = 1, HD_CURRENT_POSITION = 2, HD_CURRENT_FORCE = 3 };

static struct {
    HDSchedulerCallback callback;
    void *user;
    double position_m[3], velocity_m_s[3], force_n[3], time_s;
} hd = {0, 0, {0, 0, 0.055}, {0}, {0}, 0};

static HHD hdInitDevice(const char *name) { return (void)name, 1; }
static void hdDisableDevice(HHD device) { (void)device; }
static void hdEnable(HDenum what) { (void)what; }
static void hdBeginFrame(HHD device) { (void)device; }
static void hdEndFrame(HHD device) { (void)device; }

// Millimetres.
static void hdGetDoublev(HDenum what, HDdouble *values) {
    for (int axis = 0; what == HD_CURRENT_POSITION && axis < 3; axis++) values[axis] = 1000 * hd.position_m[axis];
}

// Newtons.
static void hdSetDoublev(HDenum what, const HDdouble *values) {
    for (int axis = 0; what == HD_CURRENT_FORCE && axis < 3; axis++) hd.force_n[axis] = values[axis];
}

static void hdScheduleAsynchronous(HDSchedulerCallback callback, void *user, unsigned priority) {
    (void)priority, hd.callback = callback, hd.user = user;
}

static void hdStartScheduler(void) {
    for (int tick = 0; tick < 2000; tick++, hd.time_s += 1e-3) {
        const double hand_m[3] = {0.012 * sin(9.4 * hd.time_s), 0, 0.046};
        for (int axis = 0; axis < 3; axis++) {
            double hand_n = 300 * (hand_m[axis] - hd.position_m[axis]) - 4 * hd.velocity_m_s[axis];
            hd.velocity_m_s[axis] += (hand_n + hd.force_n[axis]) / 0.05 * 1e-3;
            hd.position_m[axis] += hd.velocity_m_s[axis] * 1e-3;
        }
        if (hd.callback(hd.user) == HD_CALLBACK_DONE) return;
    }
}

static void hdStopScheduler(void) {}

#endif
