//! What the policy files say.

use sdr_recovery::{Bar, Level, Trigger};

use super::*;

fn allocation(text: &str) -> Result<AllocationPolicy, Problems> {
    find::load::<AllocationFile>(Source::new("a.yaml", text), &Finder::from(Path::new("/nowhere")))
}

fn recovery(text: &str) -> Result<RecoveryPolicy, Problems> {
    find::load::<RecoveryFile>(Source::new("r.yaml", text), &Finder::from(Path::new("/nowhere")))
}

fn role(text: &str) -> Result<RolePolicy, Problems> {
    find::load::<RoleFile>(Source::new("c.yaml", text), &Finder::from(Path::new("/nowhere")))
}

#[test]
fn the_default_files_say_what_is_built_in() {
    let placing = allocation(include_str!("../../../../policies/allocation/default.yaml"));
    assert_eq!(placing.unwrap(), AllocationPolicy::default());

    let mending = recovery(include_str!("../../../../policies/recovery/default.yaml"));
    assert_eq!(mending.unwrap(), RecoveryPolicy::default());

    let coordinating = role(include_str!("../../../../policies/role/default.yaml"));
    assert_eq!(coordinating.unwrap(), RolePolicy::default());
}

#[test]
fn a_role_policy_that_extends_changes_only_what_it_names_and_others_have_no_bars() {
    let policy = role(
        "role: base-first\nextends: default\nweights: { links: 9 }\nbars: { rssi: none, battery: \
         { at_least: 35.5% } }\npinned: [robot-9]\nmargin: 300\nalone: wait\n",
    )
    .unwrap();
    let mut expected = RolePolicy { name: "base-first".into(), ..RolePolicy::default() };
    expected.weights.links = 9;
    expected.bars.rssi_min = None;
    expected.bars.battery_min = Some(sdr_core::units::Permille(355));
    expected.pinned = vec![sdr_core::id::RobotId::new("robot-9").unwrap()];
    expected.margin = 300;
    expected.alone = sdr_core::fitness::Alone::Wait;
    assert_eq!(policy, expected);

    let bare = role("role: bare\n").unwrap();
    assert_eq!(bare.bars, sdr_core::fitness::RoleBars::default());
    assert_eq!(bare.weights, RolePolicy::default().weights);
}

#[test]
fn a_role_policy_as_text_is_read_back_as_the_same() {
    let odd = role(
        "role: 'Base: \"first\"'\nextends: default\nbars: { battery: { at_least: 12.5% }, rssi: \
         { at_least: -62.5dBm }, loss: none }\npinned: ['true', robot-1]\nforbidden: [off]\n\
         margin_for: 1500ms\nbeat: 50.001ms\nstagger: 0s\nalone: wait\n",
    )
    .unwrap();
    for policy in [odd, RolePolicy::default()] {
        let text = role_text(&policy);
        assert_eq!(role(&text).unwrap(), policy, "{text}");
    }
}

#[test]
fn the_exploration_files_say_tables_v_and_vi() {
    let placing =
        allocation(include_str!("../../../../policies/allocation/exploration.yaml")).unwrap();
    assert_eq!(placing.strategy, sdr_alloc::Strategy::FirstFit);
    assert_eq!(placing.strict.memory_free_at_least.unwrap().0, 500_000_000);
    assert!(!placing.strict.judge_links());
    assert_eq!(placing.relaxed.unwrap().memory_free_at_least.unwrap().0, 250_000_000);

    let mending = recovery(include_str!("../../../../policies/recovery/exploration.yaml")).unwrap();
    let rules = &mending.parts().rules;
    let rssi = rules.iter().find(|rule| rule.cause.word() == "rssi-low").unwrap();
    let Trigger::Condition(rssi) = rssi.trigger else { panic!("{rssi:?}") };
    let Bar::AtMost(Level::Signal(bar)) = rssi.bar else { panic!("{rssi:?}") };
    assert_eq!(bar.tenths(), -525);
    assert_eq!(rssi.hold.as_secs(), 6);
    assert_eq!(rssi.median_over.as_secs(), 1);
    assert!(!rules.iter().any(|rule| rule.cause.word() == "battery-low"));
}

#[test]
fn a_policy_that_extends_changes_only_what_it_names() {
    let policy = allocation(
        "allocation: tired\nextends: default\noverride:\n  robot: { battery: { at_least: 50%, \
         if_needs_cpu: 50% } }\n  link: { rssi: none }\n  score: { battery: 3.0 }\n",
    )
    .unwrap();

    let usual = AllocationPolicy::default();
    assert_eq!(policy.strict.memory_free_at_least, usual.strict.memory_free_at_least);
    assert_eq!(policy.strict.battery_at_least.unwrap().at_least.0, 500);
    assert_eq!(policy.strict.rssi_at_least, None);
    assert_eq!(policy.weights.battery.0, 3000);
    assert_eq!(policy.name, "tired");
}

#[test]
fn a_level_must_have_the_unit_of_its_fact() {
    let problems = recovery(
        "recovery: r\nextends: default\noverride:\n  rssi-low: { at_most: 200MB }\n  \
         memory-short: { clear: 50MB for 5s }\n  exited: { for: 5s }\n",
    )
    .unwrap_err();

    let text = problems.to_string();
    for part in [
        "r.yaml:4:24: `200MB` has the unknown unit `MB`",
        "allowed: robot.rssi is a level such as -80dBm",
        "clear at 50 MB is inside the fault; allowed: 100 MB or more",
        "exited is reported as it happens",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}
