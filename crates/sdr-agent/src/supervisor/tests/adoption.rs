//! What an agent finds that starts where another one died: the first one's tasks, sockets and
//! memory are gone, its processes are not.

use std::process::{Child, Command as Program};

use rustix::process::{Pid, Signal, WaitOptions, kill_process, waitpid};
use serde_json::Value as Json;

use super::*;

/// Lets an agent start one component, waits until it is active under `token(4)`, and dies.
fn die_over(manner: &str) -> (TempDir, u32) {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, manner);
        bench.supervisor.command(1, Command::Activate(token(4)));
        bench.until_state(1, LifecycleState::Active).await;
        let pid = journal::read(bench.dir.path()).entries[0].pid;
        (bench.dir, pid)
    })
}

fn process(pid: u32) -> Pid {
    Pid::from_raw(i32::try_from(pid).unwrap()).unwrap()
}

/// Changes the journal in `dir` before the next agent reads it.
fn edit_journal(dir: &TempDir, edit: impl FnOnce(&mut Json)) {
    let path = dir.path().join("processes.json");
    let mut entries: Vec<Json> = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    edit(&mut entries[0]);
    fs::write(path, serde_json::to_vec(&entries).unwrap()).unwrap();
}

/// Starts the next agent; it must adopt nothing. What it said.
fn refuse(dir: TempDir) -> Vec<(String, String)> {
    run(async {
        let bench = Bench::again(dir);
        assert!(bench.adopted.is_empty());
        let said = bench.events.since(0);
        said.iter().map(|view| (view.event.kind.clone(), view.event.reason.clone())).collect()
    })
}

fn is_running(pid: u32) -> bool {
    // Ours, as this process started them: one that ended waits to be reaped.
    matches!(waitpid(Some(process(pid)), WaitOptions::NOHANG), Ok(None))
}

fn end(pid: u32) {
    kill_process(process(pid), Signal::KILL).unwrap();
    waitpid(Some(process(pid)), WaitOptions::empty()).unwrap();
}

fn bystander() -> Child {
    Program::new("sleep").arg("1000").spawn().unwrap()
}

#[test]
fn a_component_that_outlived_its_agent_goes_on_under_its_token() {
    let (dir, pid) = die_over("loyal");
    run(async {
        let mut bench = Bench::again(dir);
        let Input::Instance { instance: 1, news: InstanceNews::Adopted(adoption) } =
            bench.adopted.remove(0)
        else {
            panic!("not adopted")
        };
        assert_eq!((adoption.pid, &adoption.component), (pid, &key()));
        assert_eq!(adoption.spec.on_agent_death, Some(OnAgentDeath::Keep));
        let news = bench.news(1).await;
        let active = LifecycleState::Active;
        assert!(
            matches!(&news, InstanceNews::State { state, token: Some(found), .. }
                if *state == active && *found == token(4)),
            "{news:?}"
        );

        bench.supervisor.command(1, Command::Deactivate);
        bench.until_state(1, LifecycleState::Error).await;
        bench.supervisor.command(1, Command::Kill);
        let reason = bench.until_exit(1).await;

        assert!(reason.starts_with("killed by signal 9"), "{reason}");
        assert!(reason.contains("here I am again"), "its log is kept: {reason}");
        assert!(bench.events.since(0).is_empty());
        assert_eq!(fs::read(bench.dir.path().join("processes.json")).unwrap(), b"[]");
    });
}

#[test]
fn an_adopted_component_that_never_greets_is_told() {
    let (dir, pid) = die_over("shy");
    run(async {
        let mut config = config(&dir);
        config.patience.reconnect = Duration::from_millis(300);
        config.on_agent_death = OnAgentDeath::Keep;
        let mut bench = Bench::open(dir, config);
        assert_eq!(bench.adopted.len(), 1);

        let reason = bench.until_hung(1).await;

        assert!(reason.contains("no greeting"), "{reason}");
        bench.supervisor.command(1, Command::Kill);
        bench.until_exit(1).await;
        assert!(!is_running(pid));
    });
}

