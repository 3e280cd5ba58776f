// A run that is looked at and changed: its settings, its silent inputs, and other graphs in its place.
// live GRAPH: the texture pad. Run by tests/c.rs, and under AddressSanitizer and valgrind by .ci/full.
#include "expect.h"

static void settings_and_inputs(void) {
    haptograph_graph graph = open_graph();
    haptograph_player player;
    haptograph_live_setting settings[64];
    haptograph_live_input inputs[2];
    haptograph_actuator actuators[2];
    size_t count = 0, again = 0;
    EXPECT(haptograph_player_open(graph, NULL, &player), OK);
    EXPECT(haptograph_player_settings(player, NULL, 0, &count), OK);
    EXPECT(haptograph_player_settings(player, NULL, 1, &again), ARGUMENT);
    EXPECT(haptograph_player_settings(player, (haptograph_live_setting *)1, 1, NULL), ARGUMENT);
    EXPECT(haptograph_player_settings(player, settings, 1, (size_t *)1), ARGUMENT);
    EXPECT(haptograph_player_settings(player, settings, 64, &again), OK);
    HOLDS(count == again && count > 1 && count <= 64);
    EXPECT(haptograph_player_set(player, "out.gain", 0.5), OK);
    EXPECT(haptograph_player_settings(player, settings, 64, NULL), OK);
    int gains = 0, cutoffs = 0;
    for (size_t place = 0; place < count; place++) {
        const haptograph_live_setting *live = &settings[place];
        gains += strcmp(live->name, "out.gain") == 0 && live->value == 0.5 && live->unit[0] == 0 && !live->whole;
        cutoffs += strcmp(live->name, "speed.cutoff_hz") == 0 && live->value == 20 && strcmp(live->unit, "Hz") == 0 &&
                   live->min > 0 && live->max > 20 && live->max < 125;
        HOLDS(live->min <= live->value && live->value <= live->max);
    }
    HOLDS(gains == 1 && cutoffs == 1);

    EXPECT(haptograph_player_live_inputs(player, inputs, 2, (size_t *)1), ARGUMENT);
    EXPECT(haptograph_player_live_inputs(player, (haptograph_live_input *)1, 2, NULL), ARGUMENT);
    EXPECT(haptograph_player_actuators(player, NULL, actuators, 2, &count), ARGUMENT);
    EXPECT(haptograph_player_actuators(player, "styles", actuators, 2, &count), NAME);
    HOLDS(strstr(haptograph_last_error_message(), "stylus") != NULL);
    EXPECT(haptograph_player_finish(player, NULL), OK);
    EXPECT(haptograph_graph_free(graph), OK);
}

// The pen's inputs and the current of a player, and a hand that strokes.
typedef struct {
    haptograph_player player;
    haptograph_input position, force, touching;
    haptograph_output current;
    double angle, most_a, last_a, step_a;
} pen;

static void stroke(pen *pen, int calls, int feeds) {
    double current_a[480];
    for (int call = 0; call < calls; call++, pen->angle += 0.05) {
        double position_m[3] = {0.03 * cos(pen->angle), 0.03 * sin(pen->angle), 0}, one = 1;
        if (feeds) EXPECT(haptograph_input_set(pen->position, position_m, 3), OK);
        if (feeds) EXPECT(haptograph_input_set(pen->force, &one, 1), OK);
        if (feeds) EXPECT(haptograph_input_set(pen->touching, &one, 1), OK);
        EXPECT(haptograph_player_process(pen->player, 480), OK);
        EXPECT(haptograph_output_read(pen->current, current_a, 480, NULL), OK);
        for (int frame = 0; frame < 480; frame++) {
            pen->most_a = fmax(pen->most_a, fabs(current_a[frame]));
            pen->step_a = fmax(pen->step_a, fabs(current_a[frame] - pen->last_a));
            pen->last_a = current_a[frame];
        }
    }
}

static pen open_pen(haptograph_graph graph) {
    pen made = {{0}, {0}, {0}, {0}, {0}, 0, 0, 0, 0};
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    options.rested = 1;
    EXPECT(haptograph_graph_input(graph, "stylus.position", 3, &made.position), OK);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, &made.force), OK);
    EXPECT(haptograph_graph_input(graph, "stylus.touching", 1, &made.touching), OK);
    EXPECT(haptograph_graph_output(graph, "haptuator.current", 1, &made.current), OK);
    EXPECT(haptograph_player_open(graph, &options, &made.player), OK);
    stroke(&made, 40, 1);
    return made;
}

static void close_pen(pen *pen) {
    EXPECT(haptograph_player_finish(pen->player, NULL), OK);
    EXPECT(haptograph_input_free(pen->position), OK);
    EXPECT(haptograph_input_free(pen->force), OK);
    EXPECT(haptograph_input_free(pen->touching), OK);
    EXPECT(haptograph_output_free(pen->current), OK);
}

