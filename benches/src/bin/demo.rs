//! Runs `sdr demo` many times and prints its figures: p50 and worst beside their bars.
//!
//! The first run warms the machine up; it is shown and not counted.

use std::{
    collections::BTreeMap,
    error::Error,
    process::{Command, Stdio},
};

use clap::Parser;
use sdr_benches::{Series, line, programs, row};
use serde_json::Value;

/// Arguments.
#[derive(Debug, Parser)]
struct Args {
    /// Runs that count.
    #[arg(long, default_value_t = 10)]
    runs: usize,
    /// Components touch no 500 MB.
    #[arg(long)]
    no_ballast: bool,
    /// Who holds the role at the start.
    #[arg(long)]
    coordinator: Option<String>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let ballast = if args.no_ballast { "without ballast" } else { "5 x 500 MB of ballast" };
    line(&format!("sdr demo, {ballast}, {} runs", args.runs))?;
    let first = run(&args)?;
    line(&format!(
        "first run, not counted: activation {} ms, recovery {} ms",
        first["activation_ms"], first["recovery_ms"]
    ))?;
    let mut all: BTreeMap<String, Series> = BTreeMap::new();
    let mut lost = Series::default();
    for _ in 0..args.runs {
        let report = run(&args)?;
        collect(&report, &mut all);
        lost.push(samples_lost(&report));
    }
    let (activation, recovery) = match args.no_ballast {
        true => ("<= 400", "<= 300"),
        false => ("<= 2000", "<= 1500"),
    };
    line(&format!("{:<44} {:>9} {:>9}   bar", "", "p50", "worst"))?;
    for (name, series) in &all {
        let bar = match name.as_str() {
            "activation ms" => activation,
            "recovery after the hold ms" => recovery,
            "controller's longest pause ms" => "<= 200",
            stream if stream.starts_with("pause over") => "<= 200",
            _ => "",
        };
        row(name, series, bar, 1)?;
    }
    row("samples lost in a run", &lost, "", 0)?;
    Ok(())
}

/// One demo in a folder of its own; its report.
fn run(args: &Args) -> Result<Value, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let mut command = Command::new(programs()?.join("sdr"));
    command.args(["demo", "-o", "json", "--out"]).arg(folder.path().join("report"));
    if args.no_ballast {
        command.arg("--no-ballast");
    }
    if let Some(robot) = &args.coordinator {
        command.args(["--coordinator", robot]);
    }
    let output = command.stdin(Stdio::null()).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn collect(report: &Value, all: &mut BTreeMap<String, Series>) {
    let mut take = |name: String, value: &Value| {
        if let Some(value) = value.as_f64() {
            all.entry(name).or_default().push(value);
        }
    };
    take("activation ms".into(), &report["activation_ms"]);
    take("recovery after the hold ms".into(), &report["recovery_ms"]);
    take("controller's longest pause ms".into(), &report["controller_gap_ms"]["max"]);
    for (connection, gap) in report["stream_gap_ms"].as_object().into_iter().flatten() {
        let (pause, period) = (gap["gap_max_ms"].as_f64(), gap["period_median_ms"].as_f64());
        if let (Some(pause), Some(period)) = (pause, period) {
            let over = (pause - 2.0 * period).max(0.0);
            take(format!("pause over 2 periods, {connection}"), &over.into());
        }
    }
    for (robot, agent) in report["agents"].as_object().into_iter().flatten() {
        let mega = agent["rss_bytes"].as_f64().map(|bytes| bytes / 1e6);
        take(format!("agent of {robot}: RSS MB"), &mega.into());
        let percent = agent["cpu_permille"].as_f64().map(|permille| permille / 10.0);
        take(format!("agent of {robot}: CPU % of a core"), &percent.into());
    }
}

fn samples_lost(report: &Value) -> f64 {
    let samples = report["samples"].as_object().into_iter().flatten();
    samples.filter_map(|(_, counts)| counts["lost"].as_f64()).sum()
}
