// A texture in an audio program: a callback as of PortAudio, JACK or SDL fills a buffer with the current of a voice coil
// while the pen's position comes from elsewhere, here from a circle. The "soundcard" is a WAV file of 32-bit floats, in
// which 1.0 is 1 A.
//
//     cc audio.c $(pkg-config --cflags --libs haptograph) -lm -o audio && ./audio graphs/texturepad.ron texture.wav
#include <haptograph.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RATE_HZ = 48000, BUFFER = 256, BUFFERS = 375 };

typedef struct {
    haptograph_player player;
    haptograph_input position, force, touching;
    haptograph_output current;
    uint64_t frame;
} pen;

// What an audio library calls: no allocation, no lock, no system call in here.
static int audio_callback(float *buffer, size_t frames, void *user) {
    pen *stylus = user;
    double at_s = (double)stylus->frame / RATE_HZ, pressed_n = 1.0, touches = 1.0, current_a[BUFFER];
    double position_m[3] = {0.03 * cos(5.2 * at_s), 0.03 * sin(5.2 * at_s), 0};
    haptograph_input_set(stylus->position, position_m, 3);
    haptograph_input_set(stylus->force, &pressed_n, 1);
    haptograph_input_set(stylus->touching, &touches, 1);
    if (haptograph_player_process(stylus->player, frames) != HAPTOGRAPH_STATUS_OK) return 1;
    if (haptograph_output_read(stylus->current, current_a, frames, NULL) != HAPTOGRAPH_STATUS_OK) return 1;
    for (size_t frame = 0; frame < frames; frame++) buffer[frame] = (float)current_a[frame];
    stylus->frame += frames;
    return 0;
}

static void little(FILE *file, uint32_t value, int bytes) {
    for (; bytes > 0; bytes--, value >>= 8) fputc((int)(value & 0xff), file);
}

static void wav_header(FILE *file, uint32_t frames) {
    fputs("RIFF", file), little(file, 36 + 4 * frames, 4), fputs("WAVEfmt ", file), little(file, 16, 4);
    little(file, 3, 2), little(file, 1, 2), little(file, RATE_HZ, 4), little(file, 4 * RATE_HZ, 4);
    little(file, 4, 2), little(file, 32, 2), fputs("data", file), little(file, 4 * frames, 4);
}

static void check(haptograph_status status) {
    if (status == HAPTOGRAPH_STATUS_OK) return;
    fprintf(stderr, "%s\n", haptograph_last_error_rendered());
    exit(1);
}

int main(int count, char **arguments) {
    const char *gain[] = {"gain=0.8"};
    haptograph_graph_options checked = HAPTOGRAPH_GRAPH_OPTIONS;
    checked.set = gain;
    checked.set_count = 1;
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    options.rested = 1;
    haptograph_graph graph;
    pen stylus;
    memset(&stylus, 0, sizeof stylus);
    check(haptograph_graph_open(count > 1 ? arguments[1] : "graphs/texturepad.ron", &checked, &graph));
    check(haptograph_graph_input(graph, "stylus.position", HAPTOGRAPH_VECTOR, &stylus.position));
    check(haptograph_graph_input(graph, "stylus.force", HAPTOGRAPH_SCALAR, &stylus.force));
    check(haptograph_graph_input(graph, "stylus.touching", HAPTOGRAPH_SCALAR, &stylus.touching));
    check(haptograph_graph_output(graph, "haptuator.current", HAPTOGRAPH_SCALAR, &stylus.current));
    check(haptograph_player_open(graph, &options, &stylus.player));

    FILE *file = fopen(count > 2 ? arguments[2] : "texture.wav", "wb");
    if (!file) return perror("the WAV file"), 1;
    wav_header(file, BUFFER * BUFFERS);
    float most = 0;
    for (int call = 0; call < BUFFERS; call++) {
        float buffer[BUFFER];
        // Half-way the user turns the knob: another thread may do that.
        if (call == BUFFERS / 2) check(haptograph_player_set(stylus.player, "out.gain", 0.4));
        if (audio_callback(buffer, BUFFER, &stylus)) return 1;
        for (int frame = 0; frame < BUFFER; frame++) {
            uint32_t bits;
            memcpy(&bits, &buffer[frame], sizeof bits);
            little(file, bits, 4);
            most = fmaxf(most, fabsf(buffer[frame]));
        }
    }
    int written = fclose(file) == 0;
    check(haptograph_player_finish(stylus.player, NULL));
    check(haptograph_input_free(stylus.position));
    check(haptograph_input_free(stylus.force));
    check(haptograph_input_free(stylus.touching));
    check(haptograph_output_free(stylus.current));
    check(haptograph_graph_free(graph));
    printf("%d frames, at most %.3f A\n", BUFFER * BUFFERS, most);
    return written && most > 0.01f && most <= 0.5f ? 0 : 1;
}
