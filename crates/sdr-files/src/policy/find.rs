//! Finding policies by name, path or in place.

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::{
    near::allowed_words,
    problem::{Mark, Problems, Source},
    read::{At, Read, Reader},
    tree::{Body, Node, parse_yaml},
};

/// Longest chain of `extends`.
const EXTENDS_MAX: usize = 8;

/// A policy as it is written, on its way to a checked one.
pub(crate) trait PolicyFile: Read + JsonSchema {
    /// The checked policy.
    type Policy;
    /// `allocation`, `recovery` or `role`.
    const KIND: &'static str;
    /// Policies that every agent knows: name and text.
    const BUILT_IN: &'static [(&'static str, &'static str)];

    /// The policy by its built-in default, for systems that name none.
    fn standard() -> Self::Policy;

    /// The checked policy; `name` is taken when the file gives none.
    fn checked(self, at: Finding<'_>, reader: &mut Reader) -> Option<Self::Policy>;
}

/// What the checks of a policy know besides its text.
#[derive(Debug)]
pub(crate) struct Finding<'a> {
    /// Its tree, for the places of keys.
    pub(crate) tree: &'a Node,
    /// Where others are found.
    pub(crate) finder: &'a Finder,
    /// The name when the file gives none; `None` when it must.
    pub(crate) name: Option<&'a str>,
}

/// What stands behind `allocation:` or `recovery:` in a system.
#[derive(Clone, Debug)]
pub(crate) enum PolicyEntry<F> {
    Named(String),
    Inline(F, Box<Node>),
}

impl<F: Read> Read for PolicyEntry<F> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::Table(_)) {
            return F::read(node, reader).map(|file| Self::Inline(file, Box::new(node.clone())));
        }
        reader.text(node, "the name of a policy, a path, or the policy itself")?;
        String::read(node, reader).map(Self::Named)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [String::schema(generator), F::schema(generator)] })
    }
}

/// Where names are looked up, and what was read on the way.
#[derive(Clone, Debug)]
pub(crate) struct Finder {
    folder: PathBuf,
    read: Vec<String>,
}

impl Finder {
    /// Looks from the folder of the file at `path`.
    pub(crate) fn beside(path: &Path) -> Self {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Self { folder, read: vec![path.display().to_string()] }
    }

