//! Processes that outlive their agent.

use std::path::Path;

use super::*;

#[test]
fn leftovers_of_a_killed_agent_are_ended_and_others_are_not() {
    run(async {
        let mut bench = Bench::new();
        bench.script("sleeper", "while true; do sleep 1000; done");
        bench.launch(1, "sleeper");
        assert!(matches!(bench.news(1).await, InstanceNews::Started { .. }));
        // As if an agent had died: its journal, and a process that was given an old number.
        let predecessor = tempfile::tempdir().unwrap();
        let mut bystander = std::process::Command::new("sleep").arg("1000").spawn().unwrap();
        let mut entries = journal::read(bench.dir.path());
        let mut other = entries[0].clone();
        other.pid = bystander.id();
        entries.push(other);
        fs::write(predecessor.path().join("processes.json"), serde_json::to_vec(&entries).unwrap())
            .unwrap();

        end_leftovers(predecessor.path(), Path::new("/nowhere"), &bench.events);

        assert!(bench.until_exit(1).await.contains("signal 15"));
        let said = bench.events.since(0);
        assert_eq!(said.len(), 1);
        assert_eq!(said[0].event.kind, "leftover-ended");
        assert!(bystander.try_wait().unwrap().is_none());
        bystander.kill().unwrap();
        bystander.wait().unwrap();
    });
}

#[test]
fn leftovers_are_found_by_their_socket_when_the_journal_is_lost() {
    run(async {
        let mut bench = Bench::new();
        bench.script("sleeper", "while true; do sleep 1000; done");
        bench.launch(1, "sleeper");
        assert!(matches!(bench.news(1).await, InstanceNews::Started { .. }));
        let lost = tempfile::tempdir().unwrap();

        end_leftovers(lost.path(), Path::new("/nowhere"), &bench.events);
        assert_eq!(bench.events.since(0), []);
        end_leftovers(lost.path(), &bench.dir.path().join("c.sock"), &bench.events);

        assert!(bench.until_exit(1).await.contains("signal 15"));
        let said = bench.events.since(0);
        assert_eq!(said.len(), 1);
        assert!(said[0].event.reason.contains("mapping/lidar outlived its agent"), "{said:?}");
    });
}
