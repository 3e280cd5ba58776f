// A stand-in for the few classes in the style of CHAI3D that chai3d.cpp uses. It is not CHAI3D's header: written here,
// simulated, without a device. A program for a device includes "chai3d.h" of CHAI3D in its place.
//
// Simulated: a hand of 50 g on a spring that strokes across the top of a ball of 100 mm, 1 ms further at each getPosition(),
// and gone after 2 s, when that returns false. cThread::start() runs the function and returns; CHAI3D's runs it in a thread.
#ifndef HAPTOGRAPH_STAND_IN_CHAI3D_H
#define HAPTOGRAPH_STAND_IN_CHAI3D_H

#include <cmath>
#include <memory>

namespace chai3d {

struct cVector3d {
    double values[3] = {0, 0, 0};
    double operator()(unsigned axis) const { return values[axis]; }
    void set(double x, double y, double z) { values[0] = x, values[1] = y, values[2] = z; }
    double length() const { return std::sqrt(values[0] * values[0] + values[1] * values[1] + values[2] * values[2]); }
};

class cGenericHapticDevice {
public:
    bool open() { return true; }
    bool close() { return true; }
    // Metres.
    bool getPosition(cVector3d &position) {
        const double hand_m[3] = {0.012 * std::sin(9.4 * time_s), 0, 0.046};
        for (int axis = 0; axis < 3; axis++) {
            const double hand_n = 300 * (hand_m[axis] - position_m[axis]) - 4 * velocity_m_s[axis];
            velocity_m_s[axis] += (hand_n + force_n(axis)) / 0.05 * 1e-3;
            position_m[axis] += velocity_m_s[axis] * 1e-3;
        }
        position.set(position_m[0], position_m[1], position_m[2]);
        return (time_s += 1e-3) < 2;
    }
    // Newtons.
    bool setForce(const cVector3d &force) { return force_n = force, true; }

private:
    double position_m[3] = {0, 0, 0.055}, velocity_m_s[3] = {0, 0, 0}, time_s = 0;
    cVector3d force_n;
};
using cGenericHapticDevicePtr = std::shared_ptr<cGenericHapticDevice>;

class cHapticDeviceHandler {
public:
    bool getDevice(cGenericHapticDevicePtr &device, unsigned) {
        device = std::make_shared<cGenericHapticDevice>();
        return true;
    }
};

enum CThreadPriority { CTHREAD_PRIORITY_GRAPHICS, CTHREAD_PRIORITY_HAPTICS };

class cThread {
public:
    void start(void (*function)(), CThreadPriority) { function(); }
};

} // namespace chai3d

#endif
