//! Components that live and do not do what they should.

use super::*;

#[test]
fn a_component_without_beats_is_told_while_it_is_active() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "mute");
        bench.supervisor.command(1, Command::Activate(token(1)));
        bench.until_state(1, LifecycleState::Active).await;

        let reason = bench.until_hung(1).await;

        assert!(reason.contains("no beat"), "{reason}");
        bench.supervisor.command(1, Command::Kill);
        assert!(bench.until_exit(1).await.contains("signal 9"));
    });
}

#[test]
fn a_component_that_never_answers_an_order_is_told() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "stubborn");
        bench.supervisor.command(1, Command::Activate(token(1)));
        bench.until_state(1, LifecycleState::Inactive).await;

        let reason = bench.until_hung(1).await;

        assert!(reason.contains("`activate` not answered"), "{reason}");
        bench.supervisor.command(1, Command::Kill);
        assert!(bench.until_exit(1).await.contains("signal 9"));
    });
}

#[test]
fn an_inactive_component_without_beats_is_told() {
    run(async {
        let mut bench = Bench::with(|patience| patience.beat_idle = Duration::from_millis(600));
        bench.launch_component(1, "mute");
        bench.until_state(1, LifecycleState::Inactive).await;

        let reason = bench.until_hung(1).await;

        assert!(reason.contains("no beat"), "{reason}");
        bench.supervisor.command(1, Command::Kill);
        assert!(bench.until_exit(1).await.contains("signal 9"));
    });
}

#[test]
fn a_component_that_hangs_up_for_good_is_told() {
    run(async {
        let mut bench = Bench::with(|patience| patience.reconnect = Duration::from_millis(600));
        bench.launch_component(1, "gone");
        bench.until_state(1, LifecycleState::Inactive).await;

        let reason = bench.until_hung(1).await;

        assert!(reason.contains("connection closed"), "{reason}");
        bench.supervisor.command(1, Command::Kill);
        assert!(bench.until_exit(1).await.contains("signal 9"));
    });
}
