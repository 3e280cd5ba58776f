// Calls that a careful program never makes: each ends in an error that says so, and the library goes on.
// hostile GRAPH: the texture pad. Run by tests/c.rs, and under AddressSanitizer and valgrind by .ci/full.
#include "expect.h"
#include <pthread.h>
#include <stdatomic.h>

static void graphs(void) {
    haptograph_graph graph = {7};
    haptograph_graph_options options = HAPTOGRAPH_GRAPH_OPTIONS;
    EXPECT(haptograph_graph_open(NULL, NULL, &graph), ARGUMENT);
    EXPECT(haptograph_graph_open(path, NULL, NULL), ARGUMENT);
    EXPECT(haptograph_graph_open(path, NULL, (haptograph_graph *)1), ARGUMENT);
    EXPECT(haptograph_graph_open(path, (haptograph_graph_options *)1, &graph), ARGUMENT);
    EXPECT(haptograph_graph_open("nowhere.ron", NULL, &graph), GRAPH);
    HOLDS(strstr(haptograph_last_error_rendered(), "nowhere.ron") != NULL);
    HOLDS(haptograph_last_error_code()[0] == 'E');
    EXPECT(haptograph_graph_open("\xff\xfe", NULL, &graph), GRAPH);
    EXPECT(haptograph_graph_open("/dev/zero", NULL, &graph), GRAPH);
    options.size = 3;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    options.size = sizeof options;
    options.set_count = 2;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    const char *set[] = {"gain=0.5", NULL}, *twice[] = {"gain=1", "gain=0.5"}, *none[] = {"gain"}, *bad[] = {"\xc3="};
    options.set = set;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    options.set = twice;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    options.set_count = SIZE_MAX;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    options.set_count = 1;
    options.set = none;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    options.set = bad;
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    const char *unknown[] = {"gian=1"};
    options.set = unknown;
    EXPECT(haptograph_graph_open(path, &options, &graph), GRAPH);
    HOLDS(strstr(haptograph_last_error_message(), "gian") != NULL);
    options.set_count = 0;
    options.hosted = unknown, options.hosted_count = 1;
    EXPECT(haptograph_graph_open(path, &options, &graph), NAME);
    HOLDS(strstr(haptograph_last_error_message(), "haptuator") != NULL);
    options.hosted = NULL, options.hosted_count = 0;
    options.endpoints = "lvie";
    EXPECT(haptograph_graph_open(path, &options, &graph), GRAPH);
    HOLDS(strcmp(haptograph_last_error_code(), "E0210") == 0);
    HOLDS(strstr(haptograph_last_error_message(), "lvie") != NULL);
    options.endpoints = "\xff";
    EXPECT(haptograph_graph_open(path, &options, &graph), ARGUMENT);
    HOLDS(graph.id == 7);
    options.endpoints = "live";
    EXPECT(haptograph_graph_open(path, &options, &graph), OK);
    EXPECT(haptograph_graph_free(graph), OK);

    const char *text = "Graph(format: 1, about: \"\xff\")";
    EXPECT(haptograph_graph_parse(text, strlen(text), NULL, NULL, &graph), ARGUMENT);
    EXPECT(haptograph_graph_parse(NULL, 3, NULL, NULL, &graph), ARGUMENT);
    EXPECT(haptograph_graph_parse(text, SIZE_MAX, NULL, NULL, &graph), ARGUMENT);
    EXPECT(haptograph_graph_parse("", 0, NULL, NULL, &graph), GRAPH);
    EXPECT(haptograph_graph_parse("Graph(\0)", 8, NULL, NULL, &graph), GRAPH);
    size_t deep = 100000;
    char *brackets = malloc(deep);
    memset(brackets, '(', deep);
    EXPECT(haptograph_graph_parse(brackets, deep, NULL, NULL, &graph), GRAPH);
    free(brackets);
}

