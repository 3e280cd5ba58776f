//! A simulated recording tool (2.2): a rigid tool in a hand, its tip dragged over a height field.
//!
//! The tool hangs by the finger pads on the hand, the hand follows its script. The tip meets the terrain by a Hertzian law with
//! Hunt and Crossley's damping along the terrain's own normal, and by Coulomb friction with a short spring of its own, or by bristles
//! that stick and slip. No filter, no stored vibration: the measured acceleration results from the mechanics.

use super::bristles::Bristles;
use super::hand::Grip;
use super::material::Material;
use super::orientation::{conjugate, rotate, tilted};
use super::script::{Intent, Script, ScriptError, ScriptSettings};
use super::terrain::Terrain;
use super::wobble::Wobble;
use crate::vector::{Vec3, ZERO, add, add_scaled, dot, norm, scale, sub};
use haptograph_signal::noise::stream_seed;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::PI;

/// Ticks per second: the rate of the recording's fast sensors.
pub(crate) const TOOL_RATE_HZ: f64 = 10_000.0;
/// Acceleration of gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.81;
/// Effective mass of the tool at its tip, kg: a tool of about 40 g that turns about the fingers.
const TOOL_KG: f64 = 0.015;
/// Stiffness across a tool over that along it: pads that hold it over 15 mm have a lever of 43 mm against them.
const ACROSS: f64 = (15.0 / 43.0) * (15.0 / 43.0);

/// Distance over which friction builds up, m.
const PRESLIDING_M: f64 = 3e-5;

/// A person holding the tool: hand, finger pads and posture. The numbers are ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ToolGrip {
    /// The hand behind the fingers.
    pub hand: Grip,
    /// Stiffness of the finger pads along the tool, N/m.
    pub pads_n_per_m: f64,
    /// Damping of the finger pads along the tool, N s/m.
    pub pads_n_s_per_m: f64,
    /// Stiffness that holds the tip across the tool, as a part of that along it: the tool turns about the fingers.
    pub stiffness_across: f64,
    /// Damping across the tool, as a fraction of that along it.
    pub damping_across: f64,
    /// Mean tilt of the tool from the surface's normal, rad.
    pub tilt_rad: f64,
    /// Direction of the tilt, rad.
    pub heading_rad: f64,
    /// Standard deviations by which tilt and heading sway, rad.
    pub sway_rad: [f64; 2],
}

impl ToolGrip {
    /// A material-testing machine (3.2.2): upright, and as still as it is stiff.
    pub(crate) const LOAD_FRAME: Self = Self {
        hand: Grip { mass_kg: 0.5, stiffness_n_per_m: 500.0, damping_n_s_per_m: 60.0, tremor_m: 0.0 },
        pads_n_per_m: 20_000.0,
        pads_n_s_per_m: 40.0,
        stiffness_across: 1.0,
        damping_across: 1.0,
        tilt_rad: 0.0,
        heading_rad: 0.0,
        sway_rad: [0.0; 2],
    };

    /// The grip of a person; the seed is the person.
    pub(crate) fn of_person(seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream_seed(seed, "grip"));
        Self {
            hand: Grip { mass_kg: 0.12, ..Grip::of_person(seed) },
            pads_n_per_m: 2500.0 * rng.random_range(0.7..1.4),
            pads_n_s_per_m: 6.0 * rng.random_range(0.7..1.4),
            stiffness_across: ACROSS,
            // The same damping ratio: skin loses by the cycle and not by the speed.
            damping_across: ACROSS.sqrt(),
            tilt_rad: rng.random_range(0.2..0.6),
            heading_rad: rng.random_range(-PI..PI),
            sway_rad: [0.04, 0.1],
        }
    }

    /// Push of the hand for a force of 1 on the surface: when it presses, the hand yields against its own stiffness by
    /// as much as the pads, and compensates for that. `upright` is the cosine of the tool's tilt.
    fn effort(&self, upright: f64) -> f64 {
        let lengthwise = upright * upright;
        let gives_m_per_n = (lengthwise + (1.0 - lengthwise) / self.stiffness_across) / self.pads_n_per_m;
        1.0 + self.hand.stiffness_n_per_m * gives_m_per_n
    }
}

/// True quantities at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ToolReading {
    /// Position of the tip, m.
    pub tip_m: Vec3,
    /// Velocity of the tip, m/s.
    pub velocity_m_s: Vec3,
    /// Rotation from the tool's frame (z up along the tool) to the world: unit quaternion w, x, y, z.
    pub orientation: [f64; 4],
    /// Acceleration less gravity, in the tool's frame, m/s2, as an accelerometer measures it: the mean over the tick.
    pub specific_m_s2: Vec3,
    /// Force of the surface on the tip, in the world, N, the mean over the tick.
    pub force_n: Vec3,
}

