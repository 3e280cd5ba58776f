//! Nodes that locate the contact of a tool with an object on a force/torque sensor, and compute how fast it
//! slides.

use super::Contact;
use super::object::{CubeSettings, Object, on_sensor};
use super::wrench::{LEASH, SurfacePath, WrenchContact, WrenchLocator, WrenchSettings};
use crate::filters::design_error;
use crate::sensing::speed::SpeedFilter;
use crate::simulated::force_sensor::ForceSensorSettings;
use crate::vector::{cross, norm};
use haptograph_engine::frame::{Record, Scalar, Vector, Wrench};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, LiveId, NodeKind, Optional, OutputRole, Port, Processor,
    Tick,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Millimetres, NewtonMillimetres};

haptograph_engine::settings! {
    /// Settings of [`ContactFromWrench`].
    pub struct ContactFromWrenchSettings {
        /// The convex object: Cube, Cylinder, Ball, or the Solid of a file.
        object: Object = Object::Cube(CubeSettings { edge_mm: Millimetres(25.4) });
        /// Height of its lowest point over the sensor's origin, mm.
        height_mm: Millimetres = Millimetres(8.0), in -1000.0..=1000.0;
        /// Force at which contact begins, N.
        [live] threshold_n: f64 = WrenchSettings::default().threshold_n, in 1e-6..=1000.0;
        /// Resolution of the measured force, N, for the uncertainty.
        [live] force_step_n: f64 = WrenchSettings::default().force_step_n, in 0.0..=1000.0;
        /// Resolution of the measured torque, N mm, for the uncertainty.
        [live] torque_step_n_mm: NewtonMillimetres = NewtonMillimetres::of_si(WrenchSettings::default().torque_step_n_m), in 0.0..=1e6;
        /// The sensor's range of torque about each axis, N mm.
        [live] most_torque_n_mm: NewtonMillimetres = NewtonMillimetres::of_si(ForceSensorSettings::default().most_torque_n_m), in 1e-6..=1e6;
        /// The hardest press that is expected, N. The check warns of an object on which it would exceed the range of torque.
        press_n: f64 = 5.0, in 0.0..=1000.0;
    }
}

haptograph_engine::node! {
    /// Locates the contact of a tool with an object on a force/torque sensor: the line of action of the force meets the
    /// object's surface at the contact. The object has to be convex; a concave one is an error that names the edge that
    /// makes it concave. Any tool works. A tick visits at most 4096 boxes of the object's hierarchy and twice its
    /// triangles, whatever the wrench.
    pub struct ContactFromWrench(ContactFromWrenchSettings) in "contact";
    source: "5.2, Eq. 5.2.1 to 5.2.4";
    example: r#""touch": ContactFromWrench(wrench: "sensor.wrench", object: Cube(edge_mm: 25.4), height_mm: 8.0)"#;
    in WRENCH: Wrench = Port::of(Quantity::FORCE, "Wrench on the object in the sensor's frame, N and N m.");
    out CONTACT: Contact =
        Port::of(Quantity::NUMBER, "Point, outward normal and face; there is no penetration.");
    out LOAD: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out FRICTION: Vector = Port::of(Quantity::FORCE, "Friction on the tool, N.");
    out RESIDUAL: Scalar = Port::of(Quantity::LENGTH, "|F . M| / |F|^2, m: zero for contact in one point.");
    out UNCERTAINTY: Scalar =
        Port::of(Quantity::LENGTH, "Uncertainty of the line of action, across it, m (Eq. 5.2.4).");
    out MISS: Scalar =
        Port::of(Quantity::LENGTH, "Distance by which the line of action misses the object, m.");
    out POINT_UNCERTAINTY: Scalar =
        Port::of(Quantity::LENGTH, "Uncertainty of the point, m: Eq. 5.2.4 with the lever from the sensor \
                                    to the point, as the direction of the force is uncertain too.");
    out SATURATED: Scalar =
        Port::of(Quantity::NUMBER, "1 while a torque is at the end of the sensor's range, where the point is wrong; else 0.").with_role(OutputRole::Shortfall(&["a torque was at the end of the sensor's range"]));
}

