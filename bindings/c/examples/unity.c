// The native side of an audio filter in the style of Unity's OnAudioFilterRead: it adds the current of graphs/texturepad.ron
// to every channel of the buffers; 1.0 is 1 A. stand-ins/unity.h simulates the game engine, and the pen goes in a circle.
//
//     cc unity.c $(pkg-config --cflags --libs haptograph) -lm -o unity && ./unity graphs/texturepad.ron
#include "stand-ins/unity.h"
#include <haptograph.h>
#include <stdio.h>
#include <stdlib.h>

static haptograph_player player;
static haptograph_input position, force, touching;
static haptograph_output current;
static double angle;

// Update() of the game calls this whenever the pen moved: the handles may be used by another thread.
static void pen_moves(double x_m, double y_m, double force_n) {
    const double position_m[3] = {x_m, y_m, 0}, touches = force_n > 0;
    haptograph_input_set(position, position_m, 3);
    haptograph_input_set(force, &force_n, 1);
    haptograph_input_set(touching, &touches, 1);
}

// OnAudioFilterRead: no allocation, no lock, no system call in here.
static void on_audio_filter_read(float *data, int length, int channels) {
    float mono[256];
    angle += 0.11;
    pen_moves(0.03 * cos(angle), 0.03 * sin(angle), 1.0);
    for (int left = length / channels; left > 0;) {
        int frames = left < 256 ? left : 256;
        haptograph_player_process(player, (size_t)frames);
        haptograph_output_read_float(current, mono, (size_t)frames, NULL);
        for (int sample = 0; sample < frames * channels; sample++) *data++ += mono[sample / channels];
        left -= frames;
    }
}

static void check(haptograph_status status) {
    if (status == HAPTOGRAPH_STATUS_OK) return;
    fprintf(stderr, "%s\n", haptograph_last_error_rendered());
    exit(1);
}

int main(int count, char **arguments) {
    haptograph_graph graph;
    check(haptograph_graph_open(count > 1 ? arguments[1] : "graphs/texturepad.ron", NULL, &graph));
    check(haptograph_graph_input(graph, "stylus.position", HAPTOGRAPH_VECTOR, &position));
    check(haptograph_graph_input(graph, "stylus.force", HAPTOGRAPH_SCALAR, &force));
    check(haptograph_graph_input(graph, "stylus.touching", HAPTOGRAPH_SCALAR, &touching));
    check(haptograph_graph_output(graph, "haptuator.current", HAPTOGRAPH_SCALAR, &current));
    check(haptograph_player_open(graph, NULL, &player));
    float most_a = unity_plays(on_audio_filter_read);
    check(haptograph_player_finish(player, NULL));
    check(haptograph_graph_free(graph));
    printf("at most %.3f A\n", most_a);
    return most_a > 0.01f && most_a <= 0.5f ? 0 : 1; // the graph's limit is 0.5 A
}