/// The tool on a surface. One tick is 1/10 000 s. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedTool {
    terrain: Terrain,
    contact: Contact,
    grip: ToolGrip,
    script: Script,
    tremor: [Wobble; 3],
    posture: [Wobble; 2],
    substeps: u32,
    tick: u64,
    intent: Intent,
    tip: Body,
    hand: Body,
    bristle_m: [f64; 2],
    /// Friction that sticks and slips, in place of Coulomb's.
    sticking: Option<Bristles>,
    reading: ToolReading,
}

#[derive(Debug, Clone, Copy)]
struct Contact {
    hertz_n_per_m32: f64,
    damping_s_per_m: f64,
    friction: f64,
}

#[derive(Debug, Clone, Copy)]
struct Body {
    position_m: Vec3,
    velocity_m_s: Vec3,
}

/// Steps of the mechanics per tick; with these the step has no effect on the spectrum.
pub(crate) const SUBSTEPS: u32 = 8;

impl SimulatedTool {
    /// A tool at rest over a piece of a material; the piece and the attempt are by seed. The script's ground should be the plane
    /// z = 0. `substeps` is [`SUBSTEPS`] unless the integration itself is studied.
    pub(crate) fn new(
        material: &Material,
        grip: ToolGrip,
        script: &ScriptSettings,
        substeps: u32,
        seed: u64,
    ) -> Result<Self, ScriptError> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream_seed(seed, "hand"));
        let script = Script::new(script, grip.hand.stiffness_n_per_m, rng.random())?;
        let intent = script.at(0.0);
        let rest = Body { position_m: intent.position_m, velocity_m_s: ZERO };
        let mut tool = Self {
            terrain: Terrain::new(&material.relief, stream_seed(seed, "piece")),
            contact: Contact {
                hertz_n_per_m32: material.hertz_n_per_m32(),
                damping_s_per_m: material.damping_s_per_m,
                friction: material.friction,
            },
            tremor: [(); 3].map(|()| Wobble::new(8.0, 12.0, &mut rng)),
            posture: [(); 2].map(|()| Wobble::new(0.05, 0.5, &mut rng)),
            grip,
            script,
            substeps: substeps.max(1),
            tick: 0,
            intent,
            tip: rest,
            hand: rest,
            bristle_m: [0.0; 2],
            sticking: None,
            reading: ToolReading {
                tip_m: rest.position_m,
                velocity_m_s: ZERO,
                orientation: [1.0, 0.0, 0.0, 0.0],
                specific_m_s2: ZERO,
                force_n: ZERO,
            },
        };
        tool.sense(ZERO, ZERO);
        Ok(tool)
    }

    /// The same tool with friction that sticks and slips.
    pub(crate) fn sticking(self, material: &Material) -> Self {
        Self { sticking: Some(Bristles::new(material)), ..self }
    }

    /// True quantities at this tick.
    pub(crate) fn read(&self) -> ToolReading {
        self.reading
    }

    /// Advances to the next tick.
    pub(crate) fn advance(&mut self) {
        self.tick += 1;
        let last = self.intent;
        let time_s = self.tick as f64 / TOOL_RATE_HZ;
        let next = self.script.at(time_s);
        let tremor = Wobble::at(self.tremor.each_ref(), time_s);
        let next =
            Intent { position_m: add_scaled(next.position_m, tremor, self.grip.hand.tremor_m), ..next };
        self.intent = next;
        let aim_m_s = scale(sub(next.position_m, last.position_m), TOOL_RATE_HZ);
        let before_m_s = self.tip.velocity_m_s;
        let step_s = 1.0 / (TOOL_RATE_HZ * f64::from(self.substeps));
        let along = rotate(self.reading.orientation, [0.0, 0.0, 1.0]);
        let effort = self.grip.effort(dot(along, next.normal));
        let mut sum_n = ZERO;
        for substep in 0..self.substeps {
            let share = (f64::from(substep) + 0.5) / f64::from(self.substeps);
            let aim_m = add_scaled(last.position_m, sub(next.position_m, last.position_m), share);
            let force_n = last.force_n + share * (next.force_n - last.force_n);
            let press_n = scale(next.normal, -effort * force_n);
            sum_n = add(sum_n, self.step(aim_m, aim_m_s, press_n, along, step_s));
        }
        let acceleration = scale(sub(self.tip.velocity_m_s, before_m_s), TOOL_RATE_HZ);
        self.sense(acceleration, scale(sum_n, 1.0 / f64::from(self.substeps)));
    }

    /// One step of the mechanics (symplectic Euler) of a tool that points `along`; the force of the surface on the tip, N.
    fn step(&mut self, aim_m: Vec3, aim_m_s: Vec3, press_n: Vec3, along: Vec3, step_s: f64) -> Vec3 {
        let (hand, tip, grip) = (self.hand, self.tip, &self.grip);
        let arm_n = add_scaled(
            scale(sub(aim_m, hand.position_m), grip.hand.stiffness_n_per_m),
            sub(aim_m_s, hand.velocity_m_s),
            grip.hand.damping_n_s_per_m,
        );
        let stretch_m = sub(hand.position_m, tip.position_m);
        let stretch_m_s = sub(hand.velocity_m_s, tip.velocity_m_s);
        let pads_n = add_scaled(
            scale(less_across(stretch_m, along, grip.stiffness_across), grip.pads_n_per_m),
            less_across(stretch_m_s, along, grip.damping_across),
            grip.pads_n_s_per_m,
        );
        let surface_n = self.surface(step_s);
        let on_hand_n = add(sub(arm_n, pads_n), press_n);
        push(&mut self.hand, on_hand_n, self.grip.hand.mass_kg, step_s);
        push(&mut self.tip, add(pads_n, surface_n), TOOL_KG, step_s);
        surface_n
    }

    /// Force of the terrain on the tip, N.
    fn surface(&mut self, step_s: f64) -> Vec3 {
        let [x, y, z] = self.tip.position_m;
        let [u, v, w] = self.tip.velocity_m_s;
        // Above the highest point there is no need to look.
        let over = (z <= self.terrain.highest_m).then(|| self.terrain.at(x, y));
        let Some(spot) = over.filter(|spot| spot.height_m > z) else {
            self.bristle_m = [0.0; 2];
            self.sticking.iter_mut().for_each(Bristles::lift);
            return ZERO;
        };
        let depth_m = spot.height_m - z;
        let [p, q] = spot.slope;
        let closing_m_s = p * u + q * v - w;
        let elastic_n = self.contact.hertz_n_per_m32 * depth_m * depth_m.sqrt();
        let normal_n = (elastic_n * (1.0 + self.contact.damping_s_per_m * closing_m_s)).max(0.0);
        let upright = normal_n / (1.0 + p * p + q * q).sqrt();
        if let Some(bristles) = &mut self.sticking {
            let [along, across] = bristles.step([u, v], step_s);
            return [normal_n * along - p * upright, normal_n * across - q * upright, upright];
        }
        // Friction of the spring that the tip drags along, at most its longest.
        let dragged = [self.bristle_m[0] + u * step_s, self.bristle_m[1] + v * step_s];
        let length_m = norm(dragged);
        let cut = if length_m > PRESLIDING_M { PRESLIDING_M / length_m } else { 1.0 };
        self.bristle_m = dragged.map(|b| b * cut);
        let grip = -self.contact.friction * normal_n / PRESLIDING_M;
        [grip * self.bristle_m[0] - p * upright, grip * self.bristle_m[1] - q * upright, upright]
    }

    fn sense(&mut self, acceleration_m_s2: Vec3, force_n: Vec3) {
        let time_s = self.tick as f64 / TOOL_RATE_HZ;
        let [tilt, turn] = Wobble::at(self.posture.each_ref(), time_s);
        let tilt_rad = self.grip.tilt_rad + self.grip.sway_rad[0] * tilt;
        let heading_rad = self.grip.heading_rad + self.grip.sway_rad[1] * turn;
        let orientation = tilted(tilt_rad, heading_rad);
        let felt = add(acceleration_m_s2, [0.0, 0.0, GRAVITY_M_S2]);
        self.reading = ToolReading {
            tip_m: self.tip.position_m,
            velocity_m_s: self.tip.velocity_m_s,
            orientation,
            specific_m_s2: rotate(conjugate(orientation), felt),
            force_n,
        };
    }
}

/// A vector of which only a part is left across a direction.
fn less_across(v: Vec3, along: Vec3, part: f64) -> Vec3 {
    add_scaled(scale(v, part), along, (1.0 - part) * dot(v, along))
}

fn push(body: &mut Body, force_n: Vec3, mass_kg: f64, step_s: f64) {
    body.velocity_m_s = add_scaled(body.velocity_m_s, force_n, step_s / mass_kg);
    body.position_m = add_scaled(body.position_m, body.velocity_m_s, step_s);
}

#[cfg(test)]
mod tests;
