//! What a page can move: endpoints that a pointer can represent, with the values of their channels in one table, and single
//! channels of others.

use super::pointer::Pointer;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_nodes::simulated::ground::Ground;
use haptograph_nodes::simulated::touchable::Touchable;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::vector::{Vec3, add_scaled, cross, direction, scale, tangents};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Size of a pad, mm: that of a small pen tablet. A pad on an object has the height of the object, and its
/// width is scaled accordingly.
const SIZE_MM: (f64, f64) = (160.0, 100.0);
/// Stiffness of a surface whose graph does not state one, N/m.
const GIVES_N_PER_M: f64 = 500.0;

/// Distance from the middle of the pad of an input to its ends, m and mm.
const REACH_M: f64 = 0.1;
const REACH_MM: f64 = 1e3 * REACH_M;

/// The quantity that a pad provides to a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gives {
    /// Position of the tip: on the plane of the pad, or in the surface that the pad lies on.
    Tip,
    /// Velocity along the surface.
    Velocity,
    /// Normal force.
    Force,
    /// 1 during contact.
    Touching,
    /// Wrench of the press on the object, in the frame of its sensor.
    Wrench,
    /// Zero drag, since a pad does not measure it.
    NoDrag,
    /// Orientation of the pen from its tilt: axis times angle.
    Orientation,
    /// Numbers of this range, from position and tilt to the right; that of the device while the pointer is lifted.
    Numbers([f64; 2]),
}

/// Quantities by name and kind of channel.
const TABLE: [(&str, Kind, Gives); 9] = [
    ("position", Kind::VECTOR, Gives::Tip),
    ("force", Kind::SCALAR, Gives::Force),
    ("touching", Kind::SCALAR, Gives::Touching),
    ("wrench", Kind::WRENCH, Gives::Wrench),
    ("orientation", Kind::VECTOR, Gives::Orientation),
    ("true_position", Kind::VECTOR, Gives::Tip),
    ("true_velocity", Kind::VECTOR, Gives::Velocity),
    ("true_load", Kind::SCALAR, Gives::Force),
    ("true_friction", Kind::VECTOR, Gives::NoDrag),
];

impl Gives {
    fn of(name: &str, kind: Kind) -> Option<Self> {
        let mut table = TABLE.iter();
        let found = table.find(|(known, shape, _)| (*known, *shape) == (name, kind));
        found.map(|(.., gives)| *gives)
    }
}

