//! All that the authority said so far, as one file and as one list.

use std::collections::BTreeMap;

use crate::{
    holder::{Fingerprint, Holder},
    mesh_key::MeshKey,
    statement::{SignedDenial, SignedNotice, StatementError},
    trust::Trust,
};

/// Most certificates a fleet ever denies; more are refused.
const DENIALS_MAX: usize = 10_000;

/// Certificates that count no more, by number of their denial.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DenyList {
    denials: BTreeMap<u32, SignedDenial>,
    marks: BTreeMap<Fingerprint, Holder>,
}

impl DenyList {
    /// Takes a denial; whether it is news.
    pub fn add(&mut self, denial: SignedDenial) -> bool {
        let said = denial.denial();
        if self.denials.contains_key(&said.number) || self.denials.len() >= DENIALS_MAX {
            return false;
        }
        self.marks.insert(said.certificate, said.holder.clone());
        self.denials.insert(said.number, denial);
        true
    }

    /// Whose certificate that was, when it is denied.
    pub fn holder_of(&self, certificate: &Fingerprint) -> Option<&Holder> {
        self.marks.get(certificate)
    }

    /// Whether all denials up to this number are known.
    pub fn is_complete_to(&self, number: u32) -> bool {
        let known = u32::try_from(self.denials.range(1..=number).count()).unwrap_or(0);
        known == number
    }

    /// All of them, by number.
    pub fn iter(&self) -> impl Iterator<Item = &SignedDenial> {
        self.denials.values()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.denials.len()
    }

    /// Whether nobody was ever denied.
    pub fn is_empty(&self) -> bool {
        self.denials.is_empty()
    }
}

/// The newest key's notice and all denials that belong to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Papers {
    notice: SignedNotice,
    denied: DenyList,
}

impl Papers {
    /// The papers of `notice`, when `denied` holds all that belong to it.
    pub fn new(notice: SignedNotice, denied: DenyList) -> Option<Self> {
        denied.is_complete_to(notice.notice().denied).then_some(Self { notice, denied })
    }

    /// Reads and checks lines: the notice, then the denials.
    pub fn parse(text: &str, trust: &Trust) -> Result<Self, StatementError> {
        let mut lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        let notice = lines.next().ok_or(StatementError::Words("nothing at all"))?;
        let notice = trust.read_notice(notice)?;
        let mut denied = DenyList::default();
        for line in lines {
            denied.add(trust.read_denial(line)?);
        }
        Self::new(notice, denied).ok_or(StatementError::Words("denials are missing"))
    }

    /// The newest key's notice.
    pub fn notice(&self) -> &SignedNotice {
        &self.notice
    }

    /// Who is denied.
    pub fn denied(&self) -> &DenyList {
        &self.denied
    }

    /// Whether `key` is the key that the notice names.
    pub fn name(&self, key: &MeshKey) -> bool {
        let notice = self.notice.notice();
        key.id() == notice.key && key.check() == notice.check
    }

    /// The lines, as [`Papers::parse`] reads them.
    pub fn to_text(&self) -> String {
        let denials = self.denied.iter().map(SignedDenial::line);
        let lines = std::iter::once(self.notice.line()).chain(denials);
        lines.map(|line| format!("{line}\n")).collect()
    }
}
