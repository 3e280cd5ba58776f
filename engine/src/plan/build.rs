//! Planning: makes a plan from a graph.

mod rings;

use super::order::{Group, delay_frames, order};
use super::resolve::{self, Places, Port, StepDraft};
use super::slots::{Demand, MANY};
use super::{
    ActuatorPlan, BridgePlan, BridgeWork, DelayPlan, Delivered, DevicePlan, MAX_BLOCK, NodeKey, Plan,
    PlanOptions, StepTime, StepWork, Tap,
};
use crate::device::Device;
use crate::graph::{Bridge, Edge, Graph, GraphDevice, NodeId, Reach, Work, id_of};
use crate::io::{Form, LINE, Placing};
use crate::node::Stream;
use petgraph::graph::{EdgeIndex, NodeIndex};
use petgraph::visit::EdgeRef;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Key of a bridge, for sharing between readers.
type Crossing = (NodeIndex, usize, &'static str, usize, bool, usize);

struct Builder<'a> {
    graph: &'a Graph,
    plan: Plan,
    steps: Vec<StepDraft>,
    demands: Vec<Demand>,
    /// Ports of the sources and sinks of each device, with their channels.
    device_ports: Vec<DevicePorts>,
    /// Ports of each node.
    ports: Vec<Vec<Port>>,
    /// Output ports of shared bridges.
    crossings: HashMap<Crossing, Port>,
    /// Delays of loops by edge: the delay and the port of its reader.
    loops: HashMap<EdgeIndex, (u32, Port)>,
    /// Ports of rings from other drivers, by edge.
    rings: HashMap<EdgeIndex, Port>,
    sinks_left: Vec<usize>,
    /// The nodes that depend on each live input.
    reaches: Vec<Reach>,
    /// Demands that steps of the present group need.
    needed: Vec<usize>,
}

#[derive(Default, Clone)]
struct DevicePorts {
    /// The step of the first source, which fills all of them.
    read_step: Option<usize>,
    reads: Vec<(Port, usize)>,
    writes: Vec<(Port, usize)>,
}

/// Port of an input that is not connected.
const ABSENT: Port = Port { demand: usize::MAX, placing: Placing { start: 0, width: 0 }, clock: 0 };
/// Group number of nodes outside islands; bridges are shared only within a group.
const OUTSIDE: usize = usize::MAX;

pub(super) fn build(graph: &Graph, driver: usize, options: &PlanOptions) -> Plan {
    let mut builder = Builder::new(graph, driver, options);
    for (number, group) in order(graph).iter().enumerate() {
        // Neither a delay nor a device joins two drivers, so a group has one.
        if graph.driver_of(id_of(group.members[0])) == Some(driver) {
            builder.ring_reads(group);
            builder.group(group, number);
            builder.ring_writes(group);
        }
    }
    builder.finish(&options.taps)
}

/// A plan with the clocks, devices and live settings of a graph, and no steps yet.
fn unfilled(graph: &Graph, driver: usize, options: &PlanOptions) -> Plan {
    let live = graph.live_settings().into_iter();
    Plan {
        block: if options.block == 0 { 64 } else { options.block.min(MAX_BLOCK) },
        driver,
        base: graph.base.clone(),
        rates: graph.clocks.iter().map(|clock| clock.rate).collect(),
        periods_s: graph.clocks.iter().map(|clock| clock.rate.period_s()).collect(),
        clock_names: graph.clocks.iter().map(|clock| clock.name.clone()).collect(),
        steps: Vec::new(),
        slots: Vec::new(),
        pacings: Vec::new(),
        processors: Vec::new(),
        laws: Vec::new(),
        chains: Vec::new(),
        processor_keys: Vec::new(),
        devices: graph.devices.iter().map(DevicePlan::of).collect(),
        actuators: Vec::new(),
        delivered: Arc::new([]),
        times: Arc::new([]),
        bridges: Vec::new(),
        delays: Vec::new(),
        taps: Vec::new(),
        tap_places: Vec::new(),
        ring_writes: Vec::new(),
        ring_reads: Vec::new(),
        live: live.filter(|live| graph.driver_of(live.node) == Some(driver)).collect(),
        live_works: Vec::new(),
        data_frames: graph.frames_of_data(graph.clocks[driver].rate),
    }
}