static void silence(void) {
    haptograph_graph graph = open_graph();
    pen pen = open_pen(graph);
    haptograph_live_input inputs[2];
    haptograph_actuator actuators[2];
    size_t count = 0;
    HOLDS(pen.most_a > 0.01);
    EXPECT(haptograph_player_live_inputs(pen.player, inputs, 2, &count), OK);
    HOLDS(count == 1 && strcmp(inputs[0].endpoint, "stylus") == 0 && inputs[0].state == HAPTOGRAPH_INPUT_STATE_HEARD);
    HOLDS(inputs[0].timeout_s == 0.1 && !inputs[0].holds && inputs[0].actuators == 1 && inputs[0].closed == 0);
    stroke(&pen, 40, 0);
    EXPECT(haptograph_player_live_inputs(pen.player, inputs, 2, &count), OK);
    HOLDS(inputs[0].state == HAPTOGRAPH_INPUT_STATE_SILENT && inputs[0].closed == 1);
    EXPECT(haptograph_player_actuators(pen.player, "stylus", actuators, 2, &count), OK);
    HOLDS(count == 1 && strcmp(actuators[0].name, "out") == 0 && strcmp(actuators[0].unit, "A") == 0);
    HOLDS(actuators[0].closed && actuators[0].at_zero && actuators[0].delivered == 0);
    HOLDS(actuators[0].peak == 0.5 && actuators[0].continuous == 0.25);
    stroke(&pen, 10, 1);
    EXPECT(haptograph_player_actuators(pen.player, "stylus", actuators, 2, &count), OK);
    HOLDS(!actuators[0].closed && !actuators[0].at_zero);
    close_pen(&pen);
    EXPECT(haptograph_graph_free(graph), OK);
}

// The same graph with a rougher surface, which lies beside it.
static haptograph_graph open_rough(void) {
    haptograph_graph graph = {0};
    haptograph_graph_options options = HAPTOGRAPH_GRAPH_OPTIONS;
    const char *end = strrchr(path, '/');
    char text[4096];
    const char *set = text;
    snprintf(text, sizeof text, "surface=%.*ssurfaces/t6-coarse.ron", end ? (int)(end + 1 - path) : 0, path);
    options.set = &set, options.set_count = 1;
    EXPECT(haptograph_graph_open(path, &options, &graph), OK);
    return graph;
}

static haptograph_graph parse(const char *text) {
    haptograph_graph graph = {0};
    EXPECT(haptograph_graph_parse(text, strlen(text), path, NULL, &graph), OK);
    return graph;
}