impl NodeKind for ContactFromWrench {
    fn build(settings: ContactFromWrenchSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let object = on_sensor(&settings.object, settings.height_mm.si())?;
        let measured = WrenchSettings {
            threshold_n: settings.threshold_n,
            force_step_n: settings.force_step_n,
            torque_step_n_m: settings.torque_step_n_mm.si(),
        };
        let locator = WrenchLocator::new(object, measured).map_err(|error| {
            BuildError::at("object", error.to_string()).help("give a convex object, or its convex hull")
        })?;
        let most_torque_n_m = settings.most_torque_n_mm.si();
        Ok(Built::new(Locating { locator, most_torque_n_m }))
    }

    fn advice(settings: &ContactFromWrenchSettings, _: &BuildContext) -> Vec<BuildError> {
        let Ok(object) = on_sensor(&settings.object, settings.height_mm.si()) else {
            return Vec::new();
        };
        // A convex object's largest torque is at a corner.
        let levers_m = (0..object.triangles().len() as u32)
            .flat_map(|face| object.corners(face).map(|corner| cross(corner, object.normal(face))));
        let lever_m = levers_m.flatten().fold(0.0, |most: f64, lever| most.max(lever.abs()));
        let torque_n_mm = NewtonMillimetres::of_si(settings.press_n * lever_m).0;
        let range_n_mm = settings.most_torque_n_mm.0;
        if torque_n_mm <= range_n_mm * (1.0 + 1e-9) {
            return Vec::new();
        }
        let message = format!(
            "pressed with {} N at its edge, the object makes a torque of {torque_n_mm:.0} N mm; the sensor's range is {range_n_mm} N mm",
            settings.press_n
        );
        vec![BuildError::at("object", message).help(
            "take a smaller object, or state `most_torque_n_mm` of your sensor or the `press_n` that is expected",
        )]
    }
}

#[derive(Debug, Clone)]
struct Locating {
    locator: WrenchLocator,
    most_torque_n_m: f64,
}

impl Processor<ContactFromWrench> for Locating {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ContactFromWrench>) {
        let wrenches = io.read(ContactFromWrench::WRENCH);
        // Behind the sensor's filter, a reading at the end of its range shakes by less than a step.
        let step_n_m = self.locator.settings_mut().torque_step_n_m;
        let end_n_m = (self.most_torque_n_m - step_n_m).max(0.5 * self.most_torque_n_m);
        let (contacts, load, friction, residual, uncertainty, miss, point_uncertainty, saturated) = io
            .write_all((
                ContactFromWrench::CONTACT,
                ContactFromWrench::LOAD,
                ContactFromWrench::FRICTION,
                ContactFromWrench::RESIDUAL,
                ContactFromWrench::UNCERTAINTY,
                ContactFromWrench::MISS,
                ContactFromWrench::POINT_UNCERTAINTY,
                ContactFromWrench::SATURATED,
            ));
        for (frame, [fx, fy, fz, tx, ty, tz]) in wrenches.iter().enumerate() {
            let at = self.locator.update([*fx, *fy, *fz], [*tx, *ty, *tz]);
            contacts[frame] = Contact {
                touching: at.touching,
                hip_m: at.position_m,
                ihip_m: at.position_m,
                normal: if at.touching { at.normal } else { [0.0; 3] },
                penetration_m: 0.0,
                face: at.face,
            }
            .to_components();
            load[frame] = at.normal_force_n;
            friction[frame] = at.friction_n;
            residual[frame] = at.residual_m;
            uncertainty[frame] = at.uncertainty_m;
            miss[frame] = at.miss_m;
            point_uncertainty[frame] = at.point_uncertainty_m;
            let is_at_end = [tx, ty, tz].iter().any(|torque_n_m| torque_n_m.abs() >= end_n_m);
            saturated[frame] = f64::from(u8::from(is_at_end));
        }
    }

    fn set(&mut self, setting: LiveId<ContactFromWrenchSettings>, value: f64) {
        let measured = self.locator.settings_mut();
        match setting {
            ContactFromWrenchSettings::threshold_n => measured.threshold_n = value,
            ContactFromWrenchSettings::force_step_n => measured.force_step_n = value,
            ContactFromWrenchSettings::torque_step_n_mm => measured.torque_step_n_m = value,
            ContactFromWrenchSettings::most_torque_n_mm => self.most_torque_n_m = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.locator.copy_state_from(&self.locator);
    }
}

