//! Figures and facts in tables.

use super::{CAVEAT, PAPER_ACTIVATION_S, PAPER_RECOVERY_S, duration, or_dash, section, table};
use crate::{
    render::units::{count, megabytes},
    report::{Report, extra::Bars, svg::escape},
};

/// This run's figures beside the paper's.
pub(super) fn headline(report: &Report) -> String {
    let mut rows = durations(report);
    rows.extend(behaviour(report));
    let mut html = String::from(
        "<div class=\"scroll\"><table class=\"big\">\n<tr><th></th><th>here</th><th>the paper</th>\
         <th>what is counted</th></tr>\n",
    );
    for [name, here, paper, what] in rows {
        html.push_str(&format!(
            "<tr><td>{}</td><td><strong>{}</strong></td><td>{}</td><td class=\"muted\">{}</td></tr>\n",
            escape(&name),
            escape(&here),
            escape(&paper),
            escape(&what)
        ));
    }
    html.push_str("</table></div>\n");
    if report.extra.radio.is_some() {
        html.push_str(&format!(
            "<p class=\"muted\">The paper: three Raspberry Pi 4 on real Wi-Fi. {CAVEAT}</p>\n"
        ));
    }
    for what in report.figures.not_activated.iter().chain(&report.figures.not_recovered) {
        html.push_str(&format!("<p><strong>Missing:</strong> {}</p>\n", escape(what)));
    }
    html
}

/// How long it took.
fn durations(report: &Report) -> Vec<[String; 4]> {
    let figures = &report.figures;
    let paper = |seconds: u32| match report.extra.radio {
        Some(_) => format!("{seconds} s"),
        None => "-".to_owned(),
    };
    let active = format!("{} active", count(report.run.components.len(), "component"));
    let moved = format!("{} moved", count(figures.moves.len(), "component"));
    vec![
        [
            active,
            or_dash(figures.activation_ns.map(duration)),
            paper(PAPER_ACTIVATION_S),
            "deployment accepted until all are active and every connection has its first sample"
                .to_owned(),
        ],
        [
            moved,
            or_dash(figures.recovery_ns.map(duration)),
            paper(PAPER_RECOVERY_S),
            "hold time over until active on the new home and heard by their consumers".to_owned(),
        ],
    ]
}

/// What the robot and its streams felt.
fn behaviour(report: &Report) -> Vec<[String; 4]> {
    let figures = &report.figures;
    let usual = figures.commands.and_then(|pause| pause.period_median_ns);
    let lost: u64 = figures.samples.values().map(|one| one.counts.lost).sum();
    let received: u64 = figures.samples.values().map(|one| one.counts.received).sum();
    let row =
        |name: &str, here: String, what: String| [name.to_owned(), here, "-".to_owned(), what];
    let mut rows = vec![
        row(
            "controller's pause",
            or_dash(figures.commands.map(|pause| duration(pause.gap_max_ns))),
            format!(
                "longest pause of the commands at the wheels around the move; median period {}",
                or_dash(usual.map(duration))
            ),
        ),
        row(
            "samples lost",
            lost.to_string(),
            format!(
                "missing in the sequence after a consumer's first sample, of {} on all connections",
                received + lost
            ),
        ),
    ];
    if let Some((mean, max)) = figures.position_error_m {
        let what =
            format!("mean distance of the estimate from the world's truth; largest {max:.2} m");
        rows.push(row("position error", format!("{mean:.2} m"), what));
    }
    if let Some(detector) = &report.extra.detector {
        let after = detector.stop_after_ms.map(|ms| format!("{:.2} s", ms / 1e3));
        let what = format!(
            "from its appearance until the robot stood, {} before it; shown {}, stops {}, stops without cause {}; the path stays inside its area, so the stop at its edge is not shown",
            or_dash(detector.stop_distance_m.map(|m| format!("{m:.2} m"))),
            detector.shown,
            detector.stops,
            detector.stops_without_cause
        );
        rows.push(row(
            "dangerous object",
            after.unwrap_or_else(|| "did not stop".to_owned()),
            what,
        ));
    }
    if let Some((all, danger)) = figures.verdicts {
        let what = format!("pictures taken for dangerous, of {all} that the detector looked at");
        rows.push(row("danger seen", danger.to_string(), what));
    }
    rows
}

/// Table IV of this run, and the bars of Tables V and VI.
pub(super) fn environment(report: &Report) -> String {
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut add = |item: &str, value: Option<String>| {
        if let Some(value) = value {
            rows.push(vec![item.to_owned(), value]);
        }
    };
    if let Some(machine) = &report.extra.machine {
        add("Machine", machine.model.clone());
        add("Cores", machine.cores.map(|cores| cores.to_string()));
        add("Memory", machine.memory_bytes.map(|bytes| format!("{} MB", bytes / 1_000_000)));
        add("Kernel", machine.kernel.clone());
        add("Huge pages", machine.huge_pages.clone());
        let version = machine.sdr.as_ref().map(|version| {
            let build = machine.build.as_deref().unwrap_or("unknown build");
            let commit = machine.commit.as_deref().map(|commit| format!(", commit {commit}"));
            let rustc = machine.rustc.as_deref().map(|rustc| format!(", {rustc}"));
            format!("{version}, {build}{}{}", commit.unwrap_or_default(), rustc.unwrap_or_default())
        });
        add("sdr", version);
    }
    if let Some(radio) = &report.extra.radio {
        add(
            "Radio (played)",
            Some(format!(
                "level of {} from {} to {} dBm within {} s, noise {} dB; others stay at {} dBm",
                radio.robot,
                radio.from_dbm,
                radio.to_dbm,
                radio.fade_s,
                radio.noise_db,
                radio.from_dbm
            )),
        );
        add("Data between robots", Some(radio.carrier.clone()));
    }
    for (name, metrics) in &report.run.robots {
        let capacity = metrics
            .last()
            .map(|last| format!("{} MB for components", last.memory_capacity_bytes / 1_000_000));
        add(name, capacity);
    }
    if let Some(bars) = &report.extra.bars {
        add("Table V, allocation", allocation_bars(bars));
        add("Table VI, recovery", recovery_bars(bars));
    }
    let body = if rows.is_empty() {
        "<p class=\"muted\">The recordings do not say.</p>\n".to_owned()
    } else {
        table(&["Item", "Device or setting"], &rows)
    };
    section("Table IV of this run", &body)
}

