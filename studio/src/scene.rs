//! The plots that a graph names and the shapes that a hand can touch, described for the page.

use super::scope::components;
use haptograph_engine::graph::Graph;
use haptograph_nodes::contact::shape::Shape;
use haptograph_nodes::simulated::touchable::Touchable;
use haptograph_report::plot_request::{Form, PlotRequest, plot_requests};
use serde_json::{Value, json};

/// Maximum number of triangles of a mesh that is described.
const MAX_TRIANGLES: usize = 2000;

/// The plots of a graph, each with its signals.
pub(crate) fn plots(graph: &Graph) -> Vec<Value> {
    plot_requests(graph).iter().map(plot).collect()
}

fn plot(request: &PlotRequest) -> Value {
    let form = match request.form {
        Form::OverTime => "time",
        Form::Against => "xy",
        Form::Path => "path",
    };
    let signals = request.signals.iter().zip(&request.names).map(|(signal, label)| {
        let stream = &signal.stream;
        json!({
            "name": stream.name, "label": label, "kind": stream.kind.to_string(), "quantity": stream.quantity.name(),
            "unit": stream.quantity.unit(), "rate_hz": stream.rate.hz(), "lanes": components(stream.kind),
        })
    });
    json!({ "name": request.title, "form": form, "signals": signals.collect::<Vec<_>>() })
}

/// The shapes that a tool can touch.
pub(crate) fn scene(on: &Touchable) -> Value {
    let shapes: Vec<Value> = on.scene.iter().map(shape).collect();
    json!({ "tool_mm": on.tool_diameter_m * 1e3, "shapes": shapes })
}

fn shape(shape: &Shape) -> Value {
    let mm = |m: &[f64; 3]| m.map(|x| x * 1e3);
    match shape {
        Shape::Plane { origin_m, normal } => {
            json!({ "form": "plane", "origin_mm": mm(origin_m), "normal": normal })
        }
        Shape::Sphere { centre_m, diameter_m } => {
            json!({ "form": "sphere", "centre_mm": mm(centre_m), "diameter_mm": diameter_m * 1e3 })
        }
        Shape::Box { centre_m, size_m } => {
            json!({ "form": "box", "centre_mm": mm(centre_m), "size_mm": mm(size_m) })
        }
        Shape::Room { centre_m, size_m } => {
            json!({ "form": "room", "centre_mm": mm(centre_m), "size_mm": mm(size_m) })
        }
        Shape::Mesh { mesh, .. } => {
            let is_small = mesh.triangles().len() <= MAX_TRIANGLES;
            let points: Vec<_> = mesh.vertices().iter().filter(|_| is_small).map(mm).collect();
            let triangles = if is_small { mesh.triangles() } else { &[] };
            json!({ "form": "mesh", "points_mm": points, "triangles": triangles })
        }
    }
}
