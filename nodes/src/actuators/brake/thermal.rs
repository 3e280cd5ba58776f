//! Heat of the solenoid: a coil inside a heat sink. The coil's resistance, and with it its power at a given current, rises as it
//! warms; above a limit the brake trips until it has cooled.

haptograph_engine::settings! {
    /// A coil and its heat sink. The heat capacities and thermal resistances are placeholders, not measurements: chosen so
    /// that a lasting 4 W end at 120 degrees and the curve bends near two minutes, as Fig. 5.19 does.
    pub struct CoilSettings {
        /// Temperature of the air, degrees Celsius.
        ambient_c: f64 = CoilSettings::default().ambient_c, in -50.0..=100.0;
        /// Resistance of the coil at that temperature, ohm: 0.3 A at 4 W.
        resistance_ohm: f64 = CoilSettings::default().resistance_ohm, in 1e-3..=1e6;
        /// Relative rise of the resistance, 1/K: copper.
        rise_per_k: f64 = CoilSettings::default().rise_per_k, in 0.0..=0.1;
        /// Heat capacity of the coil, J/K.
        coil_j_per_k: f64 = CoilSettings::default().coil_j_per_k, in 1e-3..=1e6;
        /// Thermal resistance from coil to sink, K/W.
        coil_to_sink_k_per_w: f64 = CoilSettings::default().coil_to_sink_k_per_w, in 1e-3..=1e6;
        /// Heat capacity of the sink, J/K.
        sink_j_per_k: f64 = CoilSettings::default().sink_j_per_k, in 1e-3..=1e6;
        /// Thermal resistance from sink to air, K/W.
        sink_to_air_k_per_w: f64 = CoilSettings::default().sink_to_air_k_per_w, in 1e-3..=1e6;
        /// Coil temperature at which the brake trips, degrees Celsius.
        trip_c: f64 = CoilSettings::default().trip_c, in -50.0..=1000.0;
        /// Coil temperature below which it is enabled again, degrees Celsius.
        rearm_c: f64 = CoilSettings::default().rearm_c, in -50.0..=1000.0;
    }
}

impl Copy for CoilSettings {}

impl Default for CoilSettings {
    fn default() -> Self {
        Self {
            ambient_c: 25.0,
            resistance_ohm: 44.4,
            rise_per_k: 0.003_86,
            coil_j_per_k: 15.0,
            coil_to_sink_k_per_w: 8.0,
            sink_j_per_k: 40.0,
            sink_to_air_k_per_w: 15.75,
            trip_c: 120.0,
            rearm_c: 90.0,
        }
    }
}

/// Thermal state of the coil.
#[derive(Debug, Clone)]
pub struct CoilThermal {
    settings: CoilSettings,
    /// Above the air, K.
    coil_k: f64,
    /// Above the air, K.
    sink_k: f64,
    tripped: bool,
}

impl CoilThermal {
    /// A cold coil.
    pub fn new(settings: CoilSettings) -> Self {
        Self { settings, coil_k: 0.0, sink_k: 0.0, tripped: false }
    }

    /// Takes over the temperatures of another coil.
    pub fn copy_state_from(&mut self, other: &Self) {
        (self.coil_k, self.sink_k, self.tripped) = (other.coil_k, other.sink_k, other.tripped);
    }

    /// Advances by a time at a constant current, s and A (implicit Euler: stable for any time).
    pub fn advance(&mut self, current_a: f64, time_s: f64) {
        let s = &self.settings;
        let power_w = current_a * current_a * self.resistance_ohm();
        let (to_sink, to_air) = (time_s / s.coil_to_sink_k_per_w, time_s / s.sink_to_air_k_per_w);
        // (C_c + g) T_c - g T_s = C_c T_c0 + P t;  -g T_c + (C_s + g + h) T_s = C_s T_s0
        let (coil, sink) = (s.coil_j_per_k + to_sink, s.sink_j_per_k + to_sink + to_air);
        let (heat, kept) = (s.coil_j_per_k * self.coil_k + power_w * time_s, s.sink_j_per_k * self.sink_k);
        let determinant = coil * sink - to_sink * to_sink;
        self.coil_k = (heat * sink + to_sink * kept) / determinant;
        self.sink_k = (coil * kept + to_sink * heat) / determinant;
        let limit_c = if self.tripped { s.rearm_c } else { s.trip_c };
        self.tripped = self.coil_c() > limit_c;
    }