#[test]
fn a_component_that_ended_without_an_agent_is_said() {
    let (dir, pid) = die_over("loyal");
    end(pid);

    let said = refuse(dir);

    assert_eq!(said.len(), 1);
    assert_eq!(said[0].0, "ended-unwatched");
    assert!(said[0].1.contains("exit status unknown"), "{said:?}");
}

#[test]
fn a_stranger_under_a_reused_number_is_left_alone() {
    let (dir, pid) = die_over("loyal");
    let mut bystander = bystander();
    edit_journal(&dir, |entry| entry["pid"] = bystander.id().into());

    let said = refuse(dir);

    assert_eq!(said[0].0, "ended-unwatched");
    assert!(bystander.try_wait().unwrap().is_none());
    bystander.kill().unwrap();
    bystander.wait().unwrap();
    end(pid);
}

#[test]
fn what_another_boot_started_is_nobodys() {
    let (dir, pid) = die_over("shy");
    edit_journal(&dir, |entry| entry["boot_id"] = "of-yesterday".into());

    assert_eq!(refuse(dir), []);

    assert!(is_running(pid));
    end(pid);
}

/// A leftover is ended and said with this reason.
fn assert_ended(dir: TempDir, why: &str) {
    let said = refuse(dir);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0].0, "leftover-ended");
    assert!(said[0].1.contains(": ended, ") && said[0].1.contains(why), "{said:?}");
}

#[test]
fn a_process_of_an_older_agents_journal_is_ended() {
    let (dir, _) = die_over("loyal");
    edit_journal(&dir, |entry| {
        entry.as_object_mut().unwrap().remove("keepsake");
    });
    assert_ended(dir, "another version");
}

#[test]
fn a_keepsake_of_a_later_version_costs_only_the_adoption() {
    let (dir, _) = die_over("loyal");
    edit_journal(&dir, |entry| entry["keepsake"]["spec"] = "ff".into());
    assert_ended(dir, "another version");
}

#[test]
fn a_process_without_the_journals_badge_is_ended() {
    let (dir, _) = die_over("loyal");
    edit_journal(&dir, |entry| entry["keepsake"]["badge"] = "00".into());
    assert_ended(dir, "badge");
}

#[test]
fn a_component_that_is_to_stop_is_not_adopted() {
    let (dir, _) = die_over("waiting");
    assert_ended(dir, "to end with its agent");
}

#[test]
fn a_list_that_cannot_be_read_is_kept_aside_and_told() {
    let (dir, pid) = die_over("loyal");
    let list = dir.path().join("processes.json");
    let half = b"[{\"component\": \"mapp";
    fs::write(&list, half).unwrap();
    run(async {
        let bench = Bench::again(dir);

        assert!(bench.adopted.is_empty());
        let said = bench.events.since(0);
        let kept = bench.dir.path().join("processes.json.corrupt-1");
        assert_eq!(said.len(), 1, "{said:?}");
        assert_eq!(said[0].event.kind, "processes-corrupt");
        assert!(said[0].event.reason.contains(&kept.display().to_string()), "{said:?}");
        assert_eq!(fs::read(kept).unwrap(), half);
    });
    end(pid);
}

#[test]
fn what_can_be_read_of_a_list_is_adopted_and_the_list_kept_aside() {
    let (dir, pid) = die_over("loyal");
    let list = dir.path().join("processes.json");
    let mut entries: Vec<Json> = serde_json::from_slice(&fs::read(&list).unwrap()).unwrap();
    entries.push(serde_json::json!({ "process": "of a version that wrote otherwise" }));
    fs::write(&list, serde_json::to_vec(&entries).unwrap()).unwrap();
    run(async {
        let bench = Bench::again(dir);

        assert_eq!(bench.adopted.len(), 1);
        let said = bench.events.since(0);
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].event.reason.starts_with("entry 2: "), "{said:?}");
        let kept: Vec<Json> = serde_json::from_slice(
            &fs::read(bench.dir.path().join("processes.json.corrupt-1")).unwrap(),
        )
        .unwrap();
        assert_eq!(kept, entries);
    });
    end(pid);
}
