//! Trials and what is said of all of them.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sdr_benches::{Series, line, row};
use serde::Serialize;
use serde_json::{Value, json};

/// One trial.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Trial {
    /// From the last sample that the consumer accepted of the old producer to the first of the
    /// new one; where the producer stays, the longest pause between two samples around the fault.
    pub(crate) pause_ms: f64,
    /// From the cause to the last event of its repair. Where an agent died: from the start of
    /// the next one to its last adoption.
    pub(crate) total_ms: f64,
    /// From the cause to the event that says it; where an agent died, to the first adoption.
    pub(crate) detection_ms: f64,
    /// Samples that a producer without the fault would have sent and the consumer did not get.
    pub(crate) lost: u64,
    /// Samples that the consumer accepted twice.
    pub(crate) duplicates: u64,
}

/// All trials of one case.
#[derive(Debug)]
pub(crate) struct Report {
    case: String,
    trials: Vec<Trial>,
    raw: File,
    path: PathBuf,
}

impl Report {
    /// Raw data goes to `CASE.jsonl` in `out`, a line for each trial.
    pub(crate) fn new(case: &str, out: &Path) -> io::Result<Self> {
        fs::create_dir_all(out)?;
        let path = out.join(format!("{case}.jsonl"));
        Ok(Self { case: case.into(), trials: Vec::new(), raw: File::create(&path)?, path })
    }

    pub(crate) fn take(&mut self, trial: Trial) -> io::Result<()> {
        serde_json::to_writer(&mut self.raw, &trial)?;
        self.raw.write_all(b"\n")?;
        self.trials.push(trial);
        Ok(())
    }

    /// The object that scripts read.
    pub(crate) fn summary(&self) -> Value {
        let [pause, total, detection] = self.series();
        let sum = |of: fn(&Trial) -> u64| self.trials.iter().map(of).sum::<u64>();
        json!({
            "case": self.case,
            "trials": self.trials.len(),
            "pause_ms": figures(&pause),
            "total_ms": figures(&total),
            "detection_ms": figures(&detection),
            "lost_samples": sum(|trial| trial.lost),
            "duplicate_samples": sum(|trial| trial.duplicates),
            "raw": self.path,
        })
    }

    /// The same for people.
    pub(crate) fn table(&self) -> io::Result<()> {
        let [pause, total, detection] = self.series();
        line(&format!("{:<44} {:>9} {:>9}", self.case, "p50", "worst"))?;
        row("pause, ms", &pause, "", 2)?;
        row("total, ms", &total, "", 2)?;
        row("detection, ms", &detection, "", 2)?;
        line(&self.summary().to_string())
    }

    fn series(&self) -> [Series; 3] {
        let mut all = [Series::default(), Series::default(), Series::default()];
        for trial in &self.trials {
            all[0].push(trial.pause_ms);
            all[1].push(trial.total_ms);
            all[2].push(trial.detection_ms);
        }
        all
    }
}

fn figures(series: &Series) -> Value {
    json!({ "p50": series.percentile(50), "p99": series.percentile(99), "max": series.worst() })
}