    /// Resistance of the coil now, ohm.
    pub(crate) fn resistance_ohm(&self) -> f64 {
        self.settings.resistance_ohm * (1.0 + self.settings.rise_per_k * self.coil_k)
    }

    /// Temperature of the coil, degrees Celsius.
    pub(crate) fn coil_c(&self) -> f64 {
        self.settings.ambient_c + self.coil_k
    }

    /// True if the coil has tripped and must have no current.
    pub(crate) fn is_tripped(&self) -> bool {
        self.tripped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sink_c(coil: &CoilThermal) -> f64 {
        coil.settings.ambient_c + coil.sink_k
    }

    fn after(current_a: f64, seconds: u32) -> CoilThermal {
        let mut coil = CoilThermal::new(CoilSettings { trip_c: 1e3, ..CoilSettings::default() });
        (0..seconds * 100).for_each(|_| coil.advance(current_a, 0.01));
        coil
    }

    #[test]
    fn a_lasting_4_w_end_at_the_rated_120_degrees() {
        let mut coil =
            CoilThermal::new(CoilSettings { rise_per_k: 0.0, trip_c: 1e3, ..CoilSettings::default() });
        (0..100_000).for_each(|_| coil.advance((4.0_f64 / 44.4).sqrt(), 0.1));
        assert!((coil.coil_c() - 120.0).abs() < 0.01, "{}", coil.coil_c());
        assert!((sink_c(&coil) - 88.0).abs() < 0.01);
    }

    #[test]
    fn the_resistance_tells_the_temperature_and_rises_by_38_6_percent_over_100_degrees() {
        let coil = after(0.25, 480);
        // Eq. 5.5.9
        let s = &coil.settings;
        let coil_c =
            s.ambient_c + (coil.resistance_ohm() - s.resistance_ohm) / (s.rise_per_k * s.resistance_ohm);
        assert!((coil_c - coil.coil_c()).abs() < 1e-9);
        let hot = CoilThermal { coil_k: 100.0, ..after(0.0, 1) };
        assert!((hot.resistance_ohm() / 44.4 - 1.386).abs() < 1e-12);
        let watts = 0.09 * hot.resistance_ohm();
        assert!((watts - 5.54).abs() < 0.01, "0.3 A is {watts} W when hot");
    }

    #[test]
    fn heating_slows_down_after_two_minutes() {
        let rate = |from_s, to_s| {
            (after(0.2, to_s).coil_c() - after(0.2, from_s).coil_c()) / f64::from(to_s - from_s)
        };
        assert!(rate(0, 60) > 2.0 * rate(180, 240));
    }

    #[test]
    fn what_is_put_in_is_stored_or_given_to_the_air() {
        let settings = CoilSettings { trip_c: 1e3, ..CoilSettings::default() };
        let mut coil = CoilThermal::new(settings);
        let (mut put_in_j, mut given_j) = (0.0, 0.0);
        for _ in 0..200_000 {
            put_in_j += 0.04 * coil.resistance_ohm() * 1e-3;
            coil.advance(0.2, 1e-3);
            given_j += (sink_c(&coil) - 25.0) / settings.sink_to_air_k_per_w * 1e-3;
        }
        let stored_j =
            settings.coil_j_per_k * (coil.coil_c() - 25.0) + settings.sink_j_per_k * (sink_c(&coil) - 25.0);
        assert!((put_in_j - given_j - stored_j).abs() < 1e-6 * put_in_j);
    }

    #[test]
    fn too_hot_trips_until_it_has_cooled() {
        let mut coil = CoilThermal::new(CoilSettings::default());
        let mut seconds = 0;
        while !coil.is_tripped() && seconds < 36_000 {
            coil.advance(0.3, 1.0);
            seconds += 1;
        }
        assert!(coil.is_tripped(), "0.3 A for ever is too much once the coil is warm");
        coil.advance(0.0, 1.0);
        assert!(coil.is_tripped(), "it does not chatter");
        (0..3600).for_each(|_| coil.advance(0.0, 1.0));
        assert!(!coil.is_tripped());
    }
}