haptograph_engine::settings! {
    /// Settings of [`SurfaceSpeed`].
    pub struct SurfaceSpeedSettings {
        /// Cut-off of the second-order low-pass.
        [live, below_nyquist] cutoff_hz: f64 = 20.0, in 1e-3..=1e6;
        /// Jitter of the point that does not count as motion, in uncertainties.
        [live] leash: f64 = LEASH, in 0.0..=1000.0;
    }
}

haptograph_engine::node! {
    /// The speed of a point of contact along a surface, over its edges: two points on faces that meet at an angle are as
    /// far apart as when the faces are laid flat. Jitter within the point's uncertainty does not count as motion.
    pub struct SurfaceSpeed(SurfaceSpeedSettings) in "sensing";
    source: "5.2.3";
    example: r#""speed": SurfaceSpeed(contact: "touch.contact", uncertainty: "touch.point_uncertainty")"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    in UNCERTAINTY: Scalar, Optional = Port::of(Quantity::LENGTH, "Uncertainty of the point, m.");
    out SPEED: Scalar = Port::of(Quantity::SPEED, "Speed along the surface, m/s; zero in free space.");
    out ALONG: Vector = Port::of(Quantity::SPEED, "Velocity in the tangent plane, m/s; zero in free space.");
    out WAY: Scalar = Port::of(Quantity::LENGTH, "Length of the path so far, m.");
}

impl NodeKind for SurfaceSpeed {
    fn build(settings: SurfaceSpeedSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let filter = SpeedFilter::Butterworth { order: 2, cutoff_hz: settings.cutoff_hz };
        let path =
            SurfacePath::new(filter, settings.leash, cx.rate.hz()).map_err(design_error("cutoff_hz"))?;
        Ok(Built::new(Following { path }))
    }
}

#[derive(Debug, Clone)]
struct Following {
    path: SurfacePath,
}

