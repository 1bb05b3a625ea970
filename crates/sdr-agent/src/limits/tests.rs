use sdr_core::units::{Bytes, Permille};

use super::*;
use crate::supervisor::tests::order;

fn words(confinement: &Confinement) -> Vec<&str> {
    confinement.helper.iter().map(|word| word.to_str().unwrap()).collect()
}

fn limited() -> LaunchOrder {
    let mut order = order(7, "lidar", Vec::new(), "");
    order.spec.limits = Limits {
        memory: Some(Bytes::mega(800)),
        cpu: Some(Permille(1000)),
        pids: Some(64),
        nice: Some(5),
        fifo: Some(40),
        cores: vec![0, 1],
        lock_memory: true,
    };
    order
}

#[test]
fn without_groups_rlimits_hold_what_they_can_and_the_rest_is_said() {
    let limiter = Limiter::open(&Cgroup::Off);

    let confinement = limiter.confine(&limited()).unwrap();

    let wanted = ["--data", "800000000", "--nice", "5", "--fifo", "40", "--cores", "0,1", "--lock"];
    assert_eq!(words(&confinement), wanted);
    assert_eq!(confinement.unenforced, ["cpu", "pids"]);
    assert_eq!(confinement.group, None);
}

#[test]
fn groups_hold_memory_cpu_and_processes() {
    let tree = tempfile::tempdir().unwrap();
    std::fs::write(tree.path().join("cgroup.controllers"), "cpu memory pids").unwrap();
    let limiter = Limiter::open(&Cgroup::Below(tree.path().into()));

    let confinement = limiter.confine(&limited()).unwrap();

    let group = tree.path().join("c-mapping.lidar.7");
    let said = words(&confinement);
    assert_eq!(said[..2], ["--group", group.to_str().unwrap()]);
    assert!(!said.contains(&"--data"));
    assert!(confinement.unenforced.is_empty());
    assert_eq!(confinement.group, Some(group));
}

#[test]
fn a_component_without_limits_needs_no_helper() {
    let confinement =
        Limiter::open(&Cgroup::Off).confine(&order(7, "lidar", Vec::new(), "")).unwrap();
    assert!(confinement.helper.is_empty() && confinement.unenforced.is_empty());
}