impl Plan {
    /// The device of this plan that continues if a graph with `device` replaces it.
    pub(crate) fn continued(&self, device: &GraphDevice) -> Option<&dyn Device> {
        let key = DevicePlan::key_of(device);
        self.devices.iter().find(|known| known.key == key).map(|known| &*known.device)
    }
}

impl DevicePlan {
    /// True if nodes of this driver read or drive it.
    pub(crate) fn is_used(&self) -> bool {
        !self.reads.is_empty() || !self.driven_by.is_empty()
    }

    fn key_of(device: &GraphDevice) -> NodeKey {
        NodeKey {
            path: device.name.as_str().into(),
            kind: device.entry.spec.name,
            fingerprint: device.fingerprint,
        }
    }

    fn of(device: &GraphDevice) -> Self {
        Self {
            name: device.name.clone(),
            key: Self::key_of(device),
            clock: device.clock,
            senses: device.senses.clone(),
            driven_by: Vec::new(),
            device: device.device.clone_box(),
            input: device.device.live_input(),
            reads: Vec::new(),
            writes: Vec::new(),
        }
    }
}

impl<'a> Builder<'a> {
    fn new(graph: &'a Graph, driver: usize, options: &PlanOptions) -> Self {
        let mut sinks_left = vec![0; graph.devices.len()];
        for device in graph.nodes.node_weights().filter_map(|node| node.work.sink_device()) {
            sinks_left[device] += 1;
        }
        Self {
            graph,
            plan: unfilled(graph, driver, options),
            steps: Vec::with_capacity(graph.nodes.node_count()),
            device_ports: vec![DevicePorts::default(); graph.devices.len()],
            demands: Vec::with_capacity(graph.nodes.node_count()),
            ports: vec![Vec::new(); graph.nodes.node_count()],
            crossings: HashMap::new(),
            loops: HashMap::new(),
            rings: HashMap::new(),
            sinks_left,
            reaches: graph.reaches_of_inputs(),
            needed: Vec::new(),
        }
    }

    fn group(&mut self, group: &Group, number: usize) {
        let (step, demand) = (self.steps.len(), self.demands.len());
        self.needed.clear();
        if group.pacing.is_empty() {
            self.node(group.members[0], OUTSIDE);
            return;
        }
        let clock = self.graph.nodes[group.members[0]].clock.unwrap_or(0);
        let work = StepWork::Island {
            steps: 0,
            first_pacing: self.plan.pacings.len() as u32,
            pacings: group.pacing.len() as u32,
        };
        self.plan.pacings.extend(&group.pacing);
        self.step(work, clock, group.members[0], "island");
        let delays = self.loop_delays(group);
        for edge in &delays {
            self.delay_read(*edge);
        }
        for member in &group.members {
            self.node(*member, number);
        }
        for edge in &delays {
            self.delay_write(*edge);
        }
        self.close_island(step, demand);
    }

    /// Sets the island's length and keeps its buffers alive throughout: its steps run many times a block.
    fn close_island(&mut self, begin: usize, first_demand: usize) {
        let end = self.steps.len() - 1;
        if let StepWork::Island { steps, .. } = &mut self.steps[begin].work {
            *steps = (end - begin) as u32;
        }
        for demand in &mut self.demands[first_demand..] {
            (demand.from, demand.to) = (begin, end);
        }
        for demand in self.needed.drain(..) {
            self.demands[demand].to = end;
        }
    }

    fn loop_delays(&self, group: &Group) -> Vec<EdgeIndex> {
        let inside: HashSet<NodeIndex> = group.members.iter().copied().collect();
        let edges = group.members.iter().flat_map(|member| self.graph.nodes.edges(*member));
        let mut delays: Vec<_> = edges
            .filter(|edge| delay_frames(edge.weight()).is_some() && inside.contains(&edge.target()))
            .collect();
        delays.sort_by_key(|edge| (&self.graph.nodes[edge.target()].path, edge.weight().input));
        delays.into_iter().map(|edge| edge.id()).collect()
    }

    fn delay_read(&mut self, edge: EdgeIndex) {
        let Some((from, to)) = self.graph.nodes.edge_endpoints(edge) else {
            return;
        };
        let weight = &self.graph.nodes[edge];
        let delay = self.delay_plan(from, weight);
        let clock = self.graph.nodes[to].clock.unwrap_or(0);
        let width = self.plan.delays[delay as usize].kind.width();
        let label = format!("delayed {}", self.port_name(from, weight.output));
        let step = self.step(StepWork::DelayRead(delay), clock, to, label);
        let ports = self.allot(step, clock, [width].into_iter());
        self.loops.insert(edge, (delay, ports[0]));
    }

