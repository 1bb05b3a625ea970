//! Durations in arguments: a number and its unit.

use std::time::Duration;

/// Longest time that is waited.
const SECONDS_MAX: f64 = 86_400.0;

/// `500ms`, `60s`, `2min`, `1h`.
pub(super) fn parse(text: &str) -> Result<Duration, String> {
    let allowed = "a number with its unit, such as 500ms, 60s, 2min, 1h (at most 24h)";
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit.trim() {
        "ms" => 0.001,
        "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        "" => return Err(format!("no unit; allowed: {allowed}")),
        other => return Err(format!("`{other}` is no unit of time; allowed: {allowed}")),
    };
    match number.parse::<f64>() {
        Ok(number) if number * scale <= SECONDS_MAX => Ok(Duration::from_secs_f64(number * scale)),
        Ok(_) => Err(format!("too long; allowed: {allowed}")),
        Err(_) => Err(format!("`{number}` is no number; allowed: {allowed}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_needs_its_unit() {
        assert_eq!(parse("60s"), Ok(Duration::from_secs(60)));
        assert_eq!(parse("1.5min"), Ok(Duration::from_secs(90)));
        assert_eq!(parse("250 ms"), Ok(Duration::from_millis(250)));
        for bad in ["60", "s", "-1s", "1.2.3s", "5parsecs", "99999h", "", "NaNs"] {
            assert!(parse(bad).unwrap_err().contains("allowed"), "{bad}");
        }
    }
}
