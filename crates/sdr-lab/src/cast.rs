//! The lossy number conversions of this crate, in one place.

/// A brightness of 0 to 255, rounded towards zero; what lies outside is cut off.
#[expect(clippy::cast_possible_truncation, reason = "`as` cuts off at the ends of u8")]
pub(crate) fn byte(value: f32) -> u8 {
    value as u8
}

/// The largest integer not above `value`; far values are cut off at the ends of i32.
#[expect(clippy::cast_possible_truncation, reason = "`as` cuts off at the ends of i32")]
pub(crate) fn cell(value: f32) -> i32 {
    // Plain x86-64 has no instruction for `floor`; cutting off has one.
    let cut = value as i32;
    cut - i32::from(value < cut as f32)
}

/// `value` rounded to an integer; far values are cut off at the ends of i64.
#[expect(clippy::cast_possible_truncation, reason = "`as` cuts off at the ends of i64")]
pub(crate) fn rounded(value: f64) -> i64 {
    value.round() as i64
}

/// Metres and directions of a picture need no more than single precision.
#[expect(clippy::cast_possible_truncation, reason = "less precision is meant")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

/// Nanoseconds of a duration; 584 years fit.
pub(crate) fn nanoseconds(duration: std::time::Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
