// The haptic loop of a program in the style of CHAI3D, at 1 kHz: it renders graphs/omni.ron on the device.
// stand-ins/chai3d.h simulates the device; with CHAI3D include its "chai3d.h" in its place and link it.
//
//     c++ -std=c++17 chai3d.cpp $(pkg-config --cflags --libs haptograph) -o chai3d && ./chai3d graphs/omni.ron
#include "stand-ins/chai3d.h"
#include <algorithm>
#include <cstdio>
#include <haptograph.hpp>

using namespace chai3d;
namespace hg = haptograph;

static cGenericHapticDevicePtr hapticDevice;
static hg::Player player;
static hg::Input<hg::Vector> position_in;
static hg::Output<hg::Vector> force_out;
static double most_n = 0;

static void updateHaptics() {
    cVector3d position, force;
    while (hapticDevice->getPosition(position)) {
        hg::Vector force_n{};
        position_in.set({position(0), position(1), position(2)});
        // 10 frames of the graph's driver, which runs at 10 kHz.
        if (player.process(10) != HAPTOGRAPH_STATUS_OK) break;
        force_out.read(force_n);
        force.set(force_n[0], force_n[1], force_n[2]);
        hapticDevice->setForce(force);
        most_n = std::max(most_n, force.length());
    }
    force.set(0, 0, 0);
    hapticDevice->setForce(force);
}

int main(int count, char **arguments) {
    try {
        auto graph = hg::Graph::open(count > 1 ? arguments[1] : "graphs/omni.ron");
        position_in = graph.input<hg::Vector>("arm.position");
        force_out = graph.output<hg::Vector>("arm.force");
        player = hg::Player::open(graph);

        cHapticDeviceHandler handler;
        if (!handler.getDevice(hapticDevice, 0) || !hapticDevice->open()) return 1;
        cThread hapticsThread;
        hapticsThread.start(updateHaptics, CTHREAD_PRIORITY_HAPTICS);
        hapticDevice->close();

        std::printf("%.1f s: at most %.2f N at the device\n", player.finish().seconds, most_n);
        return most_n > 0.1 && most_n < 3.31 ? 0 : 1; // the graph's limit is 3.3 N
    } catch (const hg::Error &error) {
        std::fprintf(stderr, "%s\n", error.rendered().c_str());
        return 1;
    }
}