    /// Looks from `folder`.
    pub(crate) fn from(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), read: Vec::new() }
    }

    /// The policy that `entry` names or holds; a policy without a name is called `name`.
    pub(crate) fn entry<F: PolicyFile>(
        &self,
        entry: At<PolicyEntry<F>>,
        name: &str,
        reader: &mut Reader,
    ) -> Option<F::Policy> {
        match entry.value {
            PolicyEntry::Named(word) => {
                self.named::<F>(&At { value: word, mark: entry.mark }, reader)
            }
            PolicyEntry::Inline(file, tree) => {
                file.checked(Finding { tree: &tree, finder: self, name: Some(name) }, reader)
            }
        }
    }

    /// The policy called `word`, a name or a path.
    pub(crate) fn named<F: PolicyFile>(
        &self,
        word: &At<String>,
        reader: &mut Reader,
    ) -> Option<F::Policy> {
        let (source, finder) = self.source::<F>(word, reader)?;
        if self.read.iter().any(|file| file == source.file()) || self.read.len() >= EXTENDS_MAX {
            let message = format!("`{}` leads back to itself by `extends`", word.value);
            reader.problem(word.mark, message, None);
            return None;
        }
        match load::<F>(source, &finder) {
            Ok(policy) => Some(policy),
            Err(problems) => {
                reader.adopt(problems);
                None
            }
        }
    }

    /// The text of the policy called `word`, and where its own names are looked up.
    fn source<F: PolicyFile>(
        &self,
        word: &At<String>,
        reader: &mut Reader,
    ) -> Option<(Source, Self)> {
        let name = word.value.as_str();
        let as_path = name.contains('/') || name.ends_with(".yaml") || name.ends_with(".yml");
        let paths = if as_path { vec![self.folder.join(name)] } else { self.paths::<F>(name) };
        let found = paths.iter().find(|path| path.is_file() && !self.has_read(path));
        if let Some(path) = found.or(if as_path { paths.first() } else { None }) {
            return match Source::load(path) {
                Ok(source) => Some((source, self.within(path))),
                Err(problems) => {
                    let why = problems.as_slice()[0].message.clone();
                    reader.problem(word.mark, format!("{}: {why}", path.display()), None);
                    None
                }
            };
        }
        if let Some((_, text)) = F::BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
            let file = format!("policies/{}/{name}.yaml (built in)", F::KIND);
            let mut read = self.read.clone();
            read.push(file.clone());
            return Some((Source::new(&file, text), Self { folder: self.folder.clone(), read }));
        }
        let built_in: Vec<&str> = F::BUILT_IN.iter().map(|(name, _)| *name).collect();
        let message = format!("unknown {} policy `{name}`", F::KIND);
        let help = format!(
            "built in are {}; others stand in policies/{}/{name}.yaml, here or one folder above",
            allowed_words(name, &built_in).trim_start_matches("allowed: "),
            F::KIND,
        );
        reader.problem(word.mark, message, Some(help));
        None
    }

    fn paths<F: PolicyFile>(&self, name: &str) -> Vec<PathBuf> {
        let file = format!("{name}.yaml");
        let below = Path::new("policies").join(F::KIND).join(&file);
        let mut paths = vec![self.folder.join(&below)];
        if self.folder.as_os_str().is_empty() {
            paths.push(Path::new("..").join(&below));
        } else if let Some(above) = self.folder.parent() {
            paths.push(above.join(&below));
        }
        // A policy extends its neighbours; beside a system stand no policies.
        if !self.read.is_empty() {
            paths.push(self.folder.join(&file));
        }
        paths
    }

    fn has_read(&self, path: &Path) -> bool {
        let name = path.display().to_string();
        self.read.contains(&name)
    }

    fn within(&self, path: &Path) -> Self {
        let mut next = Self::beside(path);
        next.read.splice(0..0, self.read.iter().cloned());
        next
    }
}

/// Reads and checks the policy in `source`.
pub(super) fn load<F: PolicyFile>(source: Source, finder: &Finder) -> Result<F::Policy, Problems> {
    let mut reader = Reader::new(source.clone());
    let tree = parse_yaml(&source).map_err(Problems::of)?;
    let policy = F::read(&tree, &mut reader)
        .and_then(|file| file.checked(Finding { tree: &tree, finder, name: None }, &mut reader));
    reader.finish(policy)
}

impl Finding<'_> {
    /// The policy's name, or the problem that there is none.
    pub(super) fn name(
        &self,
        given: Option<At<String>>,
        key: &str,
        reader: &mut Reader,
    ) -> Option<String> {
        const NAME_BYTES_MAX: usize = 64;
        match (given, self.name) {
            (Some(name), _) if name.value.len() <= NAME_BYTES_MAX => Some(name.value),
            (Some(name), _) => {
                let message = format!("the name has {} bytes", name.value.len());
                let help = format!("allowed: at most {NAME_BYTES_MAX}");
                reader.problem(name.mark, message, Some(help));
                None
            }
            (None, Some(name)) => Some(name.to_owned()),
            (None, None) => {
                let message = format!("key `{key}` (the policy's name) is missing");
                reader.problem(self.tree.mark, message, None);
                None
            }
        }
    }

    /// The place of `key`, below `above` when that is given.
    pub(super) fn mark(&self, above: Option<&str>, key: &str) -> Mark {
        let from = match above {
            Some(above) => self.tree.find_key(above).map_or(self.tree, |(_, node)| node),
            None => self.tree,
        };
        from.find_key(key).map_or(self.tree.mark, |(key, _)| key.mark)
    }
}
