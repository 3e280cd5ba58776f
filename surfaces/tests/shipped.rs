//! The surfaces that ship with haptograph.

#[path = "../examples/procedural_surface.rs"]
mod procedural_surface;

use haptograph_surfaces::{Origin, TextureModel, files};
use std::path::Path;

#[test]
fn the_modest_surface_is_what_its_script_makes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/modest.ron");
    let shipped = files::load(&path).unwrap();
    let made = procedural_surface::modest().unwrap();
    assert_eq!(shipped.provenance.origin, Origin::Procedural);
    assert_eq!(
        (shipped.friction, shipped.stiffness),
        (made.friction, made.stiffness)
    );
    // Sines and exponentials are the system's: the same to 1e-9 on every machine.
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1.0);
    let (shipped_taps, made_taps) = (shipped.taps.unwrap(), made.taps.unwrap());
    for (a, b) in shipped_taps.taps().iter().zip(made_taps.taps()) {
        assert!(
            a.acceleration_m_s2
                .iter()
                .zip(&b.acceleration_m_s2)
                .all(|(a, b)| close(*a, *b))
        );
    }
    let (shipped, made): (TextureModel, TextureModel) = (shipped.texture.unwrap(), made.texture.unwrap());
    assert_eq!(shipped.triangles(), made.triangles());
    for (a, b) in shipped.models().iter().zip(made.models()) {
        assert_eq!((a.speed_m_s, a.force_n, a.kind), (b.speed_m_s, b.force_n, b.kind));
        assert!(close(a.model.variance(), b.model.variance()));
        assert!(
            a.model
                .ar_lsf()
                .iter()
                .zip(b.model.ar_lsf())
                .all(|(a, b)| close(*a, *b))
        );
    }
}
