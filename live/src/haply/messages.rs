//! The messages of the Inverse Service, version 3.5: JSON, a state for each command.
//!
//! They are as the service's documentation has them (<https://docs.haply.co/inverseSDK/service/api/simulation>, and
//! `commons/mount-and-workspace` for presets) and as the manufacturer's crate `haply` 1.3.0 types them. Only what a graph uses
//! is read.

use crate::udp::protocol::are_in_range;
use haptograph_nodes::network::link::{Count, SENSED};
use serde::Deserialize;
use serde_json::json;

/// A state of everything that the service has.
#[derive(Debug, Deserialize)]
pub(super) struct State {
    inverse3: Vec<Arm>,
    #[serde(default)]
    verse_grip: Vec<Grip>,
    #[serde(default)]
    wireless_verse_grip: Vec<Grip>,
    #[serde(default)]
    custom_verse_grip: Vec<Grip>,
}

#[derive(Debug, Deserialize)]
struct Arm {
    device_id: String,
    state: ArmState,
    #[serde(default)]
    status: ArmStatus,
}

#[derive(Debug, Deserialize)]
struct ArmState {
    cursor_position: Components,
    #[serde(default)]
    cursor_velocity: Option<Components>,
}

/// What was stated of an arm; a state may leave out what has not changed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
pub(super) struct ArmStatus {
    ready: Option<bool>,
    calibrated: Option<bool>,
}

impl ArmStatus {
    /// With what is stated later.
    pub(super) fn then(self, later: Self) -> Self {
        Self { ready: later.ready.or(self.ready), calibrated: later.calibrated.or(self.calibrated) }
    }

    /// True if something was stated, and nothing against the arm: without that its position means nothing.
    pub(super) fn is_ready(self) -> bool {
        let stated = [self.ready, self.calibrated];
        stated.contains(&Some(true)) && !stated.contains(&Some(false))
    }
}

#[derive(Debug, Deserialize)]
struct Grip {
    device_id: String,
    state: GripState,
}

#[derive(Debug, Deserialize)]
struct GripState {
    orientation: Option<Components>,
    /// Of a grip with one button.
    button: Option<bool>,
    buttons: Option<Buttons>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Buttons {
    a: bool,
    b: bool,
    c: bool,
}

/// A vector or a quaternion. JSON has no NaN: the service writes null, or nothing.
#[derive(Debug, Deserialize)]
struct Components {
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    w: Option<f64>,
}

impl Components {
    fn vector(&self) -> [f64; 3] {
        [self.x, self.y, self.z].map(|component| component.unwrap_or(f64::NAN))
    }
}

/// What a state says of an arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Reading {
    /// Position (m), orientation (rotation vector, rad), velocity (m/s), buttons.
    Sensed([f64; SENSED]),
    /// The service does not have it.
    Absent,
}

impl State {
    /// Reads a message.
    pub(super) fn parse(text: &str) -> Result<Self, Count> {
        serde_json::from_str(text).map_err(|_| Count::Malformed)
    }

    /// Identifiers of the arms.
    #[cfg(feature = "haply")]
    pub(super) fn ids(&self) -> Vec<String> {
        self.inverse3.iter().map(|arm| arm.device_id.clone()).collect()
    }

    /// What it states of an arm.
    pub(super) fn status(&self, arm: &str) -> ArmStatus {
        let arm = self.inverse3.iter().find(|known| known.device_id == arm);
        arm.map_or_else(ArmStatus::default, |arm| arm.status)
    }

    /// What it says of an arm and its grip: that of this identifier, or the first.
    pub(super) fn read(&self, arm: &str, grip: Option<&str>) -> Result<Reading, Count> {
        let Some(arm) = self.inverse3.iter().find(|known| known.device_id == arm) else {
            return Ok(Reading::Absent);
        };
        let mut grips =
            self.verse_grip.iter().chain(&self.wireless_verse_grip).chain(&self.custom_verse_grip);
        let grip = grips.find(|known| grip.is_none_or(|id| known.device_id == id)).map(|grip| &grip.state);
        let orientation = grip.and_then(|grip| grip.orientation.as_ref());
        let parts = [
            arm.state.cursor_position.vector(),
            orientation.map_or([0.0; 3], rotation_vector),
            arm.state.cursor_velocity.as_ref().map_or([0.0; 3], Components::vector),
            grip.map_or([0.0; 3], GripState::held),
        ];
        let mut sensed = [0.0; SENSED];
        sensed.copy_from_slice(parts.as_flattened());
        match () {
            () if !sensed.iter().all(|number| number.is_finite()) => Err(Count::NotNumbers),
            () if !are_in_range(&sensed) => Err(Count::TooLarge),
            () => Ok(Reading::Sensed(sensed)),
        }
    }
}

