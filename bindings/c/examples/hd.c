// A servo callback in the style of OpenHaptics' HD scheduler, at 1 kHz: it renders graphs/omni.ron on the arm.
// stand-ins/hd.h simulates the arm; with the vendor's SDK include <HD/hd.h> in its place and link it.
//
//     cc hd.c $(pkg-config --cflags --libs haptograph) -lm -o hd && ./hd graphs/omni.ron
#include "stand-ins/hd.h"
#include <haptograph.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    HHD device;
    haptograph_player player;
    haptograph_input position;
    haptograph_output force;
    double most_n;
} rendering;

static HDCallbackCode servo_callback(void *user) {
    rendering *touch = user;
    double position[3], force_n[3];
    hdBeginFrame(touch->device);
    hdGetDoublev(HD_CURRENT_POSITION, position); // mm
    for (int axis = 0; axis < 3; axis++) position[axis] *= 1e-3;
    haptograph_input_set(touch->position, position, 3);
    // 10 frames of the graph's driver, which runs at 10 kHz. After a failure the arm gets zeros.
    haptograph_status status = haptograph_player_process(touch->player, 10);
    haptograph_output_read(touch->force, force_n, 3, NULL);
    hdSetDoublev(HD_CURRENT_FORCE, force_n);
    hdEndFrame(touch->device);
    for (int axis = 0; axis < 3; axis++) touch->most_n = fmax(touch->most_n, fabs(force_n[axis]));
    return status == HAPTOGRAPH_STATUS_OK ? HD_CALLBACK_CONTINUE : HD_CALLBACK_DONE;
}

static void check(haptograph_status status) {
    if (status == HAPTOGRAPH_STATUS_OK) return;
    fprintf(stderr, "%s\n", haptograph_last_error_rendered());
    exit(1);
}

int main(int count, char **arguments) {
    haptograph_graph graph;
    rendering touch = {hdInitDevice(HD_DEFAULT_DEVICE), {0}, {0}, {0}, 0};
    check(haptograph_graph_open(count > 1 ? arguments[1] : "graphs/omni.ron", NULL, &graph));
    check(haptograph_graph_input(graph, "arm.position", HAPTOGRAPH_VECTOR, &touch.position));
    check(haptograph_graph_output(graph, "arm.force", HAPTOGRAPH_VECTOR, &touch.force));
    check(haptograph_player_open(graph, NULL, &touch.player));
    hdEnable(HD_FORCE_OUTPUT);
    hdScheduleAsynchronous(servo_callback, &touch, HD_DEFAULT_SCHEDULER_PRIORITY);
    hdStartScheduler();
    hdStopScheduler();
    hdDisableDevice(touch.device);
    check(haptograph_player_finish(touch.player, NULL));
    check(haptograph_input_free(touch.position));
    check(haptograph_output_free(touch.force));
    check(haptograph_graph_free(graph));
    printf("at most %.2f N at the arm\n", touch.most_n);
    return touch.most_n > 0.1 && touch.most_n < 3.31 ? 0 : 1; // the graph's limit is 3.3 N
}
