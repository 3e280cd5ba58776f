//! False alarms of both tests of responsiveness on people who feel no difference.

use crate::people::{normal, rows_of};
use haptograph_study::statistics::anova::{centred_by_person, columns, one_way};
use haptograph_study::statistics::repeated;

#[test]
fn repeated_measures_keep_5_percent_where_the_thesis_test_has_12() {
    const STUDIES: usize = 2000;
    let (mut within, mut corrected, mut thesis) = (0, 0, 0);
    for seed in 0..STUDIES {
        let mut table = normal(15, 4, seed as u64);
        for (mut row, bias) in table.row_iter_mut().zip(normal(15, 1, (STUDIES + seed) as u64).iter()) {
            row.add_scalar_mut(2.0 * bias);
        }
        let rows = rows_of(&table);
        let proper = repeated::one_way(&rows).unwrap().term;
        let as_in_thesis = one_way(&columns(&centred_by_person(&rows))).unwrap();
        assert_eq!((proper.error.df, as_in_thesis.residual.df), (42.0, 56.0));
        within += usize::from(proper.effect.p < 0.05);
        corrected += usize::from(proper.p_corrected < 0.05);
        thesis += usize::from(as_in_thesis.effect.p < 0.05);
    }
    let percent = [within, corrected, thesis].map(|count| 100.0 * count as f64 / STUDIES as f64);
    assert!((percent[0] - 5.0).abs() < 1.0, "{percent:?}");
    assert!(percent[1] > 2.0 && percent[1] <= percent[0], "{percent:?}");
    assert!((percent[2] - 11.8).abs() < 1.4, "{percent:?}");
}
