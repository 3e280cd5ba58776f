use super::*;
use crate::simulated::orientation::from_rotation_vector;
use crate::vector::{norm, sub};
use haptograph_signal::time::Rate;

fn context(rate: &str, seed: u64) -> BuildContext {
    let mut cx = BuildContext::new("tool", Rate::parse(rate).unwrap());
    cx.seed = seed;
    cx
}

fn settings(material: &str, motion: Motion, person: u64) -> SimulatedRecordingToolSettings {
    SimulatedRecordingToolSettings {
        material: material.into(),
        motion,
        from_rest: false,
        press_n: 5.0,
        person,
        tracker_to_tip_mm: [0.0, 0.0, -120.0].map(Millimetres),
        force_sensor_to_tip_mm: [0.0, 0.0, -30.0].map(Millimetres),
        force_sensor_turn_deg: [0.0, 0.0, 45.0].map(Degrees),
    }
}

/// All channels, frame after frame.
fn readings(settings: SimulatedRecordingToolSettings, seed: u64, seconds: f64) -> Vec<[f64; 15]> {
    let mut device = SimulatedRecordingTool::build(settings, &context("10000", seed)).unwrap();
    let frame = |device: &mut Box<dyn Device>| {
        let mut lanes = [0.0; 15];
        let (position, rest) = lanes.split_at_mut(3);
        let (orientation, rest) = rest.split_at_mut(3);
        let (acceleration, wrench) = rest.split_at_mut(3);
        let channels: [&mut [f64]; 4] = [position, orientation, acceleration, wrench];
        channels.into_iter().enumerate().for_each(|(channel, lanes)| device.read(channel, lanes));
        lanes
    };
    let ticks = (seconds * TOOL_RATE_HZ) as usize;
    (0..ticks)
        .map(|_| {
            device.advance();
            frame(&mut device)
        })
        .collect()
}

#[test]
fn the_calibration_leads_back_to_tip_and_world() {
    let turn = rotation_of([0.0, 0.0, 45.0].map(Degrees));
    let (mut normal_n, mut highest_m) = (0.0, 0.0_f64);
    let all = readings(settings("T1", Motion::Circle, 1), 1, 1.0);
    for lanes in &all {
        let [x, y, z, a, b, c] = *lanes.first_chunk().unwrap();
        let q = from_rotation_vector([a, b, c]);
        let tip_m = add_scaled([x, y, z], rotate(q, [0.0, 0.0, -0.12]), 1.0);
        highest_m = highest_m.max(tip_m[2].abs());
        let sensed: Vec3 = *lanes[9..].first_chunk().unwrap();
        let in_tool = turn.map(|row| dot(row, sensed));
        normal_n += rotate(q, in_tool)[2] / all.len() as f64;
        // The load acts at the tip: about the sensor it has the torque of the lever, in the sensor's frame.
        let torque: Vec3 = *lanes[12..].first_chunk().unwrap();
        let wanted = cross([0.0, 0.0, -0.03], in_tool);
        assert!(norm(sub(turn.map(|row| dot(row, torque)), wanted)) < 1e-15);
    }
    assert!(highest_m < 1e-3, "the tip leaves the surface by {highest_m} m");
    assert!((0.5..2.5).contains(&normal_n), "{normal_n} N");
}

#[test]
fn people_pieces_and_materials_differ_and_a_session_repeats_to_the_bit() {
    let short = |material: &str, person, seed| readings(settings(material, Motion::Drag, person), seed, 0.02);
    let once = short("T3", 1, 1);
    assert_eq!(once, short("T3", 1, 1));
    assert!(once != short("T3", 2, 1) && once != short("T3", 1, 2) && once != short("T4", 1, 1));
}

#[test]
fn a_press_is_upright_and_reaches_its_force() {
    let press = readings(settings("T2", Motion::Press, 1), 1, 4.0);
    let hardest_n = press.iter().map(|lanes| lanes[11]).fold(0.0, f64::max);
    assert!((4.5..5.5).contains(&hardest_n), "{hardest_n} N");
    assert!(press.iter().all(|lanes| lanes[3..6] == [0.0; 3]));
    let harder = SimulatedRecordingToolSettings { press_n: 10.0, ..settings("T2", Motion::Press, 1) };
    let press = readings(harder, 1, 7.0);
    let hardest_n = press.iter().map(|lanes| lanes[11]).fold(0.0, f64::max);
    assert!((9.5..10.5).contains(&hardest_n), "{hardest_n} N");
}

#[test]
fn unknown_materials_and_other_rates_are_refused() {
    let refused = |material: &str, rate: &str| {
        SimulatedRecordingTool::build(settings(material, Motion::Drag, 1), &context(rate, 1)).err().unwrap()
    };
    let unknown = refused("T7", "10000");
    assert_eq!(unknown.field, Some("material"));
    assert!(unknown.message.contains("T1, T2"));
    assert!(refused("T1", "1000").message.contains("10000"));
}

#[test]
#[ignore = "prints the time of a minute of simulation"]
fn a_minute_is_simulated_in_seconds() {
    let start = std::time::Instant::now();
    readings(settings("T1", Motion::Drag, 1), 1, 60.0);
    #[allow(clippy::print_stderr)]
    {
        eprintln!("a minute simulated in {:.2} s", start.elapsed().as_secs_f64());
    }
}
