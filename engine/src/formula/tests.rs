use super::*;

/// Of inputs a = 3 and b = -2, half a second after the start.
fn value(text: &str) -> f64 {
    let formula = Formula::parse(text, &["a", "b"]).expect(text);
    let mut work = vec![0.0; formula.depth()];
    let inputs: [&[f64]; 2] = [&[3.0], &[-2.0]];
    formula.compute(1, |input| inputs[input], |_| 0.5, &mut work);
    work[0]
}

#[test]
fn operators_bind_as_on_paper() {
    for (text, expected) in [
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("2 - 3 - 4", -5.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("- -a", 3.0),
        ("a - b", 5.0),
        ("7 % 4 * 2", 6.0),
        ("-1 % 3", 2.0),
        ("-1 % -3", 2.0),
        ("b % 4", 2.0),
        ("1 < 2 && 3 <= 3 || 0", 1.0),
        ("a == 3 && b != -2", 0.0),
        ("1.5e-2 + .5", 0.515),
        ("2*e", 2.0 * E),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn functions_take_their_arguments_in_order() {
    for (text, expected) in [
        ("sin(pi / 2)", 1.0),
        ("if(a > 2, a, b)", 3.0),
        ("if(a < 2, a, b)", -2.0),
        ("min(a, max(b, 1))", 1.0),
        ("clamp(10, b, a)", 3.0),
        ("mix(a, b, 0.5)", 0.5),
        ("pow(a, 2) + hypot(3, 4)", 14.0),
        ("sign(b) + sign(0) + not(0)", 0.0),
        ("t * 4", 2.0),
        ("mod(-0.5, 2)", 1.5),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn what_is_not_finite_is_zero() {
    for text in ["1 / 0", "sqrt(b)", "ln(0)", "a % 0", "clamp(1, 5, 4) - 4"] {
        assert_eq!(value(text), 0.0, "{text}");
    }
}

#[test]
fn mistakes_are_told_with_their_place() {
    for (text, at) in [
        ("", 1),
        ("a +", 4),
        ("a b", 3),
        ("2 * c", 5),
        ("sin a", 5),
        ("2a", 2),
        ("2(a)", 2),
        ("min(a, b, 1)", 10),
        ("a ** 2", 4),
        ("0 < a < 1", 8),
        ("(a b)", 4),
        ("min(a)", 6),
        ("(a", 3),
        ("1.2.3", 1),
        ("ä + é", 1),
        ("a ? b", 3),
    ] {
        let error = Formula::parse(text, &["a", "b"]).expect_err(text);
        assert_eq!(error.at, at, "{text}: {error}");
    }
    for (text, said) in [
        ("2 * PI", "`pi`"),
        ("log(a)", "`ln`"),
        ("arcsin(a)", "`asin`"),
        ("a & b", "`&&`"),
        ("a = 1", "`==`"),
        ("a ? 1 : 2", "`if("),
        ("5 x", "operator"),
        ("5mm", "1 mm is 0.001"),
        ("maximum(a, b)", "`max`"),
        ("average(a)", "the functions are"),
    ] {
        let error = Formula::parse(text, &["a", "b"]).expect_err(text);
        assert!(error.message.contains(said), "{text}: {error}");
    }
    for deep in ["(".repeat(5000), "-".repeat(1000), "(".repeat(200)] {
        assert!(Formula::parse(&deep, &["a"]).is_err());
    }
}

#[test]
fn frames_are_computed_each_for_itself() {
    let formula = Formula::parse("if(a > 0, a * b, t)", &["a", "b"]).expect("right");
    let mut work = vec![0.0; 3 * formula.depth()];
    let inputs: [&[f64]; 2] = [&[1.0, 0.0, 3.0], &[4.0, 5.0, 6.0]];
    formula.compute(3, |input| inputs[input], |frame| 10.0 + frame as f64, &mut work);
    assert_eq!(work[..3], [4.0, 11.0, 18.0]);
}