/// An endpoint that a pointer can represent.
#[derive(Debug, Clone)]
pub(crate) struct PadSpec {
    pub endpoint: String,
    /// The quantities of its channels, by name.
    pub channels: Vec<(&'static str, Gives)>,
    /// The surface that the pad lies on; `None` for a tablet.
    pub on: Option<Touchable>,
    pub size_mm: (f64, f64),
}

/// A channel that a page can move though no pointer can represent its endpoint.
#[derive(Debug, Clone)]
pub(crate) struct InputPad {
    /// Its pad: a range of numbers along each axis.
    pub pad: PadSpec,
    /// The output that reads it.
    pub port: String,
    pub range: [f64; 2],
}

/// The channels that nodes read of lent endpoints.
pub(crate) fn inputs(graph: &Graph, lent: &[String]) -> Vec<InputPad> {
    let mut inputs: Vec<InputPad> = Vec::new();
    for node in graph.nodes().iter() {
        let device = node.device().map(|device| &graph.devices()[device]);
        let Some(device) = device.filter(|device| lent.contains(&device.name)) else { continue };
        for output in node.outputs.iter().filter(|output| output.kind.is_linear()) {
            let number = device.senses.iter().position(|channel| channel.name == output.name);
            let Some(number) = number else { continue };
            let name = device.senses[number].name;
            let is_known =
                |known: &InputPad| known.pad.endpoint == device.name && known.pad.channels[0].0 == name;
            if inputs.iter().any(is_known) {
                continue;
            }
            let mut frame = [0.0; 6];
            device.device().clone_box().read(number, &mut frame[..output.kind.width()]);
            let first = frame.into_iter().fold(0.0, |far: f64, x| far.max(x.abs()));
            let range = device.device().range(number).filter(|[from, to]| from != to);
            let [from, to] = range.unwrap_or_else(|| usual(output.quantity, first));
            let range = [from.min(to), from.max(to)];
            let channels = vec![(name, Gives::Numbers(range))];
            let (endpoint, size_mm) = (device.name.clone(), (2.0 * REACH_MM, 2.0 * REACH_MM));
            let port = format!("{}.{}", node.path, output.name);
            inputs.push(InputPad { pad: PadSpec { endpoint, channels, on: None, size_mm }, port, range });
        }
    }
    inputs
}

/// The range of an input whose device has none and begins as far as `first` from zero.
fn usual(quantity: Quantity, first: f64) -> [f64; 2] {
    let range = match quantity {
        Quantity::NUMBER => [0.0, 1.0],
        Quantity::FREQUENCY => [20.0, 500.0],
        Quantity::LENGTH => [-0.1, 0.1],
        Quantity::ANGLE => [-PI, PI],
        Quantity::SPEED => [-0.5, 0.5],
        Quantity::ACCELERATION => [-20.0, 20.0],
        Quantity::FORCE => [-10.0, 10.0],
        _ => [-1.0, 1.0],
    };
    if first > range[1] { [-2.0 * first, 2.0 * first] } else { range }
}

/// Divides the endpoints of a hosted graph into pads and others; an endpoint for which `stays` is true is not a pad.
/// `simulated` loads the same graph with its own endpoints, which state what their hands touch; it is called
/// only if needed.
pub(crate) fn sort(
    hosted: &Graph,
    stays: impl Fn(&str) -> bool,
    simulated: impl FnOnce() -> Option<Graph>,
) -> (Vec<PadSpec>, Vec<String>) {
    let (mut pads, mut others) = (Vec::new(), Vec::new());
    let mut touched = None;
    let mut simulated = Some(simulated);
    for (endpoint, channels) in endpoints(hosted) {
        if stays(&endpoint) {
            others.push(endpoint);
            continue;
        }
        let given = |(name, kind): &(&'static str, Kind)| Some((*name, Gives::of(name, *kind)?));
        let known: Vec<(&'static str, Gives)> = channels.iter().filter_map(given).collect();
        let gets = |gives: Gives| known.iter().any(|(_, each)| *each == gives);
        if [Gives::Tip, Gives::Force, Gives::Touching].into_iter().all(gets) {
            let (channels, on, size_mm) = (known, None, SIZE_MM);
            pads.push(PadSpec { endpoint, channels, on, size_mm });
            continue;
        }
        let on = (known.len() == channels.len()).then(|| {
            let graph = touched.get_or_insert_with(|| simulated.take().and_then(|load| load()));
            let mut devices = graph.iter().flat_map(|graph| graph.devices());
            let device = devices.find(|device| device.name == endpoint)?;
            Touchable::of(device.device()).cloned()
        });
        match on.flatten() {
            Some(on) => pads.push(laid_on(endpoint, known, on)),
            None => others.push(endpoint),
        }
    }
    (pads, others)
}

/// The endpoints that nodes read, each with its channels.
fn endpoints(hosted: &Graph) -> BTreeMap<String, Vec<(&'static str, Kind)>> {
    let mut endpoints: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for (name, channel) in hosted.host_inputs() {
        let endpoint = name.rsplit_once('.').map_or(&*name, |(endpoint, _)| endpoint);
        let channels = endpoints.entry(endpoint.to_owned()).or_default();
        channels.push((channel.name, channel.kind));
    }
    endpoints
}

fn laid_on(endpoint: String, channels: Vec<(&'static str, Gives)>, mut on: Touchable) -> PadSpec {
    let knows_force = channels.iter().any(|(_, gives)| *gives == Gives::Wrench);
    if on.gives_n_per_m.is_infinite() && !knows_force {
        on.gives_n_per_m = GIVES_N_PER_M;
    }
    let height_mm = (on.across_m * 1e3).min(SIZE_MM.1);
    PadSpec { endpoint, channels, on: Some(on), size_mm: (SIZE_MM.0 / SIZE_MM.1 * height_mm, height_mm) }
}

/// State of a hand on a pad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Touch {
    pub tip_m: Vec3,
    pub velocity_m_s: Vec3,
    /// Outward normal of the surface.
    pub normal: Vec3,
    pub force_n: f64,
    /// Tilt to the right, and towards the person who holds the pen.
    pub tilt_rad: [f64; 2],
}

impl Touch {
    /// The touch of a pointer on the plane of the pad, or `above_m` the surface that the pad lies on,
    /// negative below it.
    pub(crate) fn of(pointer: &Pointer, on: Option<&Touchable>, above_m: f64) -> Self {
        let [x, y] = pointer.position_m;
        let (tip_m, normal) = match on {
            None => ([x, y, 0.0], [0.0, 0.0, 1.0]),
            Some(on) => {
                let point = on.ground.at(right_is_x(&on.ground, [x, y]));
                (add_scaled(point.position_m, point.normal, above_m), point.normal)
            }
        };
        Self {
            tip_m,
            velocity_m_s: [0.0; 3],
            normal,
            force_n: pointer.force_n,
            tilt_rad: pointer.tilt_deg.map(f64::to_radians),
        }
    }

    /// Fills the first components of a frame of a channel.
    pub(crate) fn put(&self, gives: Gives, frame: &mut [f64; 6]) {
        let put = |frame: &mut [f64; 6], numbers: &[f64]| frame[..numbers.len()].copy_from_slice(numbers);
        match gives {
            Gives::Tip => put(frame, &self.tip_m),
            Gives::Velocity => put(frame, &self.velocity_m_s),
            Gives::Force => put(frame, &[self.force_n]),
            Gives::Touching => put(frame, &[f64::from(u8::from(self.force_n > 0.0))]),
            Gives::NoDrag => put(frame, &[0.0; 3]),
            Gives::Orientation => put(frame, &turn(self.tilt_rad)),
            Gives::Wrench => {
                let force_n = scale(self.normal, -self.force_n);
                let ([x, y, z], [a, b, c]) = (force_n, cross(self.tip_m, force_n));
                put(frame, &[x, y, z, a, b, c]);
            }
            Gives::Numbers([low, high]) => {
                let [x, y, _] = self.tip_m.map(|part| part / REACH_M);
                let parts =
                    [x, y, self.tilt_rad[0] / FRAC_PI_2].map(|part| (0.5 * (part + 1.0)).clamp(0.0, 1.0));
                put(frame, &parts.map(|part| (low + part * (high - low)).clamp(low, high)));
            }
        }
    }
}

/// Rotates pad coordinates to those of a stroke: right is the world's x if the surface leaves the direction
/// free.
fn right_is_x(ground: &Ground, [x, y]: [f64; 2]) -> [f64; 2] {
    let (Ground::Plane { normal, .. } | Ground::Sphere { up: normal, .. }) = ground else {
        return [x, y];
    };
    let [[u, ..], [v, ..]] = tangents(direction(*normal).unwrap_or([0.0, 0.0, 1.0]));
    match u.hypot(v) {
        // The surface faces along x: any direction will do.
        none if none < 1e-9 => [x, y],
        long => [(x * u - y * v) / long, (x * v + y * u) / long],
    }
}

/// The smallest rotation from an upright pen to this tilt: axis times angle.
fn turn([right, towards]: [f64; 2]) -> Vec3 {
    // Direction of the pen's upper end; y points away from the person who holds it.
    let (x, y) = (right.tan(), -towards.tan());
    let aside = x.hypot(y);
    if aside == 0.0 {
        return [0.0; 3];
    }
    let angle = aside.atan();
    [-y / aside * angle, x / aside * angle, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_nodes::simulated::ground::Ground;

    fn pointer(x: f64, y: f64, force_n: f64) -> Pointer {
        Pointer { at_s: 0.0, position_m: [x, y], force_n, tilt_deg: [0.0; 2] }
    }

    fn filled(touch: &Touch, gives: Gives) -> Vec<f64> {
        let mut frame = [f64::NAN; 6];
        touch.put(gives, &mut frame);
        frame.into_iter().take_while(|x| !x.is_nan()).collect()
    }

    #[test]
    fn a_tablet_gives_the_plane_and_a_laid_pad_what_lies_under_it() {
        let flat = Touch::of(&pointer(0.01, -0.02, 1.5), None, 0.0);
        assert_eq!(filled(&flat, Gives::Tip), [0.01, -0.02, 0.0]);
        assert_eq!((filled(&flat, Gives::Force), filled(&flat, Gives::Touching)), (vec![1.5], vec![1.0]));
        let ball = Touchable {
            ground: Ground::Sphere { centre_m: [0.0; 3], radius_m: 0.05, up: [0.0, 0.0, 1.0] },
            gives_n_per_m: 250.0,
            across_m: 0.1,
            scene: Vec::new(),
            tool_diameter_m: 0.0,
        };
        let below = Touch::of(&pointer(0.05, 0.0, 1.0), Some(&ball), -0.004);
        let radius_m = below.tip_m.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(
            (radius_m - 0.046).abs() < 1e-12 && (below.tip_m[0] - below.tip_m[2]).abs() < 1e-12,
            "{below:?}"
        );
    }

    #[test]
    fn a_press_beside_the_sensor_turns_it() {
        let table = Touchable {
            ground: Ground::TABLE,
            gives_n_per_m: f64::INFINITY,
            across_m: f64::INFINITY,
            scene: Vec::new(),
            tool_diameter_m: 0.0,
        };
        let touch = Touch::of(&pointer(0.02, 0.0, 2.0), Some(&table), 0.0);
        let wrench = filled(&touch, Gives::Wrench);
        // 2 N down, 20 mm to the right of the origin: a torque about y.
        assert_eq!(wrench[..3], [-0.0, -0.0, -2.0]);
        assert!((wrench[4] - 0.04).abs() < 1e-15 && wrench[3].abs() + wrench[5].abs() < 1e-15, "{wrench:?}");
    }

    #[test]
    fn a_tilted_pen_is_turned_about_an_axis_in_the_plane() {
        let turned = |right: f64, towards: f64| turn([right, towards].map(f64::to_radians));
        assert_eq!(turned(0.0, 0.0), [0.0; 3]);
        // Upper end to the right: about y. Towards the hand, down on the pad: about x.
        let [right, towards] = [turned(30.0, 0.0), turned(0.0, 30.0)];
        assert!((right[1] - 30_f64.to_radians()).abs() < 1e-12 && right[0].abs() < 1e-12, "{right:?}");
        assert!((towards[0] - 30_f64.to_radians()).abs() < 1e-12 && towards[1].abs() < 1e-12, "{towards:?}");
    }
}
