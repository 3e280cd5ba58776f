//! What the columns of a table probably hold, for a person who says what they do.

use super::COLUMNS;
use super::alias::like_ours;
use super::hints::likely;
use super::units::{QUANTITIES, dimension, plain_name};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;

/// The quantities that are looked for in columns of any name, the surest first.
const SOUGHT: [&str; 5] = ["time", "accel", "force_normal", "speed", "force_tangential"];

/// A column of a table, and what it probably holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LikelyColumn {
    /// Its name.
    pub name: String,
    /// One of [`QUANTITIES`](super::QUANTITIES), if any is likely; each is so of one column.
    pub quantity: Option<String>,
}

/// What the columns of a header probably hold, by their names.
pub(super) fn guessed(names: &[String]) -> Vec<LikelyColumn> {
    let mut found: Vec<Option<String>> = vec![None; names.len()];
    for (index, name) in names.iter().enumerate() {
        let known = plain_name(&name.to_lowercase()).map(|(plain, _)| plain);
        let known = known.filter(|plain| QUANTITIES.contains(&&**plain)).or_else(|| like_ours(name));
        found[index] = known.filter(|quantity| !found.iter().flatten().any(|other| other == quantity));
    }
    for quantity in SOUGHT {
        let is_raw = |other: &String| quantity == "accel" && other.starts_with("accel");
        if found.iter().flatten().any(|other| other == quantity || is_raw(other)) {
            continue;
        }
        let free: Vec<usize> = (0..names.len()).filter(|index| found[*index].is_none()).collect();
        let unread: Vec<(&str, &str)> = free.iter().map(|index| (&*names[*index], "")).collect();
        if let Some(at) = likely(quantity, &unread) {
            found[free[at]] = Some(quantity.to_owned());
        }
    }
    let column = |(name, quantity): (&String, Option<String>)| LikelyColumn { name: name.clone(), quantity };
    names.iter().zip(found).map(column).collect()
}

/// The units of a quantity that a person can state, that of [`COLUMNS`] first; `1` of the vibration is an unknown one.
pub fn units_of(quantity: &str) -> Vec<&'static str> {
    let of = dimension(quantity).filter(|of| *of != Quantity::NUMBER);
    let mut known: Vec<&'static str> = of.into_iter().flat_map(units::of_quantity).collect();
    let in_name = |unit: &str| format!("{quantity}_{}", unit.to_lowercase().replace(['/', ' '], "_"));
    known.sort_by_key(|unit| !COLUMNS.contains(&&*in_name(unit)));
    known.extend(quantity.starts_with("accel").then_some("1"));
    known
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_any_logger_are_guessed_and_each_quantity_once() {
        let of = |names: &[&str]| -> Vec<Option<String>> {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            guessed(&names).into_iter().map(|column| column.quantity).collect()
        };
        let all = |quantities: &[&str]| quantities.iter().map(|q| Some((*q).to_owned())).collect::<Vec<_>>();
        let (plain, named) =
            (["clock", "pressing", "v_tip", "vib"], ["time", "force_normal", "speed", "accel"]);
        assert_eq!(of(&plain), all(&named));
        assert_eq!(of(&["Zeit", "Kraft [N]", "Geschw (mm/s)", "Beschl [g]"]), all(&named));
        assert_eq!(of(&["q1/ms", "q2/gf", "q3/(cm/s)", "q4/g"]), all(&named));
        assert_eq!(of(&["t / µs", "q/N", "Velocity/(m/s)", "a/m/s²"]), all(&named));
        assert_eq!(of(&["w/s", "1/s", "q m/s", "gyro deg/s", "q_mV/N", "N/A"]), [const { None }; 6]);
        assert_eq!(of(&["vib", "vib 2", "note"]), [Some("accel".to_owned()), None, None]);
        assert_eq!(
            of(&["time_s", "friction", "load", "v"]),
            all(&["time", "force_tangential", "force_normal", "speed"])
        );
        assert_eq!(of(&["accel_x_g", "accel_y_g", "accel_z_g"]), all(&["accel_x", "accel_y", "accel_z"]));
    }

    #[test]
    fn units_begin_with_the_usual_one() {
        let usual = ["time", "accel", "force_normal", "speed", "position_x", "torque_x"]
            .map(|name| units_of(name)[0]);
        assert_eq!(usual, ["s", "m_s2", "n", "mm_s", "mm", "n_mm"]);
        assert!(units_of("accel").contains(&"g") && units_of("accel").ends_with(&["1"]));
        assert!(units_of("orientation_w").is_empty());
    }
}
