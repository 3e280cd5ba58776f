//! Convex objects on a force/torque sensor, as settings. The node that locates contacts and the simulated
//! object share them.

use super::mesh::TriangleMesh;
use super::nodes::load_mesh;
use haptograph_engine::node::BuildError;
use haptograph_signal::units::Millimetres;
use std::path::PathBuf;
use std::sync::Arc;

haptograph_engine::choices! {
    /// A convex object.
    pub(crate) enum Object {
        /// A cube.
        Cube(CubeSettings),
        /// A cylinder standing on its base.
        Cylinder(CylinderSettings),
        /// A ball.
        Ball(BallSettings),
        /// Any convex mesh.
        Solid(SolidSettings),
    }
}

haptograph_engine::settings! {
    /// A cube.
    pub struct CubeSettings {
        /// Length of its edges, mm.
        edge_mm: Millimetres = Millimetres(25.4), in 0.1..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// A cylinder.
    pub struct CylinderSettings {
        /// Diameter, mm.
        diameter_mm: Millimetres = Millimetres(25.4), in 0.1..=10_000.0;
        /// Height, mm.
        height_mm: Millimetres = Millimetres(25.4), in 0.1..=10_000.0;
        /// Number of flat strips of its mantle.
        strips: u32 = 96, in 3..=1000;
    }
}

haptograph_engine::settings! {
    /// A ball.
    pub struct BallSettings {
        /// Diameter, mm.
        diameter_mm: Millimetres = Millimetres(25.4), in 0.1..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// A convex mesh.
    pub struct SolidSettings {
        /// STL or OBJ file, relative to the graph file.
        file: PathBuf;
        /// Millimetres of one unit of the file.
        unit_mm: Millimetres = Millimetres(1.0), in 1e-9..=1e9;
    }
}

/// Splits of the icosahedron that approximates a ball: 20 480 triangles, 0.01 mm from a ball of 25 mm.
const BALL_SPLITS: u32 = 5;

/// The object as it stands on the sensor: its lowest point at a height over the sensor's origin, m.
///
/// # Errors
/// [`BuildError`] if its mesh cannot be read or made.
pub(crate) fn on_sensor(object: &Object, height_m: f64) -> Result<Arc<TriangleMesh>, BuildError> {
    let made = match object {
        Object::Cube(cube) => TriangleMesh::cuboid([cube.edge_mm.si(); 3]),
        Object::Cylinder(cylinder) => {
            let (radius_m, height_m) = (0.5 * cylinder.diameter_mm.si(), cylinder.height_mm.si());
            TriangleMesh::cylinder(radius_m, height_m, cylinder.strips)
        }
        Object::Ball(ball) => TriangleMesh::sphere(0.5 * ball.diameter_mm.si(), BALL_SPLITS),
        Object::Solid(solid) => Ok(load_mesh(&solid.file, solid.unit_mm)
            .map_err(|error| BuildError { field: Some("object"), ..error })?),
    };
    let failed = |error: super::mesh::MeshError| BuildError::at("object", error.to_string());
    let mesh = made.map_err(failed)?;
    let lowest_m = mesh.vertices().iter().map(|v| v[2]).fold(f64::INFINITY, f64::min);
    Ok(Arc::new(mesh.moved([0.0, 0.0, height_m - lowest_m]).map_err(failed)?))
}
