// haptograph for C++17: handles that free themselves, failures as exceptions. A thin coat over haptograph.h, which tells
// of threads, units and what is real-time; calls that are so throw nothing but return their status.
#ifndef HAPTOGRAPH_HPP
#define HAPTOGRAPH_HPP

#include "haptograph.h"

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

namespace haptograph {

// A call failed: what() is one line, rendered() what a terminal would show.
class Error : public std::runtime_error {
public:
    explicit Error(haptograph_status status)
        : std::runtime_error(haptograph_last_error_message()), status_(status), code_(haptograph_last_error_code()),
          rendered_(haptograph_last_error_rendered()) {}

    haptograph_status status() const noexcept { return status_; }
    // Of a graph's first error, "E0204".
    const std::string &code() const noexcept { return code_; }
    const std::string &rendered() const noexcept { return rendered_; }

private:
    haptograph_status status_;
    std::string code_, rendered_;
};

inline void check(haptograph_status status) {
    if (status != HAPTOGRAPH_STATUS_OK) throw Error(status);
}

// A handle and who frees it; moved, never copied. One that was moved from is null.
template <typename Raw, haptograph_status (*free)(Raw)> class Handle {
public:
    Handle() noexcept = default;
    explicit Handle(Raw raw) noexcept : raw_(raw) {}
    Handle(Handle &&other) noexcept : raw_(std::exchange(other.raw_, Raw{})) {}
    Handle &operator=(Handle &&other) noexcept {
        std::swap(raw_, other.raw_);
        return *this;
    }
    Handle(const Handle &) = delete;
    Handle &operator=(const Handle &) = delete;
    ~Handle() {
        if (raw_.id != 0) free(raw_);
    }

    Raw raw() const noexcept { return raw_; }

protected:
    Raw raw_{};
};

// What C calls a shape: the numbers of a frame.
using Scalar = std::array<double, 1>;
using Vector = std::array<double, 3>;
using Wrench = std::array<double, 6>;

template <typename Frame> class Input : public Handle<haptograph_input, haptograph_input_free> {
public:
    using Handle::Handle;
    // Real-time, all of them.
    haptograph_status set(const Frame &frame) noexcept { return haptograph_input_set(raw_, frame.data(), frame.size()); }
    haptograph_status set_at(double seconds, const Frame &frame) noexcept {
        return haptograph_input_set_at(raw_, seconds, frame.data(), frame.size());
    }
    haptograph_status push(const Frame &frame) noexcept {
        return haptograph_input_push(raw_, frame.data(), frame.size(), nullptr);
    }
    // `length` counts numbers, whole frames.
    haptograph_status push(const float *values, std::size_t length, std::size_t *pushed = nullptr) noexcept {
        return haptograph_input_push_float(raw_, values, length, pushed);
    }
};

template <typename Frame> class Output : public Handle<haptograph_output, haptograph_output_free> {
public:
    using Handle::Handle;
    // Fills all of `frames`, with zeros where there are no more; how many there were goes to `count`. Real-time.
    haptograph_status read(Frame *frames, std::size_t length, std::size_t *count = nullptr) noexcept {
        static_assert(sizeof(Frame) == sizeof(double) * std::tuple_size<Frame>::value, "frames lie side by side");
        return haptograph_output_read(raw_, frames ? frames->data() : nullptr, length * std::tuple_size<Frame>::value,
                                      count);
    }
    haptograph_status read(Frame &frame) noexcept { return read(&frame, 1); }
    // `length` counts numbers, whole frames.
    haptograph_status read(float *values, std::size_t length, std::size_t *count = nullptr) noexcept {
        return haptograph_output_read_float(raw_, values, length, count);
    }
};

class Setting : public Handle<haptograph_setting, haptograph_setting_free> {
public:
    using Handle::Handle;
    // Real-time, both.
    haptograph_status set(double value) noexcept { return haptograph_setting_set(raw_, value); }
    haptograph_status value(double &value) const noexcept { return haptograph_setting_value(raw_, &value); }
};

class Graph : public Handle<haptograph_graph, haptograph_graph_free> {
public:
    using Handle::Handle;

