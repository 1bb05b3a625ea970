//! What expressions say, and why others are refused.

use alloc::{format, string::ToString, vec::Vec};

use super::*;

/// Facts of a robot with 150 MB left whose radio level nobody knows.
fn facts(named: Named) -> Option<Answer<'static>> {
    Some(match named.name() {
        "robot.memory_free" => Answer::Double(150e6),
        "robot.cpu" => Answer::Double(0.5),
        "robot.rssi" => return None,
        "component.name" => Answer::Text("camera"),
        "component.actuator" => Answer::Bool(true),
        "component.exits" => Answer::Int(3),
        _ => Answer::Double(0.0),
    })
}

fn says(source: &str) -> Option<bool> {
    match Expression::new(source) {
        Ok(expression) => expression.holds(&|named| facts(named)),
        Err(error) => panic!("{source}: {error} at {}", error.at),
    }
}

fn refused(source: &str) -> (usize, String) {
    let error = Expression::new(source).unwrap_err();
    assert!(error.at <= source.len() && error.width > 0 && !error.help.is_empty(), "{error:?}");
    (error.at, error.message)
}

#[test]
fn facts_are_compared_as_cel_compares_them() {
    for (source, said) in [
        ("robot.memory_free < 200.0 * MB", true),
        ("robot.memory_free < 100.0 * MB || component.exits >= 3", true),
        ("component.exits > 2.5 && robot.cpu == 0.5", true),
        ("component.name in [\"eye\", 'camera']", true),
        ("component.name == \"eye\" ? robot.cpu > 0.4 : robot.cpu > 0.6", false),
        ("!(component.actuator && component.exits % 2 == 0)", true),
        ("1 + 2 * 3 == 7 && (1 + 2) * 3 == 9 && 7 - 2 - 1 == 4 && 7 / 2 == 3", true),
        ("double(component.exits) / 2.0 == 1.5 && int(1.9) == 1 && -1 < 0", true),
        ("has(robot.cpu) && !has(robot.rssi)", true),
        ("2e3 == 2000.0 && \"a\" < \"b\" && true != false", true),
        ("1 < 2 == true", true),
    ] {
        assert_eq!(says(source), Some(said), "{source}");
    }
}

#[test]
fn what_is_unknown_matters_only_where_it_decides() {
    assert_eq!(says("robot.rssi < -80.0"), None);
    assert_eq!(says("robot.rssi < -80.0 || true"), Some(true));
    assert_eq!(says("false && robot.rssi < -80.0"), Some(false));
    assert_eq!(says("robot.rssi < -80.0 && false"), Some(false));
    assert_eq!(says("robot.rssi < -80.0 || false"), None);
    assert_eq!(says("has(robot.rssi) && robot.rssi < -80.0"), Some(false));
    assert_eq!(says("component.exits / 0 > 1"), None);
    assert_eq!(says("9223372036854775807 + component.exits > 0"), None);
}

#[test]
fn unknown_names_are_refused_where_they_stand_with_those_of_their_family() {
    let error = Expression::new("robot.cpu > 0.5 && robot.temprature > 80.0").unwrap_err();
    assert_eq!((error.at, error.width), (19, 16));
    assert_eq!(error.message, "unknown fact `robot.temprature`");
    assert!(error.help.contains("robot.battery, robot.rssi"), "{}", error.help);
    assert_eq!(refused("size(component.name) > 3").1, "unknown function `size`");
}

#[test]
fn kinds_that_do_not_fit_are_refused_where_they_stand() {
    for (source, at, message) in [
        ("robot.cpu", 0, "the expression is double"),
        ("robot.cpu > 1 && component.name", 0, "`&&` of bool and string"),
        ("robot.memory_free < 200 * MB", 20, "`*` of int and double"),
        ("component.name > 3", 0, "`>` of string and int"),
        ("!component.exits == true", 1, "int stands where bool is due"),
        ("component.exits in [\"a\"]", 0, "`in` of int and list"),
        ("component.exits in [1, \"a\"]", 23, "string stands where int is due"),
        ("true ? 1 : 2.0", 11, "double stands where int is due"),
        ("-component.name == \"\"", 1, "string stands where a number is due"),
    ] {
        assert_eq!(refused(source), (at, message.to_string()), "{source}");
    }
}

#[test]
fn what_is_no_expression_is_refused_where_it_breaks() {
    for (source, at) in [
        ("", 0),
        ("robot.cpu >", 11),
        ("(robot.cpu > 0.5", 16),
        ("robot.cpu > 0.5)", 15),
        ("robot.cpu > 0.5 robot.cpu", 16),
        ("robot. > 1", 7),
        ("robot.cpu > 200MB", 12),
        ("component.name == \"eye", 18),
        ("robot.cpu = 0.5", 10),
        ("robot.cpu > 0.5 ; true", 16),
        ("has(3)", 4),
        ("robot.cpu > 99999999999999999999", 12),
        ("component.exits in [1, 2", 24),
    ] {
        assert_eq!(refused(source).0, at, "{source}");
    }
}

#[test]
fn length_depth_and_number_of_parts_are_bounded() {
    let nested = |depth: usize| format!("{}true{}", "(".repeat(depth), ")".repeat(depth));
    assert!(Expression::new(&nested(DEPTH_MAX - 1)).is_ok());
    for deep in [nested(DEPTH_MAX), format!("{}true", "!".repeat(300)), "(".repeat(400)] {
        assert!(refused(&deep).1.contains("too deeply"), "{deep}");
    }
    let long = |parts: usize| format!("1{}==2", "+1".repeat(parts));
    assert!(Expression::new(&long(50)).is_ok());
    assert!(refused(&long(150)).1.contains("too long"));
    assert!(refused(&" ".repeat(SOURCE_BYTES_MAX + 1)).1.contains("401 bytes"));
}

#[test]
fn an_expression_says_whether_it_is_about_the_robot_alone() {
    for (source, of_robot) in [
        ("robot.cpu > 0.9 || links.loss > 0.2", true),
        ("robot.cpu > 0.9 && component.cpu > 0.5", false),
        ("true", false),
    ] {
        assert_eq!(Expression::new(source).unwrap().is_of_robot(), of_robot, "{source}");
    }
}

#[test]
fn every_name_is_there_once_and_finds_itself() {
    let all: Vec<Named> = names().collect();
    for (index, named) in all.iter().enumerate() {
        assert_eq!(Named::of_name(named.name()), Some(*named));
        assert!(!all[..index].contains(named) && !named.about().is_empty());
    }
}

proptest::proptest! {
    #[test]
    fn any_text_is_an_expression_or_an_error_with_a_place(source in "[a-z.()<>!&|=+*/?:,'\"0-9 \\[\\]-]{0,60}") {
        if let Err(error) = Expression::new(&source) {
            proptest::prop_assert!(error.at <= source.len());
        }
    }

    #[test]
    fn a_text_made_of_words_of_the_language_is_taken_or_refused(
        words in proptest::collection::vec(proptest::sample::select(alloc::vec![
            "robot.cpu", "component.exits", "component.name", "true", "1", "2.5", "\"a\"", "(", ")",
            "<", "==", "&&", "||", "!", "-", "+", "/", "%", "?", ":", "in", "[", "]", ",", "has(",
        ]), 0..30),
    ) {
        if let Ok(expression) = Expression::new(&words.join(" ")) {
            let _ = expression.holds(&|named| facts(named));
        }
    }
}
