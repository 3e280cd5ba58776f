use super::*;

impl StrokeSettings {
    /// A shape at a mean force with typical variation: force 20 %, pace 15 %, size 5 %.
    pub(crate) fn natural(shape: StrokeShape, force_n: f64) -> Self {
        Self { shape, force_n, force_variation: 0.2, pace_variation: 0.15, size_variation: 0.05 }
    }

    /// A shape at a force, without variation.
    pub(crate) fn exact(shape: StrokeShape, force_n: f64) -> Self {
        Self { shape, force_n, force_variation: 0.0, pace_variation: 0.0, size_variation: 0.0 }
    }
}

fn shapes() -> Vec<StrokeShape> {
    let path: Vec<[f64; 4]> = (0..200)
        .map(|k| f64::from(k) * 0.05)
        .map(|t| [t, 0.02 * t.sin(), 0.02 * (1.3 * t).cos(), 1.0 + 0.5 * t.sin()])
        .collect();
    vec![
        StrokeShape::Still,
        StrokeShape::Circles { radius_m: 0.03, period_s: 1.2 },
        StrokeShape::ZigZag { width_m: 0.06, height_m: 0.03, period_s: 1.0 },
        StrokeShape::Writing { letter_m: 0.006, line_m: 0.12 },
        StrokeShape::Wander { side_m: 0.06, fastest_hz: 1.5 },
        StrokeShape::FromRest { side_m: 0.06 },
        StrokeShape::Recorded(Arc::new(Trajectory::new(&path).unwrap())),
    ]
}

#[test]
fn strokes_move_smoothly_and_stay_on_the_sheet() {
    for shape in shapes() {
        let stroke = Stroke::new(StrokeSettings::natural(shape.clone(), 1.0), 4).unwrap();
        let mut previous = stroke.at(0.0);
        let mut way_m = 0.0;
        for k in 1..20_000 {
            let point = stroke.at(f64::from(k) * 5e-4);
            let step_m = crate::vector::distance(point.position_m, previous.position_m);
            assert!(step_m < 5e-4 * 1.2, "{shape:?} at step {k}: {step_m}");
            assert!(point.position_m.iter().all(|x| x.abs() < 0.12));
            assert!((0.0..2.0).contains(&point.force_n));
            way_m += step_m;
            previous = point;
        }
        assert!(way_m > 0.2 || shape == StrokeShape::Still, "{shape:?}: {way_m} m in 10 s");
    }
}

#[test]
fn a_stroke_from_rest_stays_where_it_begins_for_a_while() {
    let stroke = Stroke::new(StrokeSettings::exact(StrokeShape::FromRest { side_m: 0.06 }, 1.0), 4).unwrap();
    for start_s in (1..20).map(|number| f64::from(number) + 1e-9) {
        let at = |after_s: f64| stroke.at(start_s + after_s).position_m;
        assert_eq!(at(0.0), at(0.07));
        assert!(crate::vector::distance(at(0.6), at(0.97)) > 1e-4);
    }
}

#[test]
fn two_people_draw_differently_and_one_person_always_the_same() {
    let at = |seed| {
        let circles = StrokeShape::Circles { radius_m: 0.03, period_s: 1.2 };
        Stroke::new(StrokeSettings::natural(circles, 1.0), seed).unwrap().at(3.3)
    };
    assert_eq!(at(1), at(1));
    assert_ne!(at(1), at(2));
}

#[test]
fn an_exact_circle_is_a_circle() {
    let circles = StrokeShape::Circles { radius_m: 0.03, period_s: 1.2 };
    let stroke = Stroke::new(StrokeSettings::exact(circles, 0.8), 9).unwrap();
    for k in 0..100 {
        let point = stroke.at(f64::from(k) * 0.1);
        assert!((crate::vector::norm(point.position_m) - 0.03).abs() < 1e-15);
        assert_eq!(point.force_n, 0.8);
    }
}

#[test]
fn writing_lifts_the_pen_between_words() {
    let writing = StrokeShape::Writing { letter_m: 0.006, line_m: 0.12 };
    let stroke = Stroke::new(StrokeSettings::exact(writing, 1.0), 0).unwrap();
    let lifted = (0..1000).filter(|&k| stroke.at(f64::from(k) * 0.01).force_n == 0.0).count();
    assert!((190..220).contains(&lifted), "{lifted} of 1000");
}

#[test]
fn settings_without_meaning_are_refused() {
    let circles = |radius_m| StrokeShape::Circles { radius_m, period_s: 1.0 };
    let refused = |settings| Stroke::new(settings, 0).unwrap_err().to_string();
    assert!(refused(StrokeSettings::natural(circles(0.0), 1.0)).contains("radius_m is 0"));
    assert!(refused(StrokeSettings::natural(circles(0.01), f64::NAN)).contains("force_n is NaN"));
    let hasty = StrokeSettings { pace_variation: 0.5, ..StrokeSettings::natural(circles(0.01), 1.0) };
    assert!(refused(hasty).contains("pace_variation is 0.5"));
}

#[test]
fn a_recorded_path_goes_through_its_points() {
    let table = "x_mm,time_s, force_n ,y_mm\n0,1.0,0.5,0\n10,1.5,1,5\n20,2.0,2,0\n";
    let path = Trajectory::from_csv(table.as_bytes()).unwrap();
    assert_eq!(path.at(0.5), StrokePoint { position_m: [0.01, 0.005], force_n: 1.0, lifted: 0.0 });
    assert!(path.at(0.25).position_m[0] > 0.0 && path.at(0.25).position_m[0] < 0.01);
    assert_eq!(path.at(-1.0).position_m, [0.0, 0.0]);
    assert_eq!(path.at(1.0 - 1e-9).lifted, 0.0);
    assert_eq!(path.at(1.0), path.at(2.0));
    assert_eq!(path.at(2.0), StrokePoint { position_m: [0.02, 0.0], force_n: 0.0, lifted: 1.0 });
}

#[test]
fn a_broken_path_says_where() {
    let read = |table: &str| Trajectory::from_csv(table.as_bytes()).unwrap_err().to_string();
    assert!(read("time_s,x_mm,y_mm\n0,0,0\n").contains("no column force_n"));
    assert!(
        read("time_s,x_mm,y_mm,force_n\n0,0,0,1\n1,zero,0,1\n").starts_with("line 3, column 2: \"zero\"")
    );
    assert!(read("time_s,x_mm,y_mm,force_n\n0,0,0,1\n0,0,0,1\n").contains("point 1"));
    assert!(read("time_s,x_mm,y_mm,force_n\n0,0,0,1\n").contains("at least two"));
}
