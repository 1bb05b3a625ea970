use super::*;

fn life(period_ms: u64) -> Life {
    let period = Duration::from_millis(period_ms);
    Life::new(Patience::default(), Execution::Periodic { period }, Instant::ZERO)
}

fn at(ms: u64) -> Instant {
    Instant::from_millis(ms)
}

fn hung(life: &mut Life, ms: u64) -> String {
    match life.overdue(at(ms)) {
        Some(Overdue::Hung(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_component_that_never_greets_is_told_once() {
    let mut life = life(20);
    assert_eq!(life.overdue(at(9_999)), None);
    assert!(matches!(life.overdue(at(10_000)), Some(Overdue::Hung(_))));
    assert_eq!(life.overdue(at(99_000)), None);
    assert_eq!(life.deadline(), None);
}

#[test]
fn initialising_may_take_a_minute() {
    let mut life = life(20);
    life.configured(at(1_000));
    assert_eq!(life.overdue(at(60_999)), None);
    assert!(matches!(life.overdue(at(61_000)), Some(Overdue::Hung(_))));
}

#[test]
fn beats_are_due_while_inactive_and_more_of_them_while_active() {
    let mut life = life(500);
    life.state(LifecycleState::Inactive, at(0));
    assert_eq!(life.deadline(), Some(at(3_000)));
    life.beat(at(2_900));
    assert_eq!(life.overdue(at(5_899)), None);
    assert!(hung(&mut life, 5_900).contains("no beat"));

    life.state(LifecycleState::Error, at(6_000));
    assert_eq!(life.deadline(), None);

    life.state(LifecycleState::Active, at(0));
    assert_eq!(life.deadline(), Some(at(2_500)));
    life.beat(at(400));
    assert_eq!(life.overdue(at(2_899)), None);
    assert!(matches!(life.overdue(at(2_900)), Some(Overdue::Hung(_))));

    life.beat(at(3_000));
    assert_eq!(life.deadline(), Some(at(5_500)));
}

#[test]
fn an_order_is_waited_for_instead_of_beats() {
    let mut life = life(20);
    life.configured(at(0));
    life.ordered("activate", at(0));
    life.state(LifecycleState::Inactive, at(30_000));
    // Its callback begins only now, and no beat comes while it runs.
    assert_eq!(life.overdue(at(44_999)), None);
    assert!(hung(&mut life, 45_000).contains("`activate` not answered"));
    assert_eq!(life.overdue(at(99_000)), None);
}

#[test]
fn orders_are_settled_one_by_one_by_states_and_refusals() {
    let mut life = life(20);
    life.state(LifecycleState::Inactive, at(0));
    for order in ["reset", "activate", "deactivate"] {
        life.ordered(order, at(0));
    }
    life.answered(at(10_000));
    assert_eq!(life.deadline(), Some(at(25_000)));
    life.state(LifecycleState::Active, at(20_000));
    assert!(hung(&mut life, 35_000).contains("`deactivate`"));
    life.state(LifecycleState::Inactive, at(36_000));
    assert_eq!(life.deadline(), Some(at(39_000)));
}

#[test]
fn a_reset_that_initialises_may_take_as_long_as_that() {
    let mut life = life(20);
    life.configured(at(0));
    life.state(LifecycleState::Error, at(0));
    life.ordered("reset", at(0));
    assert_eq!(life.deadline(), Some(at(60_000)));
}

#[test]
fn a_connection_that_is_not_opened_again_is_told() {
    let mut life = life(20);
    life.configured(at(0));
    life.unlinked(at(1_000));
    life.linked(at(1_200));
    assert_eq!(life.deadline(), Some(at(60_000)));
    life.state(LifecycleState::Error, at(2_000));
    life.unlinked(at(2_000));
    life.unlinked(at(2_900));
    assert_eq!(life.overdue(at(4_999)), None);
    assert!(hung(&mut life, 5_000).contains("connection closed"));
}

#[test]
fn one_that_ended_by_itself_must_be_gone_soon() {
    let mut life = life(20);
    life.state(LifecycleState::Finalized, at(0));
    life.unlinked(at(0));
    assert_eq!(life.overdue(at(14_999)), None);
    assert!(hung(&mut life, 15_000).contains("finalized"));
}

#[test]
fn an_agent_that_slept_judges_nobody() {
    let mut life = life(20);
    life.state(LifecycleState::Active, at(0));
    life.forgive(at(30_000));
    assert_eq!(life.overdue(at(30_000)), None);
}

#[test]
fn asking_comes_before_telling_and_telling_before_killing() {
    let mut life = life(20);
    life.state(LifecycleState::Active, at(0));
    life.finish(at(100));
    life.state(LifecycleState::Active, at(200));
    life.finish(at(900));
    assert_eq!(life.overdue(at(1_100)), Some(Overdue::Terminate));
    life.terminated(at(1_100));
    assert_eq!(life.overdue(at(3_099)), None);
    assert_eq!(life.overdue(at(3_100)), Some(Overdue::Kill));
    life.killed(at(3_100));
    assert_eq!(life.deadline(), None);
}