static void handles(void) {
    haptograph_graph graph = open_graph(), null = {0}, made_up = {0x7ffdeadbeef8u}, stale = graph;
    haptograph_input input = {0};
    haptograph_output output = {0};
    haptograph_player player = {0};
    haptograph_setting setting = {0};
    double rate;
    EXPECT(haptograph_graph_rate(null, &rate), HANDLE);
    EXPECT(haptograph_graph_rate(made_up, &rate), HANDLE);
    EXPECT(haptograph_graph_rate(graph, NULL), ARGUMENT);
    EXPECT(haptograph_graph_free(null), HANDLE);
    EXPECT(haptograph_graph_free(made_up), HANDLE);
    for (uint64_t id = 0; id < 5000; id++) EXPECT(haptograph_player_process((haptograph_player){id}, 1), HANDLE);
    for (uint64_t id = 1; id < 5000; id++)
        EXPECT(haptograph_player_process((haptograph_player){id * 0x9e3779b97f4a7c15u}, 1), HANDLE);

    EXPECT(haptograph_graph_input(null, "stylus.force", 1, &input), HANDLE);
    EXPECT(haptograph_graph_input(graph, NULL, 1, &input), ARGUMENT);
    EXPECT(haptograph_graph_input(graph, "stylus.forse", 1, &input), NAME);
    HOLDS(strstr(haptograph_last_error_message(), "stylus.force") != NULL);
    EXPECT(haptograph_graph_input(graph, "stylus", 3, &input), NAME);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 3, &input), SHAPE);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 0, &input), SHAPE);
    EXPECT(haptograph_graph_input(graph, "stylus.force", UINT32_MAX, &input), SHAPE);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, NULL), ARGUMENT);
    EXPECT(haptograph_graph_output(graph, "stylus.force", 1, &output), NAME);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, &input), OK);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, &input), TAKEN);
    EXPECT(haptograph_graph_output(graph, "haptuator", 1, &output), OK);
    EXPECT(haptograph_player_open(graph, NULL, &player), OK);
    haptograph_player second = {0};
    EXPECT(haptograph_player_open(graph, NULL, &second), TAKEN);
    EXPECT(haptograph_player_setting(player, "out.gain", &setting), OK);

    // Each in the place of the others.
    double one = 1;
    float narrow = 1;
    EXPECT(haptograph_graph_free((haptograph_graph){input.id}), KIND);
    EXPECT(haptograph_input_free((haptograph_input){graph.id}), KIND);
    EXPECT(haptograph_output_free((haptograph_output){player.id}), KIND);
    EXPECT(haptograph_player_finish((haptograph_player){output.id}, NULL), KIND);
    EXPECT(haptograph_setting_free((haptograph_setting){player.id}), KIND);
    EXPECT(haptograph_player_process((haptograph_player){graph.id}, 1), KIND);
    EXPECT(haptograph_input_set((haptograph_input){output.id}, &one, 1), KIND);
    EXPECT(haptograph_output_read((haptograph_output){input.id}, &one, 1, NULL), KIND);
    EXPECT(haptograph_setting_set((haptograph_setting){input.id}, 1), KIND);
    EXPECT(haptograph_setting_value((haptograph_setting){player.id}, &one), KIND);
    EXPECT(haptograph_input_push_float((haptograph_input){output.id}, &narrow, 1, NULL), KIND);
    EXPECT(haptograph_output_read_float((haptograph_output){input.id}, &narrow, 1, NULL), KIND);
    EXPECT(haptograph_player_settings((haptograph_player){graph.id}, NULL, 0, NULL), KIND);
    EXPECT(haptograph_player_live_inputs((haptograph_player){input.id}, NULL, 0, NULL), KIND);
    EXPECT(haptograph_player_actuators((haptograph_player){output.id}, "stylus", NULL, 0, NULL), KIND);
    EXPECT(haptograph_player_change((haptograph_player){graph.id}, graph, NULL, 0, NULL), KIND);
    EXPECT(haptograph_player_change(player, (haptograph_graph){player.id}, NULL, 0, NULL), KIND);
    EXPECT(haptograph_player_change(player, null, NULL, 0, NULL), HANDLE);
    EXPECT(haptograph_player_change((haptograph_player){0}, graph, NULL, 0, NULL), HANDLE);
    EXPECT(haptograph_player_stop((haptograph_player){setting.id}), KIND);

    // The graph goes first; what came of it stays, and what was freed is known to be.
    EXPECT(haptograph_graph_free(graph), OK);
    EXPECT(haptograph_graph_free(stale), HANDLE);
    EXPECT(haptograph_graph_rate(stale, &rate), HANDLE);
    EXPECT(haptograph_input_set(input, &one, 1), OK);
    EXPECT(haptograph_player_process(player, 480), OK);
    EXPECT(haptograph_player_finish(player, NULL), OK);
    EXPECT(haptograph_player_finish(player, NULL), HANDLE);
    EXPECT(haptograph_player_process(player, 1), HANDLE);
    EXPECT(haptograph_setting_set(setting, 0.5), HANDLE);
    EXPECT(haptograph_setting_value(setting, &rate), HANDLE);
    EXPECT(haptograph_player_settings(player, NULL, 0, NULL), HANDLE);
    EXPECT(haptograph_player_live_inputs(player, NULL, 0, NULL), HANDLE);
    EXPECT(haptograph_setting_free(setting), OK);
    EXPECT(haptograph_input_free(input), OK);
    EXPECT(haptograph_input_set(input, &one, 1), HANDLE);
    EXPECT(haptograph_output_free(output), OK);
    EXPECT(haptograph_output_free(output), HANDLE);
    for (int again = 0; again < 2000; again++) {
        haptograph_graph next;
        const char *small = "Graph(format: 1, clocks: {\"c\": Driver(rate_hz: 1000)}, nodes: {\"a\": Constant(value: 1, clock: \"c\")})";
        EXPECT(haptograph_graph_parse(small, strlen(small), NULL, NULL, &next), OK);
        HOLDS(next.id != stale.id);
        EXPECT(haptograph_graph_free(next), OK);
        EXPECT(haptograph_graph_rate(stale, &rate), HANDLE);
    }
}

