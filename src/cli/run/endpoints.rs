//! The devices of a run by role, simulated or real, for the terminal, `run.json` and the page.

use crate::engine::graph::Graph;
use crate::live::supervisor::DeviceUse;
use crate::report::page::Simulation;
use serde_json::{Value, json};

/// Direction of a device; a device with both directions has an endpoint for each.
fn role(endpoint: &DeviceUse) -> &'static str {
    if endpoint.is_driven { "output" } else { "input" }
}

/// The endpoints of a run.
#[derive(Debug, Clone)]
pub(crate) struct Endpoints {
    list: Vec<DeviceUse>,
    /// True for a live run. Other runs do not reach real devices.
    is_live: bool,
}

impl Endpoints {
    /// The endpoints of a graph.
    pub(crate) fn of(graph: &Graph, is_live: bool) -> Self {
        Self::sorted(DeviceUse::of(graph), is_live)
    }

    /// The endpoints of a live run.
    pub(crate) fn live(devices: Vec<DeviceUse>) -> Self {
        Self::sorted(devices, true)
    }

    fn sorted(mut list: Vec<DeviceUse>, is_live: bool) -> Self {
        list.sort_by(|a, b| (role(a), &a.name, a.kind).cmp(&(role(b), &b.name, b.kind)));
        Self { list, is_live }
    }

    /// The facts about devices for `run.json`.
    pub(crate) fn facts(&self) -> [(&'static str, &'static str, Value); 3] {
        [
            ("devices", "Devices", self.to_json()),
            ("simulated_devices", "Simulated devices", json!(self.any_simulated())),
            ("real_devices", "Real devices", json!(self.any_real())),
        ]
    }

    fn which(&self, simulated: bool) -> impl Iterator<Item = &DeviceUse> {
        self.list.iter().filter(move |endpoint| endpoint.is_simulated == simulated)
    }

    /// True if any endpoint is simulated.
    pub(crate) fn any_simulated(&self) -> bool {
        self.which(true).next().is_some()
    }

    /// True if any endpoint is real.
    pub(crate) fn any_real(&self) -> bool {
        self.which(false).next().is_some()
    }

    /// The term for real devices in this run.
    fn real(&self) -> &'static str {
        if self.is_live { "real" } else { "not reached" }
    }

    pub(crate) fn to_json(&self) -> Value {
        let each = self.list.iter().map(|endpoint| {
            json!({
                "name": endpoint.name, "kind": endpoint.kind, "role": role(endpoint),
                "simulated": endpoint.is_simulated, "reached": endpoint.is_simulated || self.is_live,
            })
        });
        Value::Array(each.collect())
    }

    /// For the line at the end of a run, for example `` (simulated: output `arm`; real: input `stylus`)``.
    pub(crate) fn in_brackets(&self) -> String {
        let named = |simulated| names(self.which(simulated), |_| String::new());
        match (self.any_simulated(), self.any_real()) {
            (false, false) => String::new(),
            (true, false) => " (simulated devices)".to_owned(),
            (false, true) => format!(" ({}: {})", self.real(), named(false)),
            (true, true) => format!(" (simulated: {}; {}: {})", named(true), self.real(), named(false)),
        }
    }

    /// For the page's list of facts.
    pub(crate) fn listed(&self) -> String {
        names(self.list.iter(), |endpoint| {
            let what = if endpoint.is_simulated { "simulated" } else { self.real() };
            format!(" ({}, {what})", endpoint.kind)
        })
    }

    /// The statement about simulation on the page.
    pub(crate) fn simulation(&self) -> Simulation {
        let kinds = |simulated| names(self.which(simulated), |endpoint| format!(" ({})", endpoint.kind));
        match (self.any_simulated(), self.any_real()) {
            (false, _) => Simulation::None,
            (true, false) => Simulation::All,
            (true, true) => Simulation::Some(format!(
                "Simulated in this run: {}. Their signals, and all signals that depend on them, show the behaviour of their models, not a measurement. {}: {}.",
                kinds(true),
                if self.is_live { "Real" } else { "Not reached" },
                kinds(false)
            )),
        }
    }
}

fn names<'e>(endpoints: impl Iterator<Item = &'e DeviceUse>, more: impl Fn(&DeviceUse) -> String) -> String {
    let each = endpoints.map(|endpoint| {
        let more = more(endpoint);
        format!("{} `{}`{more}", role(endpoint), endpoint.name)
    });
    each.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::document::Document;
    use crate::engine::graph::{CheckOptions, check};

    fn endpoints(stylus: &str, coil: &str, is_live: bool) -> Endpoints {
        Endpoints::of(&graph(stylus, coil), is_live)
    }

    fn graph(stylus: &str, coil: &str) -> Graph {
        let text = format!(
            r#"Graph(format: 1, 
            clocks: {{ "servo": Driver(rate_hz: 125), "audio": Driver(rate_hz: 48000) }},
            nodes: {{
                "stylus": Tablet(clock: "servo", endpoint: "stylus"),
                "bias": Constant(clock: "audio", value: 0.4, quantity: "current"),
                "out": ActuatorSink(current: "bias", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
            }},
            endpoints: {{ "simulated": {{ "stylus": {stylus}, "coil": {coil} }} }})"#
        );
        let document = Document::parse("g.ron", &text).unwrap();
        let registry = crate::nodes::registry();
        check(&document, &registry, &CheckOptions::default()).unwrap()
    }

    #[test]
    fn simulated_is_said_of_what_is_simulated() {
        let (tablet, coil) = ("SimulatedTablet()", "SimulatedHaptuator()");
        let osc = "OscDevice(listen: \"127.0.0.1:61760\")";
        let card = "Soundcard(amperes_full_scale: 1.0)";
        let said = |stylus, coil, live| endpoints(stylus, coil, live).in_brackets();
        assert_eq!(said(tablet, coil, true), " (simulated devices)");
        assert_eq!(said(osc, coil, true), " (simulated: output `coil`; real: input `stylus`)");
        assert_eq!(said(tablet, card, false), " (simulated: input `stylus`; not reached: output `coil`)");
        assert_eq!(said(osc, card, true), " (real: input `stylus`, output `coil`)");
        let mixed = endpoints(osc, coil, true);
        assert!(mixed.any_simulated() && mixed.any_real());
        let list = mixed.to_json();
        assert_eq!(
            (&list[0]["role"], &list[0]["name"], &list[0]["simulated"]),
            (&json!("input"), &json!("stylus"), &json!(false))
        );
        assert_eq!(
            (&list[1]["kind"], &list[1]["simulated"], &list[1]["reached"]),
            (&json!("SimulatedHaptuator"), &json!(true), &json!(true))
        );
        assert!(matches!(mixed.simulation(), Simulation::Some(_)));
        let mut grown = DeviceUse::of(&graph(tablet, coil));
        grown.push(DeviceUse::of(&graph(osc, coil))[0].clone());
        let grown = Endpoints::live(grown);
        let kinds: Vec<&str> = grown.list.iter().map(|endpoint| endpoint.kind).collect();
        assert_eq!(kinds, ["OscDevice", "SimulatedTablet", "SimulatedHaptuator"]);
        assert!(grown.any_real() && grown.any_simulated());
        assert_eq!(endpoints(osc, card, true).simulation(), Simulation::None);
    }
}