impl Processor<SurfaceSpeed> for Following {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SurfaceSpeed>) {
        let (contacts, uncertainties) =
            (io.decode(SurfaceSpeed::CONTACT), io.read(SurfaceSpeed::UNCERTAINTY));
        let (speed, along, way) = io.write_all((SurfaceSpeed::SPEED, SurfaceSpeed::ALONG, SurfaceSpeed::WAY));
        for (frame, contact) in contacts.enumerate() {
            let point_uncertainty_m =
                uncertainties.map_or(0.0, |uncertainties| uncertainties[frame].max(0.0));
            let sound =
                contact.ihip_m.iter().all(|x| x.is_finite()) && (norm(contact.normal) - 1.0).abs() < 1e-6;
            let at = WrenchContact {
                touching: contact.touching && sound && point_uncertainty_m.is_finite(),
                position_m: contact.ihip_m,
                normal: contact.normal,
                face: contact.face,
                normal_force_n: 0.0,
                friction_n: [0.0; 3],
                residual_m: 0.0,
                uncertainty_m: point_uncertainty_m,
                point_uncertainty_m,
                miss_m: 0.0,
            };
            along[frame] = self.path.update(&at);
            speed[frame] = norm(along[frame]);
            way[frame] = self.path.way_m();
        }
    }

    fn set(&mut self, setting: LiveId<SurfaceSpeedSettings>, value: f64) {
        match setting {
            SurfaceSpeedSettings::cutoff_hz => self.path.turn(value),
            SurfaceSpeedSettings::leash => self.path.set_leash(value),
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.path.copy_state_from(&self.path);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.path.delay_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::cross;
    use haptograph_engine::frame::{Kind, OneKind};
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_press_on_the_cube_is_found_where_it_is() {
        let settings = ContactFromWrenchSettings {
            object: Object::Cube(CubeSettings { edge_mm: Millimetres(25.4) }),
            height_mm: Millimetres(8.0),
            threshold_n: 0.08,
            force_step_n: 1.0 / 160.0,
            torque_step_n_mm: NewtonMillimetres(1.0 / 32.0),
            most_torque_n_mm: NewtonMillimetres(10.0),
            press_n: 5.0,
        };
        let mut bench = Bench::new::<ContactFromWrench>(settings, 1000.0, &[Kind::WRENCH]).unwrap();
        let (point, force) = ([0.004, -0.003, 0.0334], [0.2, 0.1, -1.0]);
        let wrench = [force, cross(point, force)].concat();
        let out = bench.run(&[&[wrench, vec![0.0; 6]].concat()]);
        assert_eq!(out[7], [1.0, 0.0], "the torque of 10.7 N mm is beyond the range");
        let contacts: Vec<Contact> = out[0].as_chunks().0.iter().map(Contact::from_components).collect();
        assert!(crate::vector::distance(contacts[0].ihip_m, point) < 1e-9);
        assert_eq!(contacts[0].normal, [0.0, 0.0, 1.0]);
        assert!((out[1][0] - 1.0).abs() < 1e-9, "load");
        assert!((out[2][0] + 0.2).abs() < 1e-9 && (out[2][1] + 0.1).abs() < 1e-9, "friction on the tool");
        assert!(out[3][0] < 1e-9 && out[5][0] < 1e-9);
        // Eq. 5.2.4 by the torque, as printed; and by the whole lever to the point.
        let (force_n, torque_n_m) = (norm(force), norm(cross(point, force)));
        let printed = |torque_n_m: f64| {
            let relative = (1e-3 / 32.0 / torque_n_m).hypot(1.0 / 160.0 / force_n);
            torque_n_m / force_n * relative
        };
        assert!((out[4][0] / printed(torque_n_m) - 1.0).abs() < 1e-9, "{}", out[4][0]);
        assert!((out[6][0] / printed(force_n * norm(point)) - 1.0).abs() < 1e-9);
        assert!(out[6][0] > 2.0 * out[4][0]);
        assert!(!contacts[1].touching && out[1][1] == 0.0);
    }

    #[test]
    fn sliding_over_an_edge_keeps_its_speed() {
        let bench = || {
            let settings = SurfaceSpeedSettings { cutoff_hz: 20.0, leash: 0.0 };
            Bench::new::<SurfaceSpeed>(settings, 1000.0, &[Contact::KIND]).unwrap()
        };
        // Along the top to the edge at x = 0, then down the side, 50 mm/s.
        let contacts: Vec<f64> = (-500..500)
            .flat_map(|k| {
                let way = 5e-5 * f64::from(k);
                let (ihip_m, normal) = if k < 0 {
                    ([way, 0.0, 0.0], [0.0, 0.0, 1.0])
                } else {
                    ([0.0, 0.0, -way], [1.0, 0.0, 0.0])
                };
                Contact { touching: true, ihip_m, normal, ..Contact::default() }.to_components()
            })
            .collect();
        let out = bench().run(&[&contacts]);
        for (k, speed) in out[0].iter().enumerate().skip(200) {
            assert!((speed - 0.05).abs() < 1e-6, "{k}: {speed}");
        }
    }

    #[test]
    fn the_speed_is_as_late_as_the_node_says() {
        let settings = SurfaceSpeedSettings { cutoff_hz: 20.0, leash: LEASH };
        let mut bench = Bench::new::<SurfaceSpeed>(settings, 1000.0, &[Contact::KIND]).unwrap();
        // Ever faster by 0.2 m/s2.
        let contacts: Vec<f64> = (0..600)
            .flat_map(|k| {
                let time_s = 1e-3 * f64::from(k);
                Contact {
                    touching: true,
                    ihip_m: [0.1 * time_s * time_s, 0.0, 0.0],
                    normal: [0.0, 0.0, 1.0],
                    ..Contact::default()
                }
                .to_components()
            })
            .collect();
        let speed_m_s = bench.run(&[&contacts])[0][599];
        let late_s = 0.599 - speed_m_s / 0.2;
        let stated_s = bench.latency().group_delay_s;
        assert!((late_s - stated_s).abs() < 1e-4, "{late_s} s, stated {stated_s} s");
        assert!((stated_s - 0.0117).abs() < 2e-4, "{stated_s}");
    }

    #[test]
    fn a_concave_object_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("open.stl");
        let open = "solid open\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
                    endsolid open\n";
        std::fs::write(&file, open).unwrap();
        let settings = ContactFromWrenchSettings {
            object: Object::Solid(super::super::object::SolidSettings { file, unit_mm: Millimetres(1.0) }),
            height_mm: Millimetres(0.0),
            threshold_n: 0.08,
            force_step_n: 0.01,
            torque_step_n_mm: NewtonMillimetres(0.01),
            most_torque_n_mm: NewtonMillimetres(250.0),
            press_n: 5.0,
        };
        let refused = Bench::new::<ContactFromWrench>(settings, 1000.0, &[Kind::WRENCH]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("object"));
    }
}
