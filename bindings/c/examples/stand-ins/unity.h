// A stand-in for the audio side of a game engine in the style of Unity. It is not Unity's: written here, simulated, without a
// soundcard. There a script in C# imports the functions of unity.c from a native plugin and calls the last one from its own
// OnAudioFilterRead(float[] data, int channels), in the audio thread.
#ifndef HAPTOGRAPH_STAND_IN_UNITY_H
#define HAPTOGRAPH_STAND_IN_UNITY_H

#include <math.h>

enum { UNITY_RATE_HZ = 48000, UNITY_FRAMES = 1024, UNITY_CHANNELS = 2, UNITY_BUFFERS = 94 };

typedef void (*unity_audio_filter)(float *data, int length, int channels);

// Plays 2 s of stereo buffers through a filter; returns the largest sample.
static float unity_plays(unity_audio_filter filter) {
    static float data[UNITY_FRAMES * UNITY_CHANNELS];
    float most = 0;
    for (int buffer = 0; buffer < UNITY_BUFFERS; buffer++) {
        for (int sample = 0; sample < UNITY_FRAMES * UNITY_CHANNELS; sample++) data[sample] = 0;
        filter(data, UNITY_FRAMES * UNITY_CHANNELS, UNITY_CHANNELS);
        for (int sample = 0; sample < UNITY_FRAMES * UNITY_CHANNELS; sample++) most = fmaxf(most, fabsf(data[sample]));
    }
    return most;
}

#endif
