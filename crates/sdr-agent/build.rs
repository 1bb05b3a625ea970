//! Links the agent with packed relative relocations: half a megabyte less to copy to a robot.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // glibc 2.36 (Debian 12) and newer load them; other C libraries are left alone
    let of_target = |word: &str| std::env::var(format!("CARGO_CFG_TARGET_{word}"));
    if of_target("OS").as_deref() == Ok("linux") && of_target("ENV").as_deref() == Ok("gnu") {
        println!("cargo::rustc-link-arg-bins=-Wl,-z,pack-relative-relocs");
    }
}