static void values(void) {
    haptograph_graph graph = open_graph();
    haptograph_input position, force;
    haptograph_output current;
    haptograph_player player;
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    double buffer[64] = {0}, bad[3] = {0, NAN, 0};
    size_t count = 99;
    EXPECT(haptograph_graph_input(graph, "stylus.position", 3, &position), OK);
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, &force), OK);
    EXPECT(haptograph_graph_output(graph, "haptuator.current", 1, &current), OK);
    options.seconds = NAN;
    EXPECT(haptograph_player_open(graph, &options, &player), ARGUMENT);
    options.seconds = -1;
    EXPECT(haptograph_player_open(graph, &options, &player), ARGUMENT);
    options.seconds = 0;
    options.block = UINT32_MAX;
    EXPECT(haptograph_player_open(graph, &options, &player), ARGUMENT);
    options.block = 0;
    options.folder = "/nowhere/at/all";
    EXPECT(haptograph_player_open(graph, &options, &player), SYSTEM);
    options.folder = NULL;
    const char *probes[] = {"texture.sound"};
    options.probes = probes, options.probe_count = 1;
    EXPECT(haptograph_player_open(graph, &options, &player), NAME);
    options.probes = NULL;
    EXPECT(haptograph_player_open(graph, &options, &player), ARGUMENT);
    options.probe_count = 0;
    EXPECT(haptograph_player_open(graph, &options, &player), OK);

    EXPECT(haptograph_input_set(position, buffer, 1), SHAPE);
    EXPECT(haptograph_input_set(position, buffer, 0), SHAPE);
    EXPECT(haptograph_input_set(position, buffer, 64), SHAPE);
    EXPECT(haptograph_input_set(position, NULL, 3), ARGUMENT);
    EXPECT(haptograph_input_set(position, (double *)((char *)buffer + 1), 3), ARGUMENT);
    EXPECT(haptograph_input_set(position, buffer, SIZE_MAX), ARGUMENT);
    EXPECT(haptograph_input_set(position, buffer, SIZE_MAX / 8), ARGUMENT);
    EXPECT(haptograph_input_set(position, bad, 3), NOT_FINITE);
    bad[1] = -INFINITY;
    EXPECT(haptograph_input_set(position, bad, 3), NOT_FINITE);
    EXPECT(haptograph_input_set_at(position, NAN, buffer, 3), NOT_FINITE);
    EXPECT(haptograph_input_set_at(position, INFINITY, buffer, 3), NOT_FINITE);
    EXPECT(haptograph_input_about(position, NULL, NULL, &count), OK);
    HOLDS(count == 0);
    EXPECT(haptograph_input_set(force, (double[]){1e300}, 1), OK);
    EXPECT(haptograph_player_process(player, SIZE_MAX), ARGUMENT);
    EXPECT(haptograph_player_process(player, 0), OK);
    EXPECT(haptograph_player_process(player, 4800), OK);
    EXPECT(haptograph_output_read(current, NULL, 1, &count), ARGUMENT);
    HOLDS(count == 0);
    EXPECT(haptograph_output_read(current, buffer, SIZE_MAX, NULL), ARGUMENT);
    EXPECT(haptograph_output_read(current, buffer, 0, &count), OK);
    EXPECT(haptograph_output_read(current, buffer, 64, (size_t *)3), ARGUMENT);
    EXPECT(haptograph_output_read(current, buffer, 64, &count), OK);
    HOLDS(count == 64);
    float narrow[64] = {0};
    EXPECT(haptograph_input_push_float(position, NULL, 3, &count), ARGUMENT);
    EXPECT(haptograph_input_push_float(position, (float *)((char *)narrow + 1), 3, NULL), ARGUMENT);
    EXPECT(haptograph_input_push_float(position, narrow, SIZE_MAX / 4, NULL), ARGUMENT);
    EXPECT(haptograph_input_push_float(position, narrow, 3, (size_t *)3), ARGUMENT);
    EXPECT(haptograph_input_push_float(position, narrow, 4, NULL), SHAPE);
    narrow[4] = NAN;
    EXPECT(haptograph_input_push_float(position, narrow, 6, &count), NOT_FINITE);
    HOLDS(count == 1);
    EXPECT(haptograph_output_read_float(current, NULL, 1, &count), ARGUMENT);
    EXPECT(haptograph_output_read_float(current, (float *)((char *)narrow + 2), 1, NULL), ARGUMENT);
    EXPECT(haptograph_output_read_float(current, narrow, SIZE_MAX / 2, NULL), ARGUMENT);
    EXPECT(haptograph_output_read_float(current, narrow, 64, &count), OK);
    HOLDS(count == 64);
    int full = 0;
    for (int push = 0; push < 100000 && !full; push++)
        full = haptograph_input_push(force, buffer, 64, &count) == HAPTOGRAPH_STATUS_FULL;
    HOLDS(full && count < 64);

    haptograph_setting setting;
    EXPECT(haptograph_player_set(player, "out.gian", 1), NAME);
    HOLDS(strstr(haptograph_last_error_message(), "out.gain") != NULL);
    EXPECT(haptograph_player_set(player, "out.gain", NAN), NOT_FINITE);
    EXPECT(haptograph_player_set(player, NULL, 1), ARGUMENT);
    EXPECT(haptograph_player_setting(player, "out.gain", NULL), ARGUMENT);
    EXPECT(haptograph_player_setting(player, "out.gain", &setting), OK);
    EXPECT(haptograph_setting_set(setting, INFINITY), NOT_FINITE);
    EXPECT(haptograph_setting_set(setting, 0.5), OK);
    double value = 0;
    EXPECT(haptograph_setting_value(setting, NULL), ARGUMENT);
    EXPECT(haptograph_setting_value(setting, (double *)3), ARGUMENT);
    EXPECT(haptograph_setting_value(setting, &value), OK);
    HOLDS(value == 0.5);
    haptograph_output probe;
    EXPECT(haptograph_player_probe(player, "texture.output", 1, &probe), NAME);
    int full_commands = 0;
    for (int set = 0; set < 100000 && !full_commands; set++)
        full_commands = haptograph_setting_set(setting, set % 2) == HAPTOGRAPH_STATUS_FULL;
    HOLDS(full_commands);

    haptograph_state state;
    uint64_t frames;
    EXPECT(haptograph_player_state(player, &state, &frames), OK);
    HOLDS(state == HAPTOGRAPH_STATE_RUNNING && frames == 4800);
    EXPECT(haptograph_player_stop(player), OK);
    EXPECT(haptograph_player_process(player, 4800), ENDED);
    EXPECT(haptograph_player_process(player, 4800), ENDED);
    EXPECT(haptograph_player_state(player, &state, NULL), OK);
    HOLDS(state == HAPTOGRAPH_STATE_STOPPED);
    EXPECT(haptograph_player_change(player, graph, NULL, 0, NULL), ENDED);
    EXPECT(haptograph_player_finish(player, (haptograph_outcome *)5), ARGUMENT);
    EXPECT(haptograph_player_finish(player, NULL), OK);
    EXPECT(haptograph_setting_free(setting), OK);
    EXPECT(haptograph_input_free(position), OK);
    EXPECT(haptograph_input_free(force), OK);
    EXPECT(haptograph_output_free(current), OK);
    EXPECT(haptograph_graph_free(graph), OK);
}

