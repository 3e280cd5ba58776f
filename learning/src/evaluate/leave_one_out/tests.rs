use super::*;
use crate::learn::spectral_law::POWER_SLOPES;
use haptograph_surfaces::ArmaModel;
use toolkit::{AT_10_KHZ, hatt_files};

#[path = "../../../../tests/skip/hatt.rs"]
mod toolkit;

/// A texture with `speeds` speeds by three forces, power speed^a force^b, and a resonance that moves with
/// speed by `glide`.
fn texture(speeds: usize, a: f64, b: f64, glide: f64) -> TextureModel {
    let places = (0..speeds * 3).map(|k| {
        let speed_m_s = 0.03 * 1.4_f64.powi((k / 3) as i32);
        // No two points share a line.
        (speed_m_s * (1.0 + 0.03 * (k % 3) as f64), 0.5 * 2.0_f64.powi((k % 3) as i32))
    });
    let model = |(speed_m_s, force_n): (f64, f64)| {
        let angle = 0.1 * (1.0 + glide * (speed_m_s / 0.03).ln());
        let power = 500.0 * speed_m_s.powf(a) * force_n.powf(b);
        let model = ArmaModel::from_ar(&[-1.8 * angle.cos(), 0.81], 1.0).expect("stable");
        ModelAt {
            speed_m_s,
            force_n,
            model: model.with_power(power).expect("a power"),
            kind: VertexKind::Measured,
        }
    };
    TextureModel::from_measured(10_000.0, places.map(model).collect(), &Hull::default()).expect("a map")
}

fn of(found: &LeaveOneOut, map: MapKind) -> Summary {
    Summary::of(&found.left_out, map, |_| true).expect("predictions")
}

#[test]
fn a_texture_that_follows_a_law_is_predicted_by_the_law_and_not_by_its_neighbours() {
    let texture = texture(7, 2.0, 0.5, 0.02);
    let found = leave_one_out(&[&texture], &|_| ()).expect("predictions");
    assert_eq!(found.left_out.len(), 21 * MapKind::ALL.len());
    let [triangulation, nearest, law, whole] = MapKind::ALL.map(|map| of(&found, map));
    assert_eq!((law.models, law.textures, law.lsd_db.error), (21, 1, None));
    assert!(whole.lsd_db.mean < 0.5 && whole.beyond_of_models == 0.0, "{whole:?}");
    assert!(nearest.lsd_db.mean > 2.0 && triangulation.lsd_db.mean > whole.lsd_db.mean);
    // The lightest force is always known, so that nothing fades, and the grid is fine.
    assert!((law.lsd_db.mean - whole.lsd_db.mean).abs() < 0.1, "{law:?} {whole:?}");
    let far = |map| {
        let far = Summary::of(&found.far, map, |_| true).expect("far ones");
        far.lsd_db.mean
    };
    let (law, nearest) = (far(MapKind::Law), far(MapKind::Nearest));
    assert!(law < 0.3 * nearest, "{law} {nearest}");
}

#[test]
fn left_out_models_do_not_help_to_predict_themselves() {
    let plain = texture(5, 2.0, 0.5, 0.0);
    let models = plain.models().iter().map(|at| {
        let mut at = at.clone();
        if at.kind == VertexKind::Measured && at.force_n == 1.0 && (at.speed_m_s / 0.0588 - 1.0).abs() < 0.05
        {
            at.model = at.model.clone().with_power(1e4 * at.model.power()).expect("a power");
        }
        at
    });
    let changed = TextureModel::new(10_000.0, models.collect(), plain.triangles().to_vec()).expect("a map");
    let power = |texture: &TextureModel, map| {
        let found = leave_one_out(&[texture], &|_| ()).expect("predictions");
        let vertex = (0..15).max_by(|a, b| {
            let power = |k: &usize| changed.models()[*k].model.power();
            power(a).total_cmp(&power(b))
        });
        let one = found.left_out.iter().find(|one| Some(one.vertex) == vertex && one.map == map);
        one.expect("its prediction").power_db
    };
    for map in MapKind::ALL {
        let off = power(&plain, map) - power(&changed, map);
        assert!((off - 40.0).abs() < 1e-9, "{map:?}: {off}");
    }
}

#[test]
fn places_between_models_are_inside_and_those_beyond_outside() {
    let texture = texture(4, 2.0, 0.5, 0.0);
    let found = leave_one_out(&[&texture], &|_| ()).expect("predictions");
    let inside: Vec<usize> = found
        .left_out
        .iter()
        .filter(|one| one.map == MapKind::Nearest && one.inside)
        .map(|one| one.vertex)
        .collect();
    // Only the models of the middle force that are neither the slowest nor the fastest.
    assert!(inside.contains(&4) && inside.contains(&7), "{inside:?}");
    assert!(![0, 2, 9, 11].iter().any(|corner| inside.contains(corner)), "{inside:?}");
}

#[test]
fn exponents_are_those_of_the_textures_and_a_texture_has_no_part_in_its_own_prior() {
    let mut textures: Vec<TextureModel> = (0..6).map(|_| texture(4, 1.2, 0.9, 0.0)).collect();
    textures.push(texture(4, 3.0, 0.1, 0.0));
    let moments: Vec<_> = textures
        .iter()
        .map(|texture| exponents::Moments::of(&Subject::new(0, texture).expect("models").seen))
        .collect();
    let close = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close(exponents::without(&moments, 6), [1.2, 0.9]));
    let all = PowerExponents::of(&moments).expect("exponents");
    let wanted = [(6.0 * 1.2 + 3.0) / 7.0, (6.0 * 0.9 + 0.1) / 7.0];
    assert!(close(all.mean, wanted) && close(all.pooled, wanted) && all.textures == 7);
    assert!((all.deviation[0] - 0.680_336).abs() < 1e-5, "{all:?}");
    assert_eq!(exponents::without(&moments[..3], 0), POWER_SLOPES);
}

#[test]
fn textures_without_measured_models_are_refused() {
    let plain = texture(4, 2.0, 0.5, 0.0);
    let models = plain.models().iter().map(|at| ModelAt { kind: VertexKind::Edge, ..at.clone() });
    let fitted = TextureModel::new(10_000.0, models.collect(), plain.triangles().to_vec()).expect("a map");
    assert_eq!(leave_one_out(&[&fitted], &|_| ()), Err(LeaveOneOutError::NoModels { textures: 1 }));
}

#[test]
fn on_the_toolkits_models_the_law_predicts_best() {
    let files = hatt_files(AT_10_KHZ);
    if files.is_empty() {
        return;
    }
    let surfaces: Vec<_> =
        files.iter().map(|file| haptograph_surfaces::files::load(file).expect("a surface")).collect();
    let textures: Vec<_> = surfaces.iter().filter_map(|surface| surface.texture.as_ref()).collect();
    let found = leave_one_out(&textures, &|_| ()).expect("predictions");
    let far = |map| Summary::of(&found.far, map, |_| true).expect("far ones");
    let law = of(&found, MapKind::Law);
    assert!(law.lsd_db.mean <= 2.9 && law.beyond_of_models <= 0.05, "{law:?}");
    assert!(far(MapKind::Law).lsd_db.mean <= 4.5, "{:?}", far(MapKind::Law));
    assert!(far(MapKind::Law).lsd_db.mean < far(MapKind::Nearest).lsd_db.mean);
}