/// What allocation wants to be left.
fn allocation_bars(bars: &Bars) -> Option<String> {
    let first = bars.allocation_memory_bytes?;
    let words = format!("free memory after placing at least {}", megabytes(first));
    Some(match bars.relaxed_memory_bytes {
        Some(relaxed) => format!("{words}; in recovery at least {}", megabytes(relaxed)),
        None => words,
    })
}

/// What recovery acts on.
fn recovery_bars(bars: &Bars) -> Option<String> {
    let memory = bars.recovery_memory_bytes;
    let memory = memory.map(|bytes| format!("free memory {} or less", megabytes(bytes)));
    let radio = bars.recovery_rssi_dbm.map(|level| {
        let hold = bars.recovery_rssi_hold_s.map(|hold| format!(" for {hold} s"));
        format!("RSSI {level:.1} dBm or less{}", hold.unwrap_or_default())
    });
    let words: Vec<String> = memory.into_iter().chain(radio).collect();
    (!words.is_empty()).then(|| words.join("; "))
}

/// One row for each connection.
pub(super) fn connections(report: &Report) -> String {
    let figures = &report.figures;
    let rows: Vec<Vec<String>> = figures
        .samples
        .iter()
        .map(|(name, traffic)| {
            let counts = &traffic.counts;
            let known = |number: Option<u64>| or_dash(number.map(|number| number.to_string()));
            let period = report.run.links.get(name).and_then(|link| link.period_ns());
            let pause = figures.pauses.get(name).copied().flatten();
            vec![
                name.clone(),
                known(traffic.sent),
                counts.received.to_string(),
                counts.lost.to_string(),
                known(traffic.unheard),
                counts.fenced.to_string(),
                counts.late.to_string(),
                or_dash(period.map(duration)),
                or_dash(pause.map(|pause| {
                    let over = pause.over_ns().map(|bar| format!(" (bar {})", duration(bar)));
                    format!("{}{}", duration(pause.gap_max_ns), over.unwrap_or_default())
                })),
            ]
        })
        .collect();
    let head = [
        "Connection",
        ">sent",
        ">received",
        ">lost",
        ">unheard",
        ">fenced",
        ">late",
        ">median period",
        ">longest pause at the move",
    ];
    let note = "<p class=\"muted\">Sent counts from an output's first sample, also while nobody \
        listens yet, and over both homes while they overlap; it is received, lost and unheard \
        together. Lost: missing in the sequence after a consumer's first sample. Unheard: sent \
        before a consumer's first sample or after its last, refused ones of an old home (fenced) \
        included. Counters are read five times a second, producer and consumer not at once, so \
        the last samples of an instance may be missing in them.</p>\n";
    section("Connections", &format!("{}{note}", table(&head, &rows)))
}

/// One row for each agent.
pub(super) fn agents(report: &Report) -> String {
    let megabytes = |bytes: Option<u64>| {
        or_dash(bytes.map(|bytes| {
            let tenths = bytes / 100_000;
            format!("{}.{} MB", tenths / 10, tenths % 10)
        }))
    };
    let rows: Vec<Vec<String>> = report
        .summary
        .agents
        .iter()
        .map(|(name, agent)| {
            vec![
                name.clone(),
                megabytes(agent.rss_bytes),
                megabytes(agent.rss_bytes_max),
                megabytes(agent.pss_bytes),
                or_dash(agent.cpu_permille.map(|cpu| format!("{}.{} %", cpu / 10, cpu % 10))),
            ]
        })
        .collect();
    let head =
        ["Agent", ">RSS, median", ">RSS, largest", ">PSS, median", ">CPU of one core, median"];
    section("What the agents took", &table(&head, &rows))
}

/// Where all this comes from.
pub(super) fn files(report: &Report) -> String {
    let mut html = String::from("<ul>\n");
    for file in &report.summary.recordings {
        html.push_str(&format!("<li><code>{}</code></li>\n", escape(file)));
    }
    html.push_str("</ul>\n<p class=\"muted\">MCAP with ROS 2 schemas: Foxglove, Lichtblick and <code>rosbags</code> open them; <code>sdr report</code> makes this page from them again.</p>\n");
    for note in &report.summary.notes {
        html.push_str(&format!("<p>{}</p>\n", escape(note)));
    }
    section("Recordings", &html)
}
