//! `sdr events`: what one agent saw and decided, oldest first.

use std::process::ExitCode;

use sdr_core::api::EventView;

use crate::{
    Session,
    client::Client,
    failure::Failure,
    output::Format,
    render::{
        event,
        units::{one_line, shorten},
    },
};

/// Arguments of `sdr events`.
#[derive(Debug, clap::Args)]
pub(crate) struct EventsArgs {
    /// Go on with new events until Ctrl-C
    #[arg(short, long)]
    follow: bool,
    /// Only events after this sequence number
    #[arg(long, value_name = "SEQUENCE", default_value_t = 0)]
    since: u64,
    /// Only the last N of those that are there
    #[arg(short = 'n', long = "last", value_name = "N")]
    last: Option<usize>,
}

/// Shows what is there, then follows when asked to.
pub(crate) async fn run(args: EventsArgs, session: &Session) -> Result<ExitCode, Failure> {
    let client = Client::of(session)?;
    let there: Vec<EventView> = client.get(&format!("/v1/events?since={}", args.since)).await?;
    let skipped = args.last.map_or(0, |last| there.len().saturating_sub(last));
    let shown = there.get(skipped..).unwrap_or_default();
    match session.output.format() {
        Format::Json if !args.follow => session.output.json(&shown)?,
        Format::Json | Format::Text => {
            for event in shown {
                show(event, session)?;
            }
        }
    }
    if !args.follow {
        return Ok(ExitCode::SUCCESS);
    }
    let since = there.last().map_or(args.since, |event| event.sequence);
    follow(&client, since, session).await
}

/// One line an event until the agent stops. A stream that we were too slow for is taken up
/// again where it broke off; what the agent no longer keeps is counted by the gap.
async fn follow(client: &Client, mut since: u64, session: &Session) -> Result<ExitCode, Failure> {
    let mut fell_behind = true;
    while std::mem::take(&mut fell_behind) {
        let mut events = client.events(&format!("/v1/events?since={since}&follow=true")).await?;
        while let Some(message) = events.next().await? {
            match serde_json::from_str::<EventView>(&message.data) {
                Ok(event) => {
                    tell_gap(since, event.sequence, session)?;
                    since = event.sequence;
                    show(&event, session)?;
                }
                Err(_) if message.kind == "lagged" => fell_behind = true,
                Err(error) => {
                    return Err(Failure::new(format!(
                        "the agent sent what is no event: {error}\n  It begins: {}",
                        shorten(&one_line(&message.data), 60)
                    )));
                }
            }
        }
    }
    Err(Failure::new(format!(
        "the agent at {} ended the stream: it stopped or restarts",
        client.agent()
    )))
}

/// Says how many events are missing between two.
fn tell_gap(before: u64, next: u64, session: &Session) -> Result<(), Failure> {
    match next.saturating_sub(before) {
        0 | 1 => Ok(()),
        step => session.output.note(&format!("sdr: {} events are missing here", step - 1)),
    }
}

fn show(view: &EventView, session: &Session) -> Result<(), Failure> {
    match session.output.format() {
        Format::Text => session.output.line(&event::line(view)),
        Format::Json => session.output.json(view),
    }
}
