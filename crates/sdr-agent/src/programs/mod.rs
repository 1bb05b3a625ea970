//! Programs of the operator's that judge what a policy's table cannot say: facts as JSON in,
//! causes as JSON out, within a time and a size.
//!
//! ```text
//!  Effect::Ask ─▶ sheet (facts) ─▶ stdin ─▶ program ─▶ stdout ─▶ findings ─▶ Input::Told
//!                                           └ too long, too much, no JSON ─▶ an error
//! ```

mod findings;
mod sheet;

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::rc::Rc;

use sdr_core::{
    effect::ProgramOrder,
    id::RobotId,
    input::{Finding, Input},
};
use thiserror::Error;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, Command};
use tokio::sync::mpsc;

use crate::supervisor::find;
use sheet::sheet;

/// Programs that run at the same time.
const RUNNING_MAX: usize = 8;
/// Longest answer.
const ANSWER_BYTES_MAX: u64 = 64 * 1024;
/// What is kept of what it complains of.
const COMPLAINT_BYTES_MAX: u64 = 2048;

/// Runs programs, each in a task of its own. Lives on the loop's thread, within a `LocalSet`.
#[derive(Clone, Debug)]
pub(crate) struct Programs {
    robot: RobotId,
    path: Rc<[PathBuf]>,
    inputs: mpsc::Sender<Input>,
    running: Rc<Cell<usize>>,
}

/// Why there is no answer. The policy says what counts then; the author of the program can
/// mend it.
#[derive(Debug, Error)]
enum NoAnswer {
    #[error("{RUNNING_MAX} programs are running already")]
    Busy,
    #[error("{0}")]
    Missing(String),
    #[error("cannot be started: {0}")]
    Start(std::io::Error),
    #[error("ended after {limit_ms} ms without an answer")]
    TooLong { limit_ms: u128 },
    #[error("answers more than {ANSWER_BYTES_MAX} bytes")]
    TooMuch,
    #[error("cannot be talked to: {0}")]
    Talk(std::io::Error),
    #[error("{status}{said}")]
    Failed { status: ExitStatus, said: String },
    #[error("{0}")]
    Unreadable(String),
}

impl Programs {
    /// For files of the folders in `path`; answers go to `inputs`.
    pub(crate) fn new(robot: RobotId, path: Vec<PathBuf>, inputs: mpsc::Sender<Input>) -> Self {
        Self { robot, path: path.into(), inputs, running: Rc::default() }
    }

    /// Asks; the answer, or why there is none, is an input.
    pub(crate) fn ask(&self, order: ProgramOrder) {
        let this = self.clone();
        tokio::task::spawn_local(async move {
            let question = order.question;
            let result = this.answer(&order).await.map_err(|error| error.to_string());
            // Nobody is left to hear it when the agent stops.
            let _ = this.inputs.send(Input::Told { question, result }).await;
        });
    }

    async fn answer(&self, order: &ProgramOrder) -> Result<Vec<Finding>, NoAnswer> {
        if self.running.get() >= RUNNING_MAX {
            return Err(NoAnswer::Busy);
        }
        self.running.set(self.running.get() + 1);
        let answer = self.run(order).await;
        self.running.set(self.running.get() - 1);
        findings::read(&answer?).map_err(NoAnswer::Unreadable)
    }

    async fn run(&self, order: &ProgramOrder) -> Result<Vec<u8>, NoAnswer> {
        let program = &order.program;
        let (name, arguments) = program.command.split_first().expect("a checked policy names one");
        let file = find(&self.path, name).map_err(|error| NoAnswer::Missing(error.to_string()))?;
        let facts = sheet(&self.robot, &order.system, &order.evidence);
        let child = start(&file, arguments).map_err(NoAnswer::Start)?;
        // Dropped after its time, the child is killed.
        match tokio::time::timeout(program.limit, talk(child, facts.to_string())).await {
            Ok(answer) => answer,
            Err(_) => Err(NoAnswer::TooLong { limit_ms: program.limit.as_millis() }),
        }
    }
}

fn start(file: &Path, arguments: &[String]) -> std::io::Result<Child> {
    Command::new(file)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        // What it starts itself goes with it at the latest when it reads a closed pipe.
        .process_group(0)
        .kill_on_drop(true)
        .spawn()
}

async fn talk(mut child: Child, facts: String) -> Result<Vec<u8>, NoAnswer> {
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let say = async {
        if let Some(mut stdin) = stdin {
            // A program that does not read its facts may still answer.
            let _ = stdin.write_all(facts.as_bytes()).await;
        }
    };
    let answer = async {
        let answer = read_some(stdout, ANSWER_BYTES_MAX + 1).await;
        let too_much = answer.as_ref().is_ok_and(|bytes| bytes.len() as u64 > ANSWER_BYTES_MAX);
        if too_much { Err(NoAnswer::TooMuch) } else { answer.map_err(NoAnswer::Talk) }
    };
    let complaint = read_some(stderr, COMPLAINT_BYTES_MAX);
    let ((), answer, complaint) = tokio::join!(say, answer, complaint);
    let answer = answer?;
    let status = child.wait().await.map_err(NoAnswer::Talk)?;
    if status.success() {
        return Ok(answer);
    }
    let complaint = complaint.unwrap_or_default();
    let complaint = String::from_utf8_lossy(&complaint);
    let last = complaint.trim().lines().last().unwrap_or_default();
    let said = if last.is_empty() { String::new() } else { format!(": {last}") };
    Err(NoAnswer::Failed { status, said })
}

async fn read_some(from: Option<impl AsyncRead + Unpin>, bytes: u64) -> std::io::Result<Vec<u8>> {
    let mut read = Vec::new();
    if let Some(from) = from {
        from.take(bytes).read_to_end(&mut read).await?;
    }
    Ok(read)
}

#[cfg(test)]
mod tests;
