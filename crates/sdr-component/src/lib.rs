//! What a component author uses: `trait Component`, typed ports, `run()`.

pub mod protocol;
