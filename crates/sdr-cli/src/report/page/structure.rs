//! Figure 3: who runs where, before and after.

use std::collections::BTreeMap;

use super::section;
use crate::report::{
    Report,
    svg::{Graph, GraphBox, GraphEdge, escape},
};

/// Both pictures and the list of connections.
pub(super) fn before_and_after(report: &Report) -> String {
    let figures = &report.figures;
    let names: Vec<&String> = if report.extra.connections.is_empty() {
        report.run.links.keys().collect()
    } else {
        report.extra.connections.iter().collect()
    };
    let edges: Vec<(usize, &String, &str, &str)> = names
        .iter()
        .enumerate()
        .filter_map(|(index, name)| {
            let (from, to) = name.split_once(" -> ")?;
            Some((index + 1, *name, component(from), component(to)))
        })
        .collect();
    let mut html = String::new();
    let pictures = [
        ("before", "after automatic allocation", &figures.placement_before, None),
        (
            "after",
            "after automatic recovery",
            &figures.placement_after,
            Some(&figures.placement_before),
        ),
    ];
    for (index, (word, caption, placement, earlier)) in pictures.into_iter().enumerate() {
        if index == 1 && figures.moves.is_empty() {
            continue;
        }
        let graph = graph(report, placement, earlier, &edges);
        let svg = graph.draw(&format!("Robots and components {word} the recovery"));
        html.push_str(&format!(
            "<figure>\n{svg}<figcaption>Figure 3-({}): {caption}.</figcaption></figure>\n",
            index + 1
        ));
    }
    html.push_str(
        "<p class=\"muted\"><span class=\"key memory\"></span>shared memory (same robot)\
         <span class=\"key dds\"></span>DDS (between robots); a thick purple frame: moved</p>\n<p class=\"muted\">",
    );
    let list: Vec<String> =
        edges.iter().map(|(number, name, _, _)| format!("({number}) {}", escape(name))).collect();
    html.push_str(&list.join(", "));
    html.push_str("</p>\n");
    section("Figure 3: the system", &html)
}

fn graph(
    report: &Report,
    placement: &BTreeMap<String, String>,
    earlier: Option<&BTreeMap<String, String>>,
    edges: &[(usize, &String, &str, &str)],
) -> Graph {
    let holder = match earlier {
        None => &report.summary.coordinator.at_start,
        Some(_) => &report.summary.coordinator.at_end,
    };
    let robots = report.run.robots.keys().map(|robot| {
        let here = report.run.components.iter().filter(|name| placement.get(*name) == Some(robot));
        let parts = here.map(|name| {
            let moved = earlier.is_some_and(|earlier| earlier.get(name) != Some(robot));
            (name.clone(), moved)
        });
        let note = if holder.as_ref() == Some(robot) { "coordinator" } else { "" };
        GraphBox { name: robot.clone(), note: note.to_owned(), parts: parts.collect() }
    });
    let edges = edges.iter().map(|(number, _, from, to)| GraphEdge {
        from: (*from).to_owned(),
        to: (*to).to_owned(),
        number: *number,
    });
    Graph { boxes: robots.collect(), edges: edges.collect() }
}

/// `fisheye` of `fisheye.image`.
fn component(port: &str) -> &str {
    port.rsplit_once('.').map_or(port, |(component, _)| component)
}
