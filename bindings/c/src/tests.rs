//! What C cannot see: that real-time calls allocate nothing, also where they fail, and that panics end in a status.

use crate::border::{
    Graph, HAPTOGRAPH_SCALAR, HAPTOGRAPH_VECTOR, Input, Outcome, Output, Player, Setting, State, Status,
    calls,
};
use crate::failure::{Failure, guard, guard_realtime};
use crate::realtime::allocations;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

const PAD: &CStr = c"../../graphs/texturepad.ron";

struct Played {
    graph: Graph,
    position: Input,
    current: Output,
    player: Player,
    gain: Setting,
}

fn played() -> Played {
    let mut played = Played {
        graph: Graph { id: 0 },
        position: Input { id: 0 },
        current: Output { id: 0 },
        player: Player { id: 0 },
        gain: Setting { id: 0 },
    };
    // SAFETY: every text is a literal that ends with 0, every handle goes to a field of its type.
    let opened = unsafe {
        [
            calls::haptograph_graph_open(PAD.as_ptr(), null(), &mut played.graph),
            calls::haptograph_graph_input(
                played.graph,
                c"stylus.position".as_ptr(),
                HAPTOGRAPH_VECTOR,
                &mut played.position,
            ),
            calls::haptograph_graph_output(
                played.graph,
                c"haptuator".as_ptr(),
                HAPTOGRAPH_SCALAR,
                &mut played.current,
            ),
            calls::haptograph_player_open(played.graph, null(), &mut played.player),
            calls::haptograph_player_setting(played.player, c"out.gain".as_ptr(), &mut played.gain),
        ]
    };
    assert_eq!(opened, [Status::Ok; 5]);
    played
}

#[test]
fn real_time_calls_allocate_nothing_whether_they_succeed_or_fail() {
    let Played { position, current, player, gain, .. } = played();
    let (point, mut frames) = ([0.01, 0.0, 0.0], [0.0; 480]);
    let (narrow, mut narrow_frames, mut value) = ([0.01_f32, 0.0, 0.0], [0.0_f32; 480], 0.0);
    let stale = Player { id: player.id ^ 1 << 40 };
    let mut ended = Vec::with_capacity(640);
    let count = allocations(|| {
        for call in 0..40 {
            let seconds = f64::from(call) * 0.01;
            // SAFETY: the lengths are those of the arrays, and nobody else uses them.
            ended.extend_from_slice(&unsafe {
                [
                    calls::haptograph_input_set(position, point.as_ptr(), 3),
                    calls::haptograph_input_set_at(position, seconds, point.as_ptr(), 3),
                    calls::haptograph_input_push(position, point.as_ptr(), 3, null_mut()),
                    calls::haptograph_input_set(position, point.as_ptr(), 2),
                    calls::haptograph_player_process(player, 480),
                    calls::haptograph_player_process(stale, 480),
                    calls::haptograph_output_read(current, frames.as_mut_ptr(), 480, null_mut()),
                    calls::haptograph_setting_set(gain, seconds),
                    calls::haptograph_setting_set(Setting { id: player.id }, 1.0),
                    calls::haptograph_player_state(player, null_mut(), null_mut()),
                    calls::haptograph_input_push_float(position, narrow.as_ptr(), 3, null_mut()),
                    calls::haptograph_input_push_float(position, narrow.as_ptr(), 2, null_mut()),
                    calls::haptograph_output_read_float(current, narrow_frames.as_mut_ptr(), 480, null_mut()),
                    calls::haptograph_output_read_float(current, null_mut(), 480, null_mut()),
                    calls::haptograph_setting_value(gain, &mut value),
                    calls::haptograph_setting_value(gain, null_mut()),
                ]
            });
        }
    });
    assert_eq!(count, 0);
    let wanted = [
        Status::Ok,
        Status::Ok,
        Status::Ok,
        Status::Shape,
        Status::Ok,
        Status::Handle,
        Status::Ok,
        Status::Ok,
        Status::Kind,
        Status::Ok,
        Status::Ok,
        Status::Shape,
        Status::Ok,
        Status::Argument,
        Status::Ok,
        Status::Argument,
    ];
    assert!(ended.chunks(wanted.len()).all(|ended| ended == wanted), "{ended:?}");
    assert_eq!(value, 0.39, "what was set last");
}

#[test]
fn a_run_ends_with_what_it_did() {
    let Played { player, graph, .. } = played();
    let mut outcome = Outcome::default();
    let mut state = State::Panicked;
    // SAFETY: what is pointed to is of its type.
    unsafe {
        assert_eq!(calls::haptograph_player_process(player, 4800), Status::Ok);
        assert_eq!(calls::haptograph_player_state(player, &mut state, null_mut()), Status::Ok);
        assert_eq!(calls::haptograph_player_finish(player, &mut outcome), Status::Ok);
    }
    assert_eq!(state, State::Running);
    assert_eq!((outcome.frames, outcome.seconds), (4800, 0.1));
    assert_eq!(calls::haptograph_graph_free(graph), Status::Ok);
}

#[test]
fn no_panic_crosses_the_border() {
    let failed = guard(|| -> Result<(), Failure> { panic!("number {}", 7) });
    assert_eq!(failed, Status::Panic);
    // SAFETY: the text is this thread's until its next call that fails.
    let message = unsafe { CStr::from_ptr(calls::haptograph_last_error_message()) };
    let message = message.to_string_lossy();
    assert!(message.contains("number 7"), "{message}");
    assert_eq!(guard_realtime(|| -> Result<(), Status> { panic!("again") }), Status::Panic);
}
