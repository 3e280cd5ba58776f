// A desktop arm's servo loop at 1 kHz, in the style of a callback of CHAI3D or OpenHaptics: each call reads where the tip
// is and sends the force that graphs/omni.ron renders. The arm here is simulated, 30 lines of it; put your device's calls
// in the place of `device_position` and `device_force`. The voice coil on the stylus is heard as well.
//
//     cc servo.c $(pkg-config --cflags --libs haptograph) -lm -o servo && ./servo graphs/omni.ron
#include <haptograph.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { RATE_HZ = 1000, SECONDS = 2, COIL_FRAMES = 10 };

// The device: a mass at the end of a spring, pulled across the top of a ball of 100 mm by somebody's hand.
typedef struct {
    double position_m[3], velocity_m_s[3], force_n[3], time_s;
} device;

static void device_position(const device *arm, double position_m[3]) {
    for (int axis = 0; axis < 3; axis++) position_m[axis] = arm->position_m[axis];
}

static void device_force(device *arm, const double force_n[3]) {
    for (int axis = 0; axis < 3; axis++) arm->force_n[axis] = force_n[axis];
}

static void device_moves(device *arm) {
    const double mass_kg = 0.05, spring_n_m = 300, damping_n_s_m = 4, period_s = 1.0 / RATE_HZ;
    const double hand_m[3] = {0.012 * sin(2 * 3.14159265 * 1.5 * arm->time_s), 0, 0.046};
    for (int axis = 0; axis < 3; axis++) {
        double hand_n = spring_n_m * (hand_m[axis] - arm->position_m[axis]) - damping_n_s_m * arm->velocity_m_s[axis];
        arm->velocity_m_s[axis] += (hand_n + arm->force_n[axis]) / mass_kg * period_s;
        arm->position_m[axis] += arm->velocity_m_s[axis] * period_s;
    }
    arm->time_s += period_s;
}

// The rendering: everything that the callback needs.
typedef struct {
    haptograph_player player;
    haptograph_input position;
    haptograph_output force, coil;
    double most_n, most_a;
} rendering;

static haptograph_status servo_callback(rendering *touch, device *arm) {
    double position_m[3], force_n[3], current_a[COIL_FRAMES];
    device_position(arm, position_m);
    haptograph_status status = haptograph_input_set(touch->position, position_m, 3);
    if (status != HAPTOGRAPH_STATUS_OK) return status;
    // The graph's driver runs at 10 kHz: ten frames a callback.
    status = haptograph_player_process(touch->player, COIL_FRAMES);
    if (status != HAPTOGRAPH_STATUS_OK) return status;
    status = haptograph_output_read(touch->force, force_n, 3, NULL);
    if (status != HAPTOGRAPH_STATUS_OK) return status;
    device_force(arm, force_n);
    status = haptograph_output_read(touch->coil, current_a, COIL_FRAMES, NULL);
    double pressed_n = sqrt(force_n[0] * force_n[0] + force_n[1] * force_n[1] + force_n[2] * force_n[2]);
    touch->most_n = fmax(touch->most_n, pressed_n);
    for (int frame = 0; frame < COIL_FRAMES; frame++) touch->most_a = fmax(touch->most_a, fabs(current_a[frame]));
    return status;
}

static void check(haptograph_status status) {
    if (status == HAPTOGRAPH_STATUS_OK) return;
    fprintf(stderr, "%s\n", haptograph_last_error_rendered());
    exit(1);
}

int main(int count, char **arguments) {
    haptograph_graph graph;
    rendering touch = {{0}, {0}, {0}, {0}, 0, 0};
    haptograph_play_options options = HAPTOGRAPH_PLAY_OPTIONS;
    options.rested = 1;
    check(haptograph_graph_open(count > 1 ? arguments[1] : "graphs/omni.ron", NULL, &graph));
    check(haptograph_graph_input(graph, "arm.position", HAPTOGRAPH_VECTOR, &touch.position));
    check(haptograph_graph_output(graph, "arm.force", HAPTOGRAPH_VECTOR, &touch.force));
    check(haptograph_graph_output(graph, "haptuator.current", HAPTOGRAPH_SCALAR, &touch.coil));
    check(haptograph_player_open(graph, &options, &touch.player));
    check(haptograph_graph_free(graph));

    device arm = {{0, 0, 0.055}, {0}, {0}, 0};
    for (int tick = 0; tick < SECONDS * RATE_HZ; tick++) {
        device_moves(&arm);
        haptograph_status status = servo_callback(&touch, &arm);
        if (status != HAPTOGRAPH_STATUS_OK) {
            fprintf(stderr, "%s\n", haptograph_status_text(status));
            return 1;
        }
    }
    haptograph_outcome outcome;
    check(haptograph_player_finish(touch.player, &outcome));
    check(haptograph_input_free(touch.position));
    check(haptograph_output_free(touch.force));
    check(haptograph_output_free(touch.coil));
    printf("%.1f s: at most %.2f N at the arm, %.3f A in the coil\n", outcome.seconds, touch.most_n, touch.most_a);
    // The limits of the graph: 3.3 N, 0.5 A.
    int felt = touch.most_n > 0.1 && touch.most_n < 3.31 && touch.most_a > 0.001 && touch.most_a <= 0.5;
    return felt ? 0 : 1;
}