static void lists(void) {
    haptograph_graph graph = open_graph();
    haptograph_channel channels[2];
    size_t count = 0, length = 99;
    char text[4] = "abc";
    memset(channels, 0, sizeof channels);
    EXPECT(haptograph_graph_inputs(graph, NULL, 0, &count), OK);
    HOLDS(count == 3);
    EXPECT(haptograph_graph_inputs(graph, NULL, 1, &count), ARGUMENT);
    EXPECT(haptograph_graph_inputs(graph, channels, 1, NULL), OK);
    HOLDS(strcmp(channels[0].name, "stylus.position") == 0 && strcmp(channels[0].unit, "m") == 0);
    HOLDS(channels[0].components == HAPTOGRAPH_VECTOR && channels[1].name[0] == 0);
    EXPECT(haptograph_graph_outputs(graph, channels, SIZE_MAX, &count), OK);
    HOLDS(count == 1 && strcmp(channels[0].unit, "A") == 0);
    EXPECT(haptograph_graph_warnings(graph, text, sizeof text, &length), OK);
    HOLDS(length == strlen(text));
    EXPECT(haptograph_graph_warnings(graph, NULL, 4, &length), ARGUMENT);
    EXPECT(haptograph_graph_free(graph), OK);
    for (int status = -2; status < 20; status++) HOLDS(strlen(haptograph_status_text(status)) > 4);
    HOLDS(haptograph_version() == HAPTOGRAPH_VERSION);
}

