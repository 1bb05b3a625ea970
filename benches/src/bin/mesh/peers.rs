//! What others reach, quoted: the paper, published defaults, and SWIM as simulated.

/// One row's words about each of them; empty where it says nothing of it.
#[derive(Clone, Copy)]
pub(crate) struct Peers {
    pub(crate) paper: &'static str,
    /// memberlist's defaults, simulated with foca beside this mesh, and tuned.
    pub(crate) swim: &'static str,
    pub(crate) consul: &'static str,
    pub(crate) nomad: &'static str,
    pub(crate) dora: &'static str,
}

impl Peers {
    /// Nobody is known to reach anything of this.
    pub(crate) const NONE: Self = Self { paper: "", swim: "", consul: "", nomad: "", dora: "" };

    /// Begins the table.
    pub(crate) fn head() {
        println!("| what | bar | measured | the paper | SWIM | Consul | Nomad | dora |");
        println!("|---|---|---|---|---|---|---|---|");
    }

    /// One line of it.
    pub(crate) fn row(&self, what: &str, bar: &str, measured: &str) {
        let word = |word: &'static str| if word.is_empty() { "-" } else { word };
        let others = [self.paper, self.swim, self.consul, self.nomad, self.dora].map(word);
        println!("| {what} | {bar} | {measured} | {} |", others.join(" | "));
    }
}
