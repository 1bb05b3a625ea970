//! Limits of a component's process, as far as the machine of the test enforces them.

use std::fs;

use sdr_tests::house::House;

/// Runs a script as a component under `limits`; the reason of its first end, and the kind of
/// event that told it.
fn end_of(house: &House, name: &str, script: &str, limits: &str) -> String {
    let describe = format!(
        "#!/bin/sh\nif [ \"$1\" = --describe ]; then\n  \
         echo '{{\"name\": \"{name}\", \"inputs\": [], \"outputs\": []}}'\n  exit 0\nfi\n{script}\n"
    );
    house.agents[0].install_script(name, &describe);
    let file = house.folder().join(format!("{name}.yaml"));
    let text = format!(
        "system: {name}\ncomponents:\n  {name}:\n    run: {{ native: {name} }}\n    \
         needs: {{ memory: 10MB, cpu: 5% }}\n    limits: {limits}\n"
    );
    fs::write(&file, text).unwrap();
    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    house.wait("its end", |house| end(house, name).is_some());
    let output = house.agents[0].sdr(&["undeploy", name]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    end(house, name).unwrap()
}

fn end(house: &House, name: &str) -> Option<String> {
    let exited = house.agents[0].events("exited").into_iter();
    let mut of =
        exited.filter(|one| one.event.component.as_ref().is_some_and(|c| c.as_str() == name));
    of.next().map(|one| one.event.reason)
}

#[test]
fn limits_are_set_before_the_component_runs_or_it_does_not() {
    let house = House::start(1);

    let script = "nice; grep Cpus_allowed_list /proc/self/status";
    let reason = end_of(&house, "nicely", script, "{ nice: 7, cores: [0] }");
    assert!(reason.starts_with("exit status 0; last output: 7 | "), "{reason}");
    assert!(reason.ends_with("Cpus_allowed_list:\t0"), "{reason}");

    // Field 40 is the priority, field 41 the policy; SCHED_FIFO is 1.
    let script = "cut -d' ' -f40,41 /proc/self/stat";
    let reason = end_of(&house, "first", script, "{ scheduling: { fifo: 40 } }");
    let set = reason == "exit status 0; last output: 40 1";
    let refused = reason.starts_with("exit status 126") && reason.contains("LimitRTPRIO");
    assert!(set || refused, "{reason}");

    let reason = end_of(&house, "nowhere", "echo started", "{ cores: [1000] }");
    assert!(reason.starts_with("exit status 126"), "{reason}");
    assert!(reason.contains("cores [1000]") && !reason.contains("started"), "{reason}");
}

#[test]
fn a_component_beyond_its_memory_is_told_from_a_crash() {
    let house = House::start(1);

    let script = "exec python3 -c 'print(len(bytearray(300_000_000)))'";
    let reason = end_of(&house, "greedy", script, "{ memory: 100MB }");
    assert!(reason.contains("MemoryError"), "{reason}");
    let told = house.agents[0].events("out-of-memory");
    assert_eq!(told[0].event.reason, reason);

    end_of(&house, "crashing", "exit 3", "{ nice: 1 }");
    let told = house.agents[0].events("out-of-memory");
    let of_crashing = |name: &str| name == "crashing";
    let mut components = told.iter().filter_map(|one| one.event.component.as_ref());
    assert!(!components.any(|name| of_crashing(name.as_str())), "{}", house.story());
}
