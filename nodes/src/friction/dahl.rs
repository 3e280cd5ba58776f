//! Stick-slip friction after Dahl (4.3.1): tool and surface are joined by a spring in the tangent plane that stretches
//! while they stick, up to a largest stretch proportional to the coefficient of friction, and slips beyond it.
//!
//! The law of Eq. 4.3.1 is used as the recursion of the stretch z = x - w (x: proxy, w: adhesion point): z grows by the
//! tangential motion and is cut back to its largest length. On a plane this is the adhesion point's own recursion with the
//! sign taken from x_k - w_k-1 (the printed x_k - x_k-1 jumps when the tool stops). On curved and meshed surfaces the
//! stretch is turned with the normal, so that its length, and with it the force, does not jump at an edge.
//!
//! Because the largest stretch is 4 mm times mu, the spring's stiffness is F_n / 4 mm whatever mu is: it changes with the
//! load, and a spring that stiffens while it is stretched has been given energy. Stretched at 0.3 N and released at 2.75 N
//! the thesis's law gives back nine times the work that was put in, enough to push the hand. [`UnderLoad::Passive`] keeps
//! accounts: what the spring loses when the load falls is its credit, what it gains when the load grows must be covered by
//! credit, else the stretch is shortened until it is. A trembling load changes nothing then, and while the tool slides the
//! stretch refills within millimetres and both laws are the same. It is the default, because a law that can only take
//! energy cannot drive a hand or a servo loop into oscillation whatever the user does, and costs nothing while sliding.

use crate::contact::Contact;
use crate::vector::{Vec3, ZERO, add, add_scaled, cross, dot, norm, reject, scale, sub};

/// Effect of a growing load on the stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum UnderLoad {
    /// The stretch shrinks until the spring's energy is covered: no motion gains energy.
    #[default]
    Passive,
    /// The stretch does not change, and the spring's energy grows with the load: Eq. 4.3.2 as printed.
    AsPrinted,
}

/// Settings of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DahlSettings {
    /// Largest stretch for a coefficient of friction of 1, m.
    pub stretch_m: f64,
    /// Effect of a growing load on the stretch.
    pub under_load: UnderLoad,
}

impl Default for DahlSettings {
    /// z_max = 4 mm mu, passive.
    fn default() -> Self {
        Self { stretch_m: 0.004, under_load: UnderLoad::Passive }
    }
}

/// The friction of one tool. Never allocates.
#[derive(Debug, Clone)]
pub(crate) struct Dahl {
    settings: DahlSettings,
    /// The touch so far; none in free space.
    held: Option<Held>,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    proxy_m: Vec3,
    normal: Vec3,
    load_n: f64,
    stretch_m: Vec3,
    /// Energy lost to falling loads and not yet taken back, J.
    credit_j: f64,
}

impl Dahl {
    /// Friction before the first touch.
    pub(crate) fn new(settings: DahlSettings) -> Self {
        Self { settings, held: None }
    }

    /// Takes over the state of another friction.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.held = other.held;
    }

    /// Advances one tick: the friction on the tool, N, at a normal force and a coefficient of friction. A contact without a finite
    /// proxy, force or coefficient has none.
    pub(crate) fn update(&mut self, contact: &Contact, load_n: f64, mu: f64) -> Vec3 {
        let usable = contact.touching
            && contact.ihip_m.iter().chain(&contact.normal).all(|x| x.is_finite())
            && load_n.is_finite()
            && mu.is_finite();
        if !usable {
            self.held = None;
            return ZERO;
        }
        let (load_n, mu) = (load_n.max(0.0), mu.max(0.0));
        let (proxy_m, normal) = (contact.ihip_m, contact.normal);
        let (carried, credit_j) = self.held.map_or((ZERO, 0.0), |held| {
            let (kept, credit_j) = self.reload(&held, load_n);
            let turned = scale(turn(held.stretch_m, held.normal, normal), kept);
            (add(turned, reject(sub(proxy_m, held.proxy_m), normal)), credit_j)
        });
        // w = x - z_max d / |d| where |d| > z_max. Eq. 4.3.1
        let most_m = self.settings.stretch_m * mu;
        let length_m = norm(carried);
        let stretch_m = if length_m > most_m { scale(carried, most_m / length_m) } else { carried };
        self.held = Some(Held { proxy_m, normal, load_n, stretch_m, credit_j });
        // F = -mu F_n z / z_max. Eq. 4.3.2
        scale(stretch_m, -load_n / self.settings.stretch_m)
    }

    /// The factor on the stretch, and the credit left, when the load changes.
    fn reload(&self, held: &Held, load_n: f64) -> (f64, f64) {
        // The spring's energy is F_n z^2 / (2 stretch).
        let per_load = dot(held.stretch_m, held.stretch_m) / (2.0 * self.settings.stretch_m);
        let (before_j, now_j) = (held.load_n * per_load, load_n * per_load);
        let covered_j = before_j + held.credit_j;
        match self.settings.under_load {
            UnderLoad::Passive if now_j > covered_j => ((covered_j / now_j).sqrt(), 0.0),
            UnderLoad::Passive => (1.0, covered_j - now_j),
            UnderLoad::AsPrinted => (1.0, 0.0),
        }
    }
}

/// A tangent vector carried along when the normal turns: rotated by the smallest rotation from one normal to the other,
/// its length kept.
fn turn(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let cos = dot(from, to);
    let length = norm(v);
    let turned = if cos > -0.999 {
        let axis = cross(from, to);
        let across = cross(axis, v);
        add_scaled(add_scaled(across, v, cos), axis, dot(axis, v) / (1.0 + cos))
    } else {
        v
    };
    let flat = reject(turned, to);
    let flat_length = norm(flat);
    if flat_length > 0.0 { scale(flat, length / flat_length) } else { ZERO }
}

#[cfg(test)]
mod tests;