static void changes(void) {
    haptograph_graph first = open_graph(), second = open_rough(), third = open_graph();
    const char *slower = "Graph(format: 1, clocks: {\"c\": Driver(rate_hz: 1000)}, nodes: {\"a\": Constant(value: 1, clock: \"c\")})";
    const char *other = "Graph(format: 1, clocks: {\"audio\": Driver(rate_hz: 48000)}, nodes: {\"a\": Constant(value: 1, clock: \"audio\")})";
    const char *probes[] = {"texture/filter.acceleration", NULL}, *unknown[] = {"texture.sound"};
    pen pen = open_pen(first);
    haptograph_change change = 99;
    haptograph_setting gain;
    haptograph_input early, late;
    haptograph_output vibration;
    double value = 0, step_a, fade_a, frames[480];
    size_t count = 0;
    EXPECT(haptograph_player_setting(pen.player, "out.gain", &gain), OK);
    EXPECT(haptograph_player_change(pen.player, second, NULL, 1, &change), ARGUMENT);
    EXPECT(haptograph_player_change(pen.player, second, probes, 2, &change), ARGUMENT);
    EXPECT(haptograph_player_change(pen.player, second, probes, SIZE_MAX, &change), ARGUMENT);
    EXPECT(haptograph_player_change(pen.player, second, unknown, 1, &change), NAME);
    EXPECT(haptograph_player_change(pen.player, second, NULL, 0, (haptograph_change *)1), ARGUMENT);
    // What cannot replace the graph is refused, and the run goes on.
    haptograph_graph slow = parse(slower), bare = parse(other);
    EXPECT(haptograph_player_change(pen.player, slow, NULL, 0, &change), GRAPH);
    EXPECT(haptograph_graph_input(second, "stylus.force", 1, &early), OK);
    EXPECT(haptograph_player_change(pen.player, second, NULL, 0, &change), TAKEN);
    HOLDS(strstr(haptograph_last_error_message(), "stylus.force") != NULL && change == (haptograph_change)99);
    EXPECT(haptograph_input_free(early), OK);
    haptograph_player elsewhere;
    EXPECT(haptograph_player_open(third, NULL, &elsewhere), OK);
    EXPECT(haptograph_player_change(pen.player, third, NULL, 0, &change), TAKEN);
    EXPECT(haptograph_player_finish(elsewhere, NULL), OK);
    stroke(&pen, 20, 1);

    // Another surface: no step is larger than those of the textures; inputs and outputs stay, and so do settings.
    EXPECT(haptograph_setting_set(gain, 0.5), OK);
    EXPECT(haptograph_player_change(pen.player, second, probes, 1, &change), OK);
    HOLDS(change == HAPTOGRAPH_CHANGE_CROSS_FADE);
    EXPECT(haptograph_player_probe(pen.player, probes[0], 1, &vibration), OK);
    EXPECT(haptograph_graph_free(first), OK);
    EXPECT(haptograph_graph_input(second, "stylus.force", 1, &late), TAKEN);
    EXPECT(haptograph_player_open(second, NULL, &elsewhere), TAKEN);
    step_a = pen.step_a, pen.step_a = 0;
    stroke(&pen, 2, 1);
    fade_a = pen.step_a, pen.step_a = pen.most_a = 0;
    stroke(&pen, 40, 1);
    HOLDS(pen.most_a > 0.005 && fade_a < 1.5 * fmax(step_a, pen.step_a));
    EXPECT(haptograph_output_read(vibration, frames, 480, &count), OK);
    HOLDS(count == 480);
    EXPECT(haptograph_setting_value(gain, &value), OK);
    HOLDS(value == 0.5);
    // An input that was freed is opened again from the new graph, and drives it.
    EXPECT(haptograph_input_free(pen.force), OK);
    EXPECT(haptograph_graph_input(second, "stylus.force", 1, &pen.force), OK);
    pen.most_a = 0;
    stroke(&pen, 20, 1);
    HOLDS(pen.most_a > 0.005);

    // A graph without the pen: its inputs are valid, but nothing reads them, and the setting is gone.
    EXPECT(haptograph_player_change(pen.player, bare, NULL, 0, &change), OK);
    HOLDS(change == HAPTOGRAPH_CHANGE_THROUGH_ZERO);
    for (int call = 0; call < 10; call++) EXPECT(haptograph_player_process(pen.player, 480), OK);
    EXPECT(haptograph_setting_value(gain, &value), NAME);
    EXPECT(haptograph_setting_set(gain, 1), NAME);
    EXPECT(haptograph_input_set(pen.force, &value, 1), OK);
    for (int call = 0; call < 10; call++) EXPECT(haptograph_output_read(pen.current, frames, 480, &count), OK);
    HOLDS(count == 0);
    // And back to one that has it: its own inputs and outputs serve it.
    EXPECT(haptograph_player_change(pen.player, second, NULL, 0, NULL), OK);
    pen.most_a = 0;
    stroke(&pen, 60, 1);
    EXPECT(haptograph_setting_value(gain, &value), OK);
    HOLDS(pen.most_a > 0.005 && value == 1);
    EXPECT(haptograph_output_free(vibration), OK);
    EXPECT(haptograph_setting_free(gain), OK);
    close_pen(&pen);
    EXPECT(haptograph_player_open(second, NULL, &elsewhere), OK);
    EXPECT(haptograph_player_finish(elsewhere, NULL), OK);
    haptograph_graph rest[] = {second, third, slow, bare};
    for (int place = 0; place < 4; place++) EXPECT(haptograph_graph_free(rest[place]), OK);
}

// Noise through a filter that this program gives.
static void a_model_steers(void) {
    const char *text = "Graph(format: 1, clocks: { \"synth\": Driver(rate_hz: 1000) }, nodes: {"
                       "\"network\": LiveModel(clock: \"synth\", endpoint: \"network\"),"
                       "\"steer\": SteeredModel(model: \"network\", form: Ar, warping: 0),"
                       "\"noise\": Excitation(coefficients: \"steer.coefficients\"),"
                       "\"felt\": ArmaFilter(coefficients: \"steer.coefficients\", excitation: \"noise\") })";
    const char *probe = "felt.acceleration";
    double model[HAPTOGRAPH_MODEL] = {0.75, -0.5}, felt[1000], power = 0;
    haptograph_graph graph;
    haptograph_input input;
    haptograph_output output;
    haptograph_player player;
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    options.probes = &probe;
    options.probe_count = 1;
    EXPECT(haptograph_graph_parse(text, strlen(text), NULL, NULL, &graph), OK);
    EXPECT(haptograph_graph_input(graph, "network", HAPTOGRAPH_MODEL, &input), OK);
    EXPECT(haptograph_player_open(graph, &options, &player), OK);
    EXPECT(haptograph_player_probe(player, probe, HAPTOGRAPH_SCALAR, &output), OK);
    EXPECT(haptograph_input_set(input, model, 2), SHAPE);
    EXPECT(haptograph_input_set(input, model, HAPTOGRAPH_MODEL), OK);
    EXPECT(haptograph_player_process(player, 1000), OK);
    EXPECT(haptograph_output_read(output, felt, 1000, NULL), OK);
    for (int frame = 0; frame < 1000; frame++) power += felt[frame] * felt[frame] / 1000;
    HOLDS(power > 0.7 && power < 1.3);
    EXPECT(haptograph_output_free(output), OK);
    EXPECT(haptograph_input_free(input), OK);
    EXPECT(haptograph_player_finish(player, NULL), OK);
    EXPECT(haptograph_graph_free(graph), OK);
}

int main(int count, char **arguments) {
    path = count > 1 ? arguments[1] : "graphs/texturepad.ron";
    settings_and_inputs();
    silence();
    changes();
    a_model_steers();
    return report();
}