// Threads that use, end and look at one player and its handles at the same time.
static haptograph_player raced;
static haptograph_input raced_input;
static haptograph_output raced_output;
static haptograph_setting raced_setting;
static haptograph_graph raced_graphs[2];
static atomic_int processed, refused, wrong, over;

static int allowed(haptograph_status status) {
    switch (status) {
    case HAPTOGRAPH_STATUS_OK: return 1;
    case HAPTOGRAPH_STATUS_BUSY:
    case HAPTOGRAPH_STATUS_HANDLE:
    case HAPTOGRAPH_STATUS_FULL: refused++; return 1;
    default: wrong++; return 0;
    }
}

static void *race(void *number) {
    double values[48] = {0};
    for (int round = 0; !over; round++) {
        haptograph_status status = haptograph_player_process(raced, 48);
        processed += status == HAPTOGRAPH_STATUS_OK;
        allowed(status);
        allowed(haptograph_input_set(raced_input, values, 1));
        allowed(haptograph_output_read(raced_output, values, 48, NULL));
        allowed(haptograph_setting_set(raced_setting, round % 2));
        allowed(haptograph_player_set(raced, "out.gain", 0.5));
        haptograph_state state;
        allowed(haptograph_player_state(raced, &state, NULL));
        haptograph_live_input inputs[1];
        allowed(haptograph_setting_value(raced_setting, values));
        allowed(haptograph_player_live_inputs(raced, inputs, 1, NULL));
        if (round % 20 == 0) allowed(haptograph_player_change(raced, raced_graphs[(round / 20 + (intptr_t)number) % 2], NULL, 0, NULL));
        // All try to end it, some of them while others are inside.
        if (round > 200 && (intptr_t)number == 0) over = haptograph_player_finish(raced, NULL) == HAPTOGRAPH_STATUS_OK;
    }
    return NULL;
}

static void threads(void) {
    haptograph_graph graph = open_graph();
    raced_graphs[0] = graph, raced_graphs[1] = open_graph();
    EXPECT(haptograph_graph_input(graph, "stylus.force", 1, &raced_input), OK);
    EXPECT(haptograph_graph_output(graph, "haptuator.current", 1, &raced_output), OK);
    EXPECT(haptograph_player_open(graph, NULL, &raced), OK);
    EXPECT(haptograph_player_setting(raced, "out.gain", &raced_setting), OK);
    pthread_t all[4];
    for (intptr_t number = 0; number < 4; number++) pthread_create(&all[number], NULL, race, (void *)number);
    for (int number = 0; number < 4; number++) pthread_join(all[number], NULL);
    HOLDS(processed > 0);
    HOLDS(wrong == 0);
    EXPECT(haptograph_player_process(raced, 1), HANDLE);
    EXPECT(haptograph_setting_free(raced_setting), OK);
    EXPECT(haptograph_input_free(raced_input), OK);
    EXPECT(haptograph_output_free(raced_output), OK);
    EXPECT(haptograph_graph_free(raced_graphs[1]), OK);
    EXPECT(haptograph_graph_free(graph), OK);
}

static void *errors_of_a_thread(void *unused) {
    HOLDS(haptograph_last_error_message()[0] == 0);
    EXPECT(haptograph_graph_free((haptograph_graph){0}), HANDLE);
    return unused;
}

int main(int count, char **arguments) {
    path = count > 1 ? arguments[1] : "graphs/texturepad.ron";
    graphs();
    handles();
    values();
    lists();
    threads();
    // The last error is a thread's own.
    haptograph_graph graph;
    EXPECT(haptograph_graph_open("nowhere.ron", NULL, &graph), GRAPH);
    pthread_t other;
    pthread_create(&other, NULL, errors_of_a_thread, NULL);
    pthread_join(other, NULL);
    HOLDS(strstr(haptograph_last_error_message(), "nowhere") != NULL);
    return report();
}
