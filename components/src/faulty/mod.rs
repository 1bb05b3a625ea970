//! A component that misbehaves on order, for tests of everything that mends components.

mod order;

use std::{
    fs,
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use sdr_component::message::std_msgs::String as Text;
use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};

pub use order::{Order, OrderError, Standing};

/// The variable that names the folder of orders.
const FOLDER: &str = "FAULTY_ORDERS";
/// Bytes of one message of a flood.
const FLOOD_BYTES: usize = 1024;
/// Largest order, bytes.
const ORDER_BYTES_MAX: u64 = 200;

/// See `components/faulty/README.md`.
#[derive(Debug)]
pub struct Faulty {
    input: InPort<Text>,
    output: OutPort<Text>,
    /// How long it takes to come up.
    start: Duration,
    first: Standing,
    first_after: Duration,
    /// Since when it is active.
    active_since: Option<Instant>,
    order: Order,
    count: u64,
    leaked: Vec<Vec<u8>>,
    leaked_at: Instant,
}

impl Component for Faulty {
    const NAME: &'static str = "faulty";
    const ABOUT: &'static str = "Misbehaves on order: crashes, hangs, leaks, errs, floods, lies.";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let first: String =
            setup.parameter("order", "good".to_owned(), "what it does by itself")?;
        let within = 0.0..=3600.0;
        let after = setup.parameter_within(
            "after_s",
            0.0,
            within.clone(),
            "when, after it became active, s",
        )?;
        let start =
            setup.parameter_within("start_s", 0.0, within, "how long it takes to come up, s")?;
        Ok(Self {
            input: setup.input("input")?,
            output: setup.output("output")?,
            start: Duration::from_secs_f64(start),
            first: first.parse()?,
            first_after: Duration::from_secs_f64(after),
            active_since: None,
            order: Order::Good,
            count: 0,
            leaked: Vec::new(),
            leaked_at: Instant::now(),
        })
    }

    fn on_initialize(&mut self, _: &mut Context<'_>) -> Outcome {
        thread::sleep(self.start);
        Ok(())
    }

    fn on_activated(&mut self, _: &mut Context<'_>) -> Outcome {
        self.active_since = Some(Instant::now());
        self.order = Order::Good;
        Ok(())
    }

    fn on_execute(&mut self, context: &mut Context<'_>) -> Outcome {
        // What it hears does not matter, but that it hears does: inputs are emptied.
        while self.input.receive().is_some() {}
        self.look_for_order(context)?;
        self.count += 1;
        self.obey()
    }
}

impl Faulty {
    /// Takes the order that is due, or was left in the folder.
    fn look_for_order(&mut self, context: &mut Context<'_>) -> Outcome {
        let due = self.active_since.is_some_and(|since| since.elapsed() >= self.first_after);
        if due && self.first.order != Order::Good {
            self.order = self.first.order;
            self.first.order = Order::Good;
            context.log(format_args!("by itself: {}", self.order));
        }
        let Some(path) = order_path(context.component().name.as_str()) else { return Ok(()) };
        let Ok(size) = fs::metadata(&path).map(|found| found.len()) else { return Ok(()) };
        let text = match size {
            0..=ORDER_BYTES_MAX => fs::read_to_string(&path)?,
            _ => return Err(ComponentError::other(format!("an order of {size} bytes"))),
        };
        let standing: Standing = text.parse()?;
        if !standing.always {
            // Gone before it is obeyed, or the next instance would obey it again.
            fs::remove_file(&path)?;
        }
        if standing.order != self.order {
            self.order = standing.order;
            context.log(format_args!("as told: {}", self.order));
        }
        Ok(())
    }

    fn obey(&mut self) -> Outcome {
        match self.order {
            Order::Good => {}
            Order::Crash => std::process::abort(),
            Order::Exit(code) => std::process::exit(i32::from(code)),
            Order::Hang => loop {
                thread::park();
            },
            Order::Leak(bytes) => self.leak(bytes),
            Order::Burn => burn(),
            Order::Error(cause) => {
                self.order = Order::Good;
                return Err(ComponentError::new(cause, format!("told to err: {cause}")));
            }
            Order::Flood(count) => {
                let message = Text { data: "x".repeat(FLOOD_BYTES) };
                (0..count).try_for_each(|_| self.output.send(&message))?;
            }
            Order::Lie => {
                // A text of four thousand million bytes, of which none is there.
                self.output.send_with(4, |out| {
                    out.fill(0xff);
                    Ok(())
                })?;
                return Ok(());
            }
            Order::Slow(time) => thread::sleep(time),
        }
        Ok(self.output.send(&Text { data: self.count.to_string() })?)
    }

    fn leak(&mut self, bytes_per_second: u64) {
        let passed = self.leaked_at.elapsed().min(Duration::from_secs(1));
        self.leaked_at = Instant::now();
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most a gigabyte"
        )]
        let bytes = (bytes_per_second as f64 * passed.as_secs_f64()) as usize;
        // Not zeros: those would cost no memory.
        self.leaked.push(vec![1; bytes]);
    }
}

/// One thread that does nothing as fast as it can, once.
fn burn() {
    static BURNS: std::sync::Once = std::sync::Once::new();
    BURNS.call_once(|| {
        // It ends with the process.
        drop(thread::spawn(|| {
            loop {
                std::hint::spin_loop();
            }
        }));
    });
}

/// Where orders for the component of that name are left; `None` without a folder.
fn order_path(component: &str) -> Option<PathBuf> {
    let folder = std::env::var_os(FOLDER)?;
    Some(PathBuf::from(folder).join(component))
}
