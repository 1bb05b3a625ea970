//! Orders to misbehave, in words.

use std::{fmt, str::FromStr, time::Duration};

use sdr_core::recover::Cause;
use thiserror::Error;

/// Most bytes that are leaked in a second.
const LEAK_MAX: u64 = 1 << 30;
/// Most messages of one tick.
const FLOOD_MAX: u32 = 10_000;
/// Causes that a component can give.
const CAUSES: [Cause; 4] =
    [Cause::Error, Cause::HardwareLost, Cause::AbnormalBehaviour, Cause::EmergencyStop];

/// One way to misbehave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// None.
    Good,
    /// Ends the process as a broken pointer would.
    Crash,
    /// Ends the process with this exit code.
    Exit(u8),
    /// Never returns from `on_execute`.
    Hang,
    /// Keeps so many bytes more each second, and touches them.
    Leak(u64),
    /// Burns one core.
    Burn,
    /// Goes to the error state for this cause.
    Error(Cause),
    /// Sends so many messages each tick.
    Flood(u32),
    /// Sends what is no message of its type.
    Lie,
    /// Takes so long for each tick.
    Slow(Duration),
}

/// An order, and whether the next instance gets it, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// What to do.
    pub order: Order,
    /// It stays for whoever comes after.
    pub always: bool,
}

/// Not an order. Whoever gave it can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("order `{found}`: {allowed}")]
pub struct OrderError {
    found: String,
    allowed: &'static str,
}

/// All orders, for errors.
const ALLOWED: &str = "allowed: good, crash, exit CODE, hang, leak MEGABYTES (each second), burn, \
     error CAUSE (error, hardware-lost, abnormal-behaviour, emergency-stop), flood COUNT (each tick), \
     lie, slow MILLISECONDS; then `always` for every later instance";

impl FromStr for Standing {
    type Err = OrderError;

    fn from_str(text: &str) -> Result<Self, OrderError> {
        let wrong = || OrderError { found: text.trim().to_owned(), allowed: ALLOWED };
        let mut words: Vec<&str> = text.split_whitespace().collect();
        let always = words.last() == Some(&"always");
        if always {
            words.pop();
        }
        let number = |word: &str, most: u64| {
            word.parse::<u64>().ok().filter(|number| *number <= most).ok_or_else(wrong)
        };
        let order = match words.as_slice() {
            ["good"] => Order::Good,
            ["crash"] => Order::Crash,
            ["exit", code] => Order::Exit(code.parse().map_err(|_| wrong())?),
            ["hang"] => Order::Hang,
            ["leak", megabytes] => {
                Order::Leak(number(megabytes, LEAK_MAX / 1_000_000)? * 1_000_000)
            }
            ["burn"] => Order::Burn,
            ["error", word] => {
                let cause = CAUSES.into_iter().find(|cause| cause.word() == *word);
                Order::Error(cause.ok_or_else(wrong)?)
            }
            ["flood", count] => {
                let count = number(count, u64::from(FLOOD_MAX))?;
                Order::Flood(u32::try_from(count).map_err(|_| wrong())?)
            }
            ["lie"] => Order::Lie,
            ["slow", milliseconds] => {
                Order::Slow(Duration::from_millis(number(milliseconds, 60_000)?))
            }
            _ => return Err(wrong()),
        };
        Ok(Self { order, always })
    }
}

impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Good => f.write_str("good"),
            Self::Crash => f.write_str("crash"),
            Self::Exit(code) => write!(f, "exit {code}"),
            Self::Hang => f.write_str("hang"),
            Self::Leak(bytes) => write!(f, "leak {}", bytes / 1_000_000),
            Self::Burn => f.write_str("burn"),
            Self::Error(cause) => write!(f, "error {cause}"),
            Self::Flood(count) => write!(f, "flood {count}"),
            Self::Lie => f.write_str("lie"),
            Self::Slow(time) => write!(f, "slow {}", time.as_millis()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_is_read_as_it_is_written() {
        let orders = [
            Order::Good,
            Order::Crash,
            Order::Exit(3),
            Order::Hang,
            Order::Leak(20_000_000),
            Order::Burn,
            Order::Error(Cause::EmergencyStop),
            Order::Flood(100),
            Order::Lie,
            Order::Slow(Duration::from_millis(250)),
        ];
        for order in orders {
            let read: Standing = order.to_string().parse().unwrap();
            assert_eq!(read, Standing { order, always: false });
            let read: Standing = format!(" {order}  always\n").parse().unwrap();
            assert_eq!(read, Standing { order, always: true });
        }
    }

    #[test]
    fn what_is_no_order_is_told_with_all_that_are() {
        for wrong in
            ["", "always", "crash now", "exit 256", "error battery-low", "leak 99999", "flood -1"]
        {
            let error = wrong.parse::<Standing>().unwrap_err().to_string();
            assert!(error.contains("allowed: good, crash"), "{error}");
        }
    }
}