    static Graph open(const std::string &path, const std::vector<std::string> &set = {}) {
        const Options options(set);
        haptograph_graph graph;
        check(haptograph_graph_open(path.c_str(), &options.raw, &graph));
        return Graph(graph);
    }
    // From a text; `name` is of the file that it stands for.
    static Graph parse(std::string_view text, const std::string &name = "graph.ron",
                       const std::vector<std::string> &set = {}) {
        const Options options(set);
        haptograph_graph graph;
        check(haptograph_graph_parse(text.data(), text.size(), name.c_str(), &options.raw, &graph));
        return Graph(graph);
    }

    template <typename Frame> Input<Frame> input(const std::string &name) const {
        haptograph_input input;
        check(haptograph_graph_input(raw_, name.c_str(), std::tuple_size<Frame>::value, &input));
        return Input<Frame>(input);
    }
    template <typename Frame> Output<Frame> output(const std::string &name) const {
        haptograph_output output;
        check(haptograph_graph_output(raw_, name.c_str(), std::tuple_size<Frame>::value, &output));
        return Output<Frame>(output);
    }
    // Frames a second of Player::process.
    double rate_hz() const {
        double rate = 0;
        check(haptograph_graph_rate(raw_, &rate));
        return rate;
    }

private:
    struct Options {
        explicit Options(const std::vector<std::string> &set) {
            for (const auto &assignment : set) texts.push_back(assignment.c_str());
            raw.set = texts.data();
            raw.set_count = texts.size();
        }
        std::vector<const char *> texts;
        haptograph_graph_options raw = HAPTOGRAPH_GRAPH_OPTIONS;
    };
};

namespace detail {
inline haptograph_status finish(haptograph_player player) { return haptograph_player_finish(player, nullptr); }

// All items of a list, of which `copy` takes a buffer, its capacity and where the full number goes.
template <typename Item, typename Copy> std::vector<Item> all(Copy copy) {
    std::vector<Item> items;
    std::size_t count = 0;
    check(copy(nullptr, 0, &count));
    items.resize(count);
    check(copy(items.data(), items.size(), &count));
    if (count < items.size()) items.resize(count);
    return items;
}
} // namespace detail

// Ends its run when it goes, unless finish() was called, which says how it went.
class Player : public Handle<haptograph_player, detail::finish> {
public:
    using Handle::Handle;
    static Player open(const Graph &graph, haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS) {
        haptograph_player player;
        check(haptograph_player_open(graph.raw(), &options, &player));
        return Player(player);
    }

    // Real-time.
    haptograph_status process(std::size_t frames) noexcept { return haptograph_player_process(raw_, frames); }
    haptograph_status stop() noexcept { return haptograph_player_stop(raw_); }

    void set(const std::string &name, double value) { check(haptograph_player_set(raw_, name.c_str(), value)); }
    Setting setting(const std::string &name) const {
        haptograph_setting setting;
        check(haptograph_player_setting(raw_, name.c_str(), &setting));
        return Setting(setting);
    }
    std::vector<haptograph_live_setting> settings() const {
        return detail::all<haptograph_live_setting>(
            [this](auto... to) { return haptograph_player_settings(raw_, to...); });
    }
    std::vector<haptograph_live_input> live_inputs() const {
        return detail::all<haptograph_live_input>(
            [this](auto... to) { return haptograph_player_live_inputs(raw_, to...); });
    }
    std::vector<haptograph_actuator> actuators(const std::string &endpoint) const {
        return detail::all<haptograph_actuator>(
            [&](auto... to) { return haptograph_player_actuators(raw_, endpoint.c_str(), to...); });
    }
    // Replaces the graph without a click; see haptograph_player_change() for what becomes of inputs, outputs and probes.
    haptograph_change change(const Graph &graph, const std::vector<const char *> &probes = {}) {
        haptograph_change change;
        check(haptograph_player_change(raw_, graph.raw(), probes.data(), probes.size(), &change));
        return change;
    }
    template <typename Frame> Output<Frame> probe(const std::string &name) const {
        haptograph_output output;
        check(haptograph_player_probe(raw_, name.c_str(), std::tuple_size<Frame>::value, &output));
        return Output<Frame>(output);
    }
    haptograph_outcome finish() {
        haptograph_outcome outcome{};
        check(haptograph_player_finish(std::exchange(raw_, haptograph_player{}), &outcome));
        return outcome;
    }
};

} // namespace haptograph

#endif // HAPTOGRAPH_HPP