    fn delay_write(&mut self, edge: EdgeIndex) {
        let Some((from, to)) = self.graph.nodes.edge_endpoints(edge) else {
            return;
        };
        let Some(&(delay, _)) = self.loops.get(&edge) else {
            return;
        };
        let output = self.graph.nodes[edge].output;
        let port = self.ports[from.index()][output];
        let label = format!("hold back {}", self.port_name(from, output));
        let step = self.step(StepWork::DelayWrite(delay), port.clock as usize, to, label);
        self.bind(step, port, Form::Sampled);
    }

    fn delay_plan(&mut self, from: NodeIndex, edge: &Edge) -> u32 {
        let Bridge::Delay { frames, initial } = edge.bridge else {
            return 0;
        };
        self.plan.delays.push(DelayPlan {
            frames,
            initial,
            kind: self.graph.nodes[from].outputs[edge.output].kind,
        });
        (self.plan.delays.len() - 1) as u32
    }

    fn node(&mut self, index: NodeIndex, group: usize) {
        let graph = self.graph;
        let node = &graph.nodes[index];
        let Some(clock) = node.clock else { return };
        let path: Arc<str> = node.path.as_str().into();
        let inputs = self.inputs(index, group);
        let widths = node.outputs.iter().map(|output| output.kind.width());
        let work = match &node.work {
            Work::Process(processor) => {
                self.plan.processors.push(processor.boxed_clone());
                self.plan.processor_keys.push(NodeKey {
                    path: Arc::clone(&path),
                    kind: node.entry.spec.name,
                    fingerprint: node.fingerprint,
                });
                StepWork::Process((self.plan.processors.len() - 1) as u32)
            }
            Work::Actuator { gain, limit, device, .. } => {
                let reached = self.reaches.iter().filter(|reach| reach.nodes[index.index()]);
                let silenced_by = reached.map(|reach| (reach.device, reach.device == *device));
                let output = node.outputs.first();
                self.plan.actuators.push(ActuatorPlan {
                    silenced_by: silenced_by.collect(),
                    unit: output.map_or_else(String::new, |output| output.quantity.unit()),
                    path: node.path.clone(),
                    gain: *gain,
                    limit: *limit,
                    width: widths.clone().next().unwrap_or(0),
                    rate: graph.clocks[clock].rate,
                    simulated: graph.devices[*device].entry.spec.simulated,
                });
                StepWork::Actuator((self.plan.actuators.len() - 1) as u32)
            }
            Work::Source { device, .. } => StepWork::DeviceRead(*device as u32),
            Work::File(_) => return,
        };
        let device = node.work.source_device();
        let step = match device.and_then(|device| self.device_ports[device].read_step) {
            Some(step) => step,
            None => self.step(work, clock, index, path),
        };
        if let Some(device) = device {
            self.device_ports[device].read_step = Some(step);
        }
        inputs.iter().for_each(|(port, form)| self.need(step, port, *form));
        match self.steps[step].inputs.is_empty() {
            true => self.steps[step].inputs = inputs,
            false => self.steps[step].inputs.extend(inputs),
        }
        let ports = self.allot(step, clock, widths);
        self.bind_device(&node.work, &ports, index, clock);
        self.ports[index.index()] = ports;
    }

    /// Connects the ports of sources and sinks to their device; the last sink is followed by the write.
    fn bind_device(&mut self, work: &Work, ports: &[Port], index: NodeIndex, clock: usize) {
        match work {
            Work::Source { device, channels } => {
                let reads = &mut self.device_ports[*device].reads;
                reads.extend(ports.iter().copied().zip(channels.iter().copied()));
            }
            Work::Actuator { device, channel, .. } => {
                let actuator = self.plan.actuators.len() - 1;
                for port in ports {
                    self.device_ports[*device].writes.push((*port, *channel));
                    let driven_by = &mut self.plan.devices[*device].driven_by;
                    driven_by.push((actuator, *channel, port.clock));
                }
                self.sinks_left[*device] -= 1;
                if self.sinks_left[*device] == 0 {
                    let label = format!("drive {}", self.plan.devices[*device].name);
                    let step = self.step(StepWork::DeviceWrite(*device as u32), clock, index, label);
                    for place in 0..self.device_ports[*device].writes.len() {
                        let (port, _) = self.device_ports[*device].writes[place];
                        self.need(step, &port, Form::Sampled);
                    }
                }
            }
            _ => {}
        }
    }

