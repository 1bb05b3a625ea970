//! `sdr report`: from agents' recordings to a page and a summary.
//!
//! ```text
//!  *.mcap ─▶ read ─▶ run (who was where, who heard whom) ─▶ figures ─┬▶ summary ─▶ report.json
//!  demo.json ─▶ extra (truth, machine, bars) ────────────────────────┴▶ page ────▶ report.html
//! ```
//!
//! Every figure is measured; what the recordings do not hold is `null` and a dash.

pub(crate) mod extra;
pub(crate) mod figures;
pub(crate) mod link;
pub(crate) mod machine;
pub(crate) mod page;
pub(crate) mod read;
pub(crate) mod run;
pub(crate) mod summary;
mod svg;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;

use crate::{Session, failure::Failure, output::Format};

use self::{
    extra::Extra,
    figures::Figures,
    machine::Machine,
    read::{Recordings, Words},
    run::Run,
    summary::Summary,
};

/// Where an agent keeps its recordings.
const SYSTEM_RECORDINGS: &str = "/var/lib/sdr/recordings";

/// Makes report.html and report.json from agents' recordings.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Recordings (*.mcap), or folders that hold them
    #[arg(value_name = "DIR|FILE", default_value = SYSTEM_RECORDINGS)]
    paths: Vec<PathBuf>,
    /// Where the report goes
    #[arg(long, value_name = "DIR", default_value = "sdr-report")]
    out: PathBuf,
}

/// Carries out `sdr report`.
pub(crate) async fn run(args: ReportArgs, session: &Session) -> Result<ExitCode, Failure> {
    let mut notes = Vec::new();
    let mut extra = Extra::default();
    for folder in args.paths.iter().filter(|path| path.is_dir()) {
        match Extra::load(folder) {
            Ok(Some(found)) => extra = found,
            Ok(None) => {}
            Err(note) => notes.push(note),
        }
    }
    let mut report = Report::make(&args.paths, extra)?;
    report.summary.notes.extend(notes);
    let page = report.write(&args.out)?;
    match session.output.format() {
        Format::Json => session.output.json(&report.summary)?,
        Format::Text => session.output.text(&report.words(&page))?,
    }
    Ok(ExitCode::SUCCESS)
}

/// A report in the making.
pub(crate) struct Report {
    /// What happened.
    pub(crate) run: Run,
    /// Its figures.
    pub(crate) figures: Figures,
    /// What recordings cannot tell.
    pub(crate) extra: Extra,
    /// What becomes `report.json`.
    pub(crate) summary: Summary,
}

impl Report {
    /// Reads recordings and works out everything.
    pub(crate) fn make(paths: &[PathBuf], extra: Extra) -> Result<Self, Failure> {
        let recordings =
            Recordings::read(paths).map_err(|error| Failure::new(error.to_string()))?;
        Ok(Self::of(&recordings, extra))
    }

    /// Works out everything.
    pub(crate) fn of(recordings: &Recordings, extra: Extra) -> Self {
        let run = Run::new(recordings, extra.until_ns);
        let mut figures = Figures::new(&run, &recordings.fixes, &extra);
        // Every robot where the port was heard recorded it: the one that heard most has them all.
        let danger = |words: &&Words| Some(&words.topic) == extra.danger_topic.as_ref();
        let most = recordings.words.iter().filter(danger).max_by_key(|words| words.said);
        figures.verdicts = most.map(|words| (words.said, words.yes));
        let mut summary = Summary::new(&run, &figures, &extra);
        summary.notes.extend(recordings.notes.iter().cloned());
        summary.notes.extend(figures.not_activated.iter().cloned());
        summary.notes.extend(figures.not_recovered.iter().cloned());
        summary.notes.extend(figures.too_long());
        summary.notes.extend(extra.pictures.as_deref().map(stands));
        summary.notes.extend(extra.machine.as_ref().and_then(Machine::unknown));
        let name = |path: &PathBuf| fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        let files = recordings.files.iter().map(|path| name(path).display().to_string());
        summary.recordings = files.collect();
        Self { run, figures, extra, summary }
    }

    /// Writes `report.html` and `report.json` into `folder` and gives the page's path.
    pub(crate) fn write(&self, folder: &Path) -> Result<PathBuf, Failure> {
        let tell = |path: &Path, error: &dyn std::fmt::Display| {
            Failure::new(format!("cannot write {}: {error}", path.display()))
        };
        fs::create_dir_all(folder).map_err(|error| tell(folder, &error))?;
        let summary = folder.join("report.json");
        let text =
            serde_json::to_string_pretty(&self.summary).map_err(|error| tell(&summary, &error))?;
        fs::write(&summary, text + "\n").map_err(|error| tell(&summary, &error))?;
        let page = folder.join("report.html");
        fs::write(&page, page::page(self)).map_err(|error| tell(&page, &error))?;
        Ok(page)
    }

    /// A few lines for a terminal.
    fn words(&self, page: &Path) -> String {
        let time = |ns: Option<u64>| ns.map_or_else(|| "unknown".to_owned(), page::duration);
        format!(
            "{} of {}, {:.1} s\n  activation {}, recovery {}, {}\n  {}\n",
            crate::render::units::count(self.run.components.len(), "component"),
            crate::render::units::count(self.run.robots.len(), "robot"),
            self.run.second(self.run.until_ns),
            time(self.figures.activation_ns),
            time(self.figures.recovery_ns),
            crate::render::units::count(self.figures.moves.len(), "move"),
            page.display()
        )
    }
}

/// Why the rover of a demo with pictures does not drive.
fn stands(pictures: &str) -> String {
    format!(
        "the cameras showed {pictures}, not the tunnel: the rover does not find its place in them \
         and stands"
    )
}

#[cfg(test)]
pub(crate) mod tests;