impl GripState {
    /// 1 for each button that is held.
    fn held(&self) -> [f64; 3] {
        let only = [self.button == Some(true), false, false];
        let held = self.buttons.as_ref().map_or(only, |buttons| [buttons.a, buttons.b, buttons.c]);
        held.map(|held| f64::from(u8::from(held)))
    }
}

/// Axis times angle of a quaternion of any length, the angle at most pi; zero of one that is zero.
fn rotation_vector(quaternion: &Components) -> [f64; 3] {
    let (w, axis) = (quaternion.w.unwrap_or(f64::NAN), quaternion.vector());
    let sine = axis[0].hypot(axis[1]).hypot(axis[2]);
    let angle = 2.0 * sine.atan2(w.abs());
    let scale = if sine == 0.0 { 0.0 } else { (angle / sine).copysign(w * angle) };
    axis.map(|component| scale * component)
}

/// The command of a force on the hand, N; the first one of a connection names its sender and sets the axes.
pub(super) fn command(arm: &str, force_n: [f64; 3], first: Option<Option<&str>>) -> String {
    let [x, y, z] = force_n.map(|component| if component.is_finite() { component } else { 0.0 });
    let commands = json!({ "set_cursor_force": { "vector": { "x": x, "y": y, "z": z } } });
    let mut arm = json!({ "device_id": arm, "commands": commands });
    if let Some(Some(preset)) = first {
        arm["configure"] = json!({ "preset": { "preset": preset } });
    }
    let mut message = json!({ "inverse3": [arm] });
    if first.is_some() {
        message["session"] = json!({ "configure": { "profile": { "name": "haptograph" } } });
    }
    message.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn state(position: &str, more: &str, grips: &str) -> String {
        let arm = format!(r#"{{"device_id": "049D", "state": {{"cursor_position": {position}{more}}}}}"#);
        format!(r#"{{"session_id": 7, "inverse3": [{arm}]{grips}}}"#)
    }

    fn read(text: &str) -> Result<Reading, Count> {
        State::parse(text)?.read("049D", None)
    }

    fn sensed(text: &str) -> [f64; SENSED] {
        match read(text) {
            Ok(Reading::Sensed(sensed)) => sensed,
            other => panic!("{other:?}"),
        }
    }

    const PLACE: &str = r#"{"x": 0.01, "y": -0.12, "z": 0.15}"#;

    #[test]
    fn a_state_has_position_velocity_orientation_and_buttons() {
        let velocity = r#", "cursor_velocity": {"x": 0.1, "y": 0, "z": -0.2}, "mode": "idle""#;
        let turn = r#"{"w": 0.7071067811865476, "x": 0, "y": 0, "z": 0.7071067811865476}"#;
        let grips = format!(
            r#", "verse_grip": [], "wireless_verse_grip": [{{"device_id": "1102", "config": {{"port": "COM12"}},
            "state": {{"orientation": {turn}, "hall": 16, "buttons": {{"a": true, "b": false, "c": true}}}}}}]"#
        );
        let all = sensed(&state(PLACE, velocity, &grips));
        assert_eq!(all[..3], [0.01, -0.12, 0.15]);
        assert!((all[5] - FRAC_PI_2).abs() < 1e-12 && all[3..5] == [0.0, 0.0], "{all:?}");
        assert_eq!(all[6..], [0.1, 0.0, -0.2, 1.0, 0.0, 1.0]);
        let wired = r#", "verse_grip": [{"device_id": "61548", "state": {"button": true, "hall": 0}}]"#;
        assert_eq!(sensed(&state(PLACE, "", wired))[9..], [1.0, 0.0, 0.0]);
        let other = State::parse(&state(PLACE, "", wired)).unwrap().read("049D", Some("1"));
        assert!(matches!(other, Ok(Reading::Sensed(sensed)) if sensed[9] == 0.0), "another grip: {other:?}");
        assert_eq!(sensed(&state(PLACE, "", ""))[3..], [0.0; 9], "no grip");
    }

    #[test]
    fn an_arm_that_is_absent_or_not_calibrated_has_no_position() {
        let text = state(PLACE, "", "");
        assert_eq!(State::parse(&text).unwrap().read("04BA", None).unwrap(), Reading::Absent);
        let stating = |status: &str| {
            let text = text.replace(r#""state""#, &format!(r#""status": {status}, "state""#));
            State::parse(&text).unwrap().status("049D")
        };
        for status in [r#"{"calibrated": false, "ready": true}"#, r#"{"calibrated": true, "ready": false}"#] {
            assert!(!stating(status).is_ready(), "{status}");
        }
        let ready = stating(r#"{"ready": true}"#);
        let uncalibrated = ready.then(stating(r#"{"calibrated": false}"#));
        assert!(ready.is_ready() && !uncalibrated.is_ready() && !uncalibrated.then(ready).is_ready());
        assert!(!stating("{}").is_ready() && ready.then(stating("{}")).is_ready());
        assert!(matches!(State::parse("{\"session\": {}}"), Err(Count::Malformed)), "no state");
    }

    #[test]
    fn what_is_no_position_is_refused() {
        let place = |x: &str| state(&format!(r#"{{"x": {x}, "y": 0, "z": 0}}"#), "", "");
        for text in
            ["", "not JSON", "5", "{\"inverse3\": 5}", &place("NaN"), &place("1e999"), &place("\"1\"")]
        {
            assert!(matches!(read(text), Err(Count::Malformed)), "{text}");
        }
        assert!(matches!(read(&state("{}", "", "")), Err(Count::NotNumbers)));
        assert!(matches!(read(&place("null")), Err(Count::NotNumbers)));
        assert!(matches!(read(&place("1e308")), Err(Count::TooLarge)));
        let deep = "[".repeat(100_000);
        assert!(matches!(read(&deep), Err(Count::Malformed)));
    }

    #[test]
    fn a_quaternion_and_its_negative_are_one_rotation() {
        let of = |[w, x, y, z]: [f64; 4]| {
            rotation_vector(&Components { x: Some(x), y: Some(y), z: Some(z), w: Some(w) })
        };
        assert_eq!(of([1.0, 0.0, 0.0, 0.0]), [0.0; 3]);
        assert_eq!(of([0.0; 4]), [0.0; 3]);
        for sign in [1.0, -1.0] {
            let [x, y, z] = of([sign * 3.0, sign * 3.0, 0.0, 0.0]);
            assert!((x - FRAC_PI_2).abs() < 1e-12 && [y, z] == [0.0; 2], "{x}");
        }
        assert!((of([0.0, 0.0, 2.0, 0.0])[1].abs() - PI).abs() < 1e-12);
    }

    #[test]
    fn commands_are_as_the_service_documents_them() {
        let parsed = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        let vector = json!({ "set_cursor_force": { "vector": { "x": 1.5, "y": 0.0, "z": -0.25 } } });
        let plain = parsed(&command("049D", [1.5, f64::NAN, -0.25], None));
        assert_eq!(plain, json!({ "inverse3": [{ "device_id": "049D", "commands": vector }] }));
        let first = parsed(&command("a\"b", [0.0; 3], Some(Some("arm_front"))));
        assert_eq!(first["session"]["configure"]["profile"]["name"], "haptograph");
        assert_eq!(first["inverse3"][0]["configure"]["preset"]["preset"], "arm_front");
        assert_eq!(first["inverse3"][0]["device_id"], "a\"b");
        assert!(parsed(&command("049D", [0.0; 3], Some(None)))["inverse3"][0].get("configure").is_none());
    }

    proptest! {
        #[test]
        fn any_text_gives_finite_numbers_or_none(text in ".{0,200}", number in any::<f64>()) {
            let _ = read(&text);
            if let Ok(Reading::Sensed(sensed)) = read(&state(&format!(r#"{{"x": {number}, "y": 0, "z": 0}}"#), "", "")) {
                prop_assert!(sensed.iter().all(|number| number.abs() <= 1e6));
            }
        }
    }
}