    /// Ports of a node's inputs. Plans the bridges that they need.
    fn inputs(&mut self, index: NodeIndex, group: usize) -> Vec<(Port, Form)> {
        let graph = self.graph;
        let node = &graph.nodes[index];
        let mut inputs: Vec<(Port, Form)> = node
            .inputs
            .iter()
            .map(|input| {
                let placing = Placing { start: 0, width: input.kind.width() as u32 };
                (Port { placing, ..ABSENT }, Form::Absent)
            })
            .collect();
        for edge in graph.nodes.edges_directed(index, petgraph::Incoming) {
            let held = node.inputs[edge.weight().input].held;
            inputs[edge.weight().input] =
                self.connection(edge.id(), edge.source(), index, edge.weight(), held, group);
        }
        inputs
    }

    fn connection(
        &mut self,
        id: EdgeIndex,
        from: NodeIndex,
        to: NodeIndex,
        edge: &Edge,
        held: bool,
        group: usize,
    ) -> (Port, Form) {
        let form = |held| if held { Form::Runs } else { Form::Sampled };
        let (work, name) = match edge.bridge {
            Bridge::Direct => return (self.ports[from.index()][edge.output], Form::Sampled),
            Bridge::Delay { .. } => match self.loops.get(&id) {
                Some((_, port)) => return (*port, Form::Sampled),
                None => (BridgeWork::Delay(self.delay_plan(from, edge)), "Delay"),
            },
            Bridge::Ring { .. } => match self.rings.get(&id) {
                Some(port) => return (*port, Form::Sampled),
                // Unreachable: a ring is read ahead of its reader's group.
                None => return (ABSENT, Form::Absent),
            },
            // The check lets nothing but `Hold` feed a held input.
            Bridge::Between(bridge) if held => (BridgeWork::Runs, bridge.spec.name),
            Bridge::Between(bridge) => (BridgeWork::Frames(bridge), bridge.spec.name),
        };
        let clock = self.graph.nodes[to].clock.unwrap_or(0);
        let runs = work == BridgeWork::Runs;
        let key = (from, edge.output, name, clock, runs, group);
        let shared = !matches!(work, BridgeWork::Delay(_));
        if shared && let Some(port) = self.crossings.get(&key) {
            return (*port, form(runs));
        }
        let port =
            self.bridge(work, name, self.ports[from.index()][edge.output], clock, (from, edge.output, to));
        if shared {
            self.crossings.insert(key, port);
        }
        (port, form(runs))
    }

    fn bridge(
        &mut self,
        bridge: BridgeWork,
        name: &str,
        source: Port,
        clock: usize,
        (from, output, to): (NodeIndex, usize, NodeIndex),
    ) -> Port {
        let width = source.placing.width as usize;
        let (max_from, max_to) = (self.most_frames(source.clock as usize), self.most_frames(clock));
        self.plan.bridges.push(BridgePlan {
            work: bridge,
            from: source.clock,
            kind: self.graph.nodes[from].outputs[output].kind,
            max_from,
            max_to,
        });
        let work = StepWork::Bridge((self.plan.bridges.len() - 1) as u32);
        let label = format!("{} {}", name.to_lowercase(), self.port_name(from, output));
        let step = self.step(work, clock, to, label);
        self.bind(step, source, Form::Sampled);
        if bridge == BridgeWork::Runs {
            let len = 1 + (max_from.min(max_to) + 2) * (width + 1);
            return self.allot_len(step, clock, width, len);
        }
        self.allot(step, clock, [width].into_iter())[0]
    }

    fn step(&mut self, work: StepWork, clock: usize, node: NodeIndex, label: impl Into<Arc<str>>) -> usize {
        self.steps.push(StepDraft {
            work,
            clock: clock as u32,
            out: None,
            inputs: Vec::new(),
            outputs: Vec::new(),
            node: id_of(node),
            label: label.into(),
        });
        self.steps.len() - 1
    }

