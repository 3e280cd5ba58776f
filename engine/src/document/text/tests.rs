use super::*;
use proptest::prelude::*;

fn parsed(text: &str) -> Value {
    let mut diagnostics = Vec::new();
    let value = read(SourceId(0), text, &mut diagnostics);
    assert!(diagnostics.is_empty(), "{text}: {diagnostics:?}");
    value.unwrap()
}

fn errors(text: &str) -> Vec<String> {
    let mut diagnostics = Vec::new();
    assert_eq!(read(SourceId(0), text, &mut diagnostics), None, "{text}");
    diagnostics
        .iter()
        .map(|d| format!("{} at {}", d.message, d.primary.as_ref().unwrap().span.start))
        .collect()
}

#[test]
fn values_know_their_place_behind_comments_and_beside_many_byte_letters() {
    let text = "#![enable(implicit_some)]\n/* µ /* nested */ */ G(é: [1.5, -2_000, 0x10], // x\n m: {\"ü\": Some(true)},)";
    let value = parsed(text);
    let Shape::Tagged(Tagged { name: Some(name), body: Body::Fields(fields) }) = &value.shape else {
        panic!("{value:?}");
    };
    assert_eq!(&text[name.span.start..name.span.end], "G");
    assert_eq!(&text[fields[0].0.span.start..fields[0].0.span.end], "é");
    let Shape::List(items) = &fields[0].1.shape else { panic!() };
    let written: Vec<&str> = items.iter().map(|v| &text[v.span.start..v.span.end]).collect();
    assert_eq!(written, ["1.5", "-2_000", "0x10"]);
    assert_eq!(items[1].shape, Shape::Number(-2000.0, "-2000".into()));
    assert_eq!(items[2].shape, Shape::Number(16.0, "16".into()));
    let Shape::Map(pairs) = &fields[1].1.shape else { panic!() };
    assert_eq!(&text[pairs[0].1.span.start..pairs[0].1.span.end], "Some(true)");
    assert_eq!(value.span.end, text.len());
}

#[test]
fn strings_are_read_as_ron_reads_them() {
    for text in [r#""plain""#, r#""a\n\"b\" \u{3bc}""#, r##"r#"raw "quoted" \n"#"##, "\"two\nlines\""] {
        assert_eq!(parsed(text).shape, Shape::String(ron::from_str(text).unwrap()), "{text}");
    }
    assert_eq!(errors(r#""\q""#).len(), 1);
}

#[test]
fn all_errors_of_a_text_are_found_at_once() {
    assert_eq!(
        errors("(a: 10Hz, b: 'x', c = 3, d 4, e: [1 2], )"),
        [
            "unexpected `'` at 13",
            "unexpected `=` at 20",
            "`10Hz` is not a number at 4",
            "expected `:` and a value, found `4` at 27",
            "expected `,` or `]`, found `2` at 36",
        ]
    );
}

#[test]
fn deep_nesting_is_an_error_and_not_an_overflow() {
    for open in ["(", "[", "A(", "{1:", "(a:"] {
        let text = open.repeat(100_000);
        assert!(!errors(&text).is_empty());
        let close = match open {
            "[" => "]",
            "{1:" => "}",
            _ => ")",
        };
        assert_eq!(errors(&(text + "1" + &close.repeat(100_000))).len(), 1, "{open}");
    }
}

fn ron_text() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("1".to_owned()),
        Just("-2.5e3".to_owned()),
        Just("true".to_owned()),
        Just("\"a b\"".to_owned()),
        Just("None".to_owned()),
        Just("()".to_owned()),
        Just("/* c */ 7".to_owned()),
    ];
    leaf.prop_recursive(4, 40, 4, |inner| {
        let list = prop::collection::vec(inner, 0..4);
        prop_oneof![
            list.clone().prop_map(|v| format!("[{}]", v.join(", "))),
            list.clone().prop_map(|v| format!("Tag({})", v.join(", "))),
            list.clone().prop_map(|v| {
                let pairs: Vec<String> =
                    v.iter().enumerate().map(|(i, v)| format!("\"k{i}\": {v}")).collect();
                format!("{{{}}}", pairs.join(", "))
            }),
            list.prop_map(|v| {
                let fields: Vec<String> =
                    v.iter().enumerate().map(|(i, v)| format!("f{i}: {v}, // x\n")).collect();
                format!("S({})", fields.concat())
            }),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn what_ron_writes_is_read(text in ron_text()) {
        let mut diagnostics = Vec::new();
        prop_assert!(ron::from_str::<serde::de::IgnoredAny>(&text).is_ok(), "{}", text);
        prop_assert!(read(SourceId(0), &text, &mut diagnostics).is_some(), "{} {:?}", text, diagnostics);
    }

    /// Whatever is accepted here is RON: a file that runs can be read by any other reader of RON.
    #[test]
    fn what_is_read_is_ron(text in ron_text(), cut in 0_usize..200, other in "[(){}\\[\\],:\"a1. /*-]{0,3}") {
        let mut cut = cut.min(text.len());
        while !text.is_char_boundary(cut) { cut -= 1; }
        let text = format!("{}{other}{}", &text[..cut], text[cut..].chars().skip(1).collect::<String>());
        let mut diagnostics = Vec::new();
        let value = read(SourceId(0), &text, &mut diagnostics);
        prop_assert_eq!(value.is_none(), !diagnostics.is_empty(), "{}", &text);
        if value.is_some() {
            prop_assert!(ron::from_str::<serde::de::IgnoredAny>(&text).is_ok(), "{}", text);
        }
    }
}

#[test]
fn the_sign_of_a_number_is_no_arithmetic() {
    for text in ["[-1,-2]", "(-1.2, 0.6)", "[+1]", "[-.5]", "[-inf,-NaN]", "{-1:-2}", "(a:-3)", "[1, -2]"] {
        let mut found = Vec::new();
        assert!(read(SourceId(0), text, &mut found).is_some(), "{text}");
        assert!(found.is_empty(), "{text}: {found:?}");
    }
}

#[test]
fn signs_without_end_are_refused_in_bounded_time() {
    for text in [
        "x ".to_owned() + &"* ".repeat(200_000),
        format!("[{}]", "a*1,".repeat(200_000)),
        ")*".repeat(200_000),
    ] {
        let mut found = Vec::new();
        let _ = read(SourceId(0), &text, &mut found);
        assert!(!found.is_empty());
    }
}
