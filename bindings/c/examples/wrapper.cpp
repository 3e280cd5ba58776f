// A graph in C++: handles free themselves, failures are exceptions.
//
//     c++ -std=c++17 wrapper.cpp $(pkg-config --cflags --libs haptograph) -o wrapper && ./wrapper graphs/texturepad.ron
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <haptograph.hpp>
#include <vector>

namespace hg = haptograph;

static double loudest_a(const std::string &path) {
    auto graph = hg::Graph::open(path, {"gain=0.5"});
    auto position = graph.input<hg::Vector>("stylus.position");
    auto force = graph.input<hg::Scalar>("stylus.force");
    auto touching = graph.input<hg::Scalar>("stylus.touching");
    auto current = graph.output<hg::Scalar>("haptuator.current");
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    const char *probe = "texture/filter.acceleration";
    options.rested = 1;
    options.probes = &probe;
    options.probe_count = 1;
    auto player = hg::Player::open(graph, options);
    auto vibration = player.probe<hg::Scalar>(probe);
    auto gain = player.setting("out.gain");

    double most = 0;
    std::vector<hg::Scalar> frames(480);
    for (int call = 0; call < 100; call++) {
        const double angle = 0.05 * call;
        // In a callback a status is looked at, or counted; nothing there throws.
        position.set({0.03 * std::cos(angle), 0.03 * std::sin(angle), 0});
        force.set({1.0}), touching.set({1.0});
        if (call == 50) gain.set(0.25);
        if (call == 75) player.change(hg::Graph::open(path, {"gain=0.1"}), {probe}); // on another thread, where time counts
        if (player.process(frames.size()) != HAPTOGRAPH_STATUS_OK) break;
        current.read(frames.data(), frames.size());
        for (const auto &ampere : frames) most = std::max(most, std::fabs(ampere[0]));
    }
    std::size_t count = 0;
    vibration.read(frames.data(), frames.size(), &count);
    std::printf("%zu frames of %s begin with %g m/s2\n", count, probe, frames[0][0]);
    for (const auto &live : player.settings()) std::printf("%s %g %s\n", live.name, live.value, live.unit);
    for (const auto &input : player.live_inputs()) std::printf("%s acts on %u\n", input.endpoint, input.actuators);
    std::printf("%.1f s played\n", player.finish().seconds);
    return most;
}

int main(int count, char **arguments) {
    try {
        const double most = loudest_a(count > 1 ? arguments[1] : "graphs/texturepad.ron");
        std::printf("at most %.3f A\n", most);
        return most > 0.01 && most <= 0.5 ? 0 : 1;
    } catch (const hg::Error &error) {
        std::fprintf(stderr, "%s\n", error.rendered().c_str());
        return 1;
    }
}