    /// Adds an input to a step.
    fn bind(&mut self, step: usize, port: Port, form: Form) {
        self.need(step, &port, form);
        self.steps[step].inputs.push((port, form));
    }

    /// Keeps the buffer of a port up to a step.
    fn need(&mut self, step: usize, port: &Port, form: Form) {
        if form != Form::Absent {
            let demand = &mut self.demands[port.demand];
            demand.to = demand.to.max(step);
            demand.reader = Some(if demand.reader.is_none_or(|known| known == step) { step } else { MANY });
            self.needed.push(port.demand);
        }
    }

    /// Places the outputs of a step one after the other in a buffer of its own.
    fn allot(
        &mut self,
        step: usize,
        clock: usize,
        widths: impl ExactSizeIterator<Item = usize>,
    ) -> Vec<Port> {
        let frames = self.most_frames(clock);
        self.place(step, clock, widths, |width| (width * frames).next_multiple_of(LINE))
    }

    fn allot_len(&mut self, step: usize, clock: usize, width: usize, len: usize) -> Port {
        self.place(step, clock, [width].into_iter(), |_| len)[0]
    }

    fn place(
        &mut self,
        step: usize,
        clock: usize,
        widths: impl ExactSizeIterator<Item = usize>,
        len_of: impl Fn(usize) -> usize,
    ) -> Vec<Port> {
        if widths.len() == 0 {
            return Vec::new();
        }
        let demand = self.demands.len();
        let mut start = 0;
        let mut ports = Vec::with_capacity(widths.len());
        for width in widths {
            let placing = Placing { start: start as u32, width: width as u32 };
            ports.push(Port { demand, placing, clock: clock as u32 });
            start += len_of(width);
        }
        self.demands.push(Demand { len: start, from: step, to: step, reader: None });
        let step = &mut self.steps[step];
        if step.out.is_none() {
            step.out = Some(demand);
            step.outputs = ports.iter().map(|port| port.placing).collect();
        }
        ports
    }

    /// Largest number of ticks of a clock in a block.
    fn most_frames(&self, clock: usize) -> usize {
        let block = self.plan.base.period(self.plan.driver).saturating_mul(self.plan.block as u64);
        usize::try_from(block.div_ceil(self.plan.base.period(clock))).unwrap_or(usize::MAX)
    }

    fn port_name(&self, node: NodeIndex, output: usize) -> String {
        let node = &self.graph.nodes[node];
        format!("{}.{}", node.path, node.outputs[output].name)
    }

    fn finish(mut self, taps: &[(NodeId, usize)]) -> Plan {
        let last = self.steps.len();
        let mut tapped: Vec<(Port, Stream)> = Vec::new();
        for (place, (node, output)) in taps.iter().enumerate() {
            // Ports of nodes of other drivers were never made.
            if let Some(port) = self.ports.get(node.index()).and_then(|ports| ports.get(*output)) {
                tapped.push((*port, self.graph.stream(*node, *output)));
                self.plan.tap_places.push(place);
            }
        }
        for (port, _) in &tapped {
            self.demands[port.demand].to = last;
            self.demands[port.demand].reader = Some(MANY);
        }
        let places = Places::of(&self.demands);
        let plan = &mut self.plan;
        let is_inner = |number: usize, out: Option<usize>| {
            out.is_some_and(|demand| self.demands[demand].reader == Some(number + 1))
        };
        let steps = self.steps.into_iter().enumerate();
        plan.steps = steps.map(|(number, draft)| places.step(is_inner(number, draft.out), draft)).collect();
        let of_device = |(port, channel): &(Port, usize)| (places.port(port), *channel);
        for (device, ports) in plan.devices.iter_mut().zip(&self.device_ports) {
            device.reads = ports.reads.iter().map(of_device).collect();
            device.writes = ports.writes.iter().map(of_device).collect();
        }
        let tap =
            |(port, stream): (Port, Stream)| Tap { place: places.port(&port), clock: port.clock, stream };
        plan.taps = tapped.into_iter().map(tap).collect();
        resolve::join(plan);
        plan.slots = places.slots;
        plan.delivered = plan.actuators.iter().map(|_| Delivered::default()).collect();
        plan.times = plan.steps.iter().map(|_| StepTime::default()).collect();
        self.plan
    }
}
