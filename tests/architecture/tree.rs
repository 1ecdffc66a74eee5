//! The modules of all crates, and where a path leads.

use std::collections::{BTreeMap, BTreeSet};

use super::syntax::{self, Import, Module};

/// Imports of imports are followed so far.
const MOST_TURNS: usize = 16;

/// Texts by path from the top of the repository.
pub(crate) type Sources = BTreeMap<String, String>;

/// A module: its crate and the names that lead to it from there.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub(crate) krate: String,
    pub(crate) path: Vec<String>,
}

impl Place {
    fn top(krate: &str) -> Place {
        let (krate, path) = (krate.to_owned(), vec![]);
        Place { krate, path }
    }

    fn child(&self, name: &str) -> Place {
        let mut path = self.path.clone();
        path.push(name.to_owned());
        let krate = self.krate.clone();
        Place { krate, path }
    }

    fn parent(&self) -> Place {
        let krate = self.krate.clone();
        let path = self.path[..self.path.len().saturating_sub(1)].to_vec();
        Place { krate, path }
    }

    /// The module at the top that it belongs to; `lib` at the very top.
    pub(crate) fn room(&self) -> &str {
        self.path.first().map_or("lib", String::as_str)
    }
}

/// One line of one file that names something in another file, or in another crate than ours.
#[derive(Clone, Debug)]
pub(crate) struct Use {
    pub(crate) from: Place,
    pub(crate) file: String,
    pub(crate) line: usize,
    /// As written.
    pub(crate) written: String,
    /// With the first name looked up, where it is no module of ours: `std::time::Instant`.
    pub(crate) foreign: Option<Vec<String>>,
    /// The modules that show it to those who ask there, and last the one whose file has it.
    pub(crate) through: Vec<Place>,
}

/// Every module of every crate.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    modules: BTreeMap<Place, Module>,
    files: BTreeMap<Place, String>,
    /// Folders of the crates, by name.
    crates: BTreeMap<String, String>,
}

impl Tree {
    /// Reads `folder/src` of each crate, whose library has the name of the folder.
    pub(crate) fn read(sources: &Sources, folders: &[&str]) -> Tree {
        let mut tree = Tree::default();
        for folder in folders {
            let name = folder.rsplit('/').next().unwrap_or_default();
            tree.crates.insert(name.to_owned(), (*folder).to_owned());
            for (root, path) in [("lib", vec![]), ("main", vec!["main".to_owned()])] {
                let file = format!("{folder}/src/{root}.rs");
                if sources.contains_key(&file) {
                    let krate = name.to_owned();
                    let beside = format!("{folder}/src");
                    tree.file(sources, Place { krate, path }, file, &beside);
                }
            }
        }
        tree
    }

    /// `beside`: the folder where the files of its children are.
    fn file(&mut self, sources: &Sources, place: Place, file: String, beside: &str) {
        let module = syntax::module(&sources[&file]);
        self.module(sources, place, module, &file, beside);
    }

    fn module(
        &mut self,
        sources: &Sources,
        place: Place,
        mut module: Module,
        file: &str,
        beside: &str,
    ) {
        for name in &module.declared {
            let below = format!("{beside}/{name}");
            let candidates = [format!("{below}/mod.rs"), format!("{below}.rs")];
            if let Some(child) = candidates.into_iter().find(|f| sources.contains_key(f)) {
                self.file(sources, place.child(name), child, &below);
            }
        }
        for (name, inner) in std::mem::take(&mut module.inline) {
            let below = format!("{beside}/{name}");
            self.module(sources, place.child(&name), inner, file, &below);
        }
        self.files.insert(place.clone(), file.to_owned());
        self.modules.insert(place, module);
    }

    /// The rooms of a crate: its modules at the top, and `lib`.
    pub(crate) fn rooms(&self, krate: &str) -> BTreeSet<&str> {
        let of_it = self.modules.keys().filter(|place| place.krate == krate);
        of_it.map(Place::room).collect()
    }

    /// The folder of the sources of a crate.
    pub(crate) fn sources(&self, krate: &str) -> String {
        format!("{}/src", self.crates[krate])
    }

    /// Whether a module has a file of its own.
    fn has_file(&self, place: &Place) -> bool {
        place.path.is_empty() || self.files.get(place) != self.files.get(&place.parent())
    }

    /// The module that has the file in which it stands.
    pub(crate) fn owner(&self, place: &Place) -> Place {
        let mut place = place.clone();
        while !self.has_file(&place) {
            place = place.parent();
        }
        place
    }

    /// Whatever a file names in another.
    pub(crate) fn uses(&self) -> Vec<Use> {
        let mut found = Vec::new();
        for (place, module) in &self.modules {
            let imports = module.imports.iter();
            let imports = imports.filter(|import| !self.only_shows(place, module, import));
            found.extend(imports.filter_map(|i| self.looked_up(place, &i.path, i.line)));
            let paths = module.paths.iter();
            found.extend(paths.filter_map(|(path, line)| self.looked_up(place, path, *line)));
            let macros = module.called.iter().filter_map(|(name, line)| {
                let path = self.path_of_macro(place, name)?;
                self.looked_up(place, &path, *line)
            });
            found.extend(macros);
        }
        found
    }

    /// A module that shows what one of its children has does not use the child, unless its own code names it too.
    fn only_shows(&self, place: &Place, module: &Module, import: &Import) -> bool {
        let mut through = Vec::new();
        self.follow(place, &import.path, &mut through, 0);
        let inside = |to: &Place| to.krate == place.krate && to.path.starts_with(&place.path);
        import.public && !module.words.contains(&import.name) && through.last().is_some_and(inside)
    }

    /// Of a macro that is called by its bare name and made by some other file of the crate.
    fn path_of_macro(&self, place: &Place, name: &str) -> Option<Vec<String>> {
        let mut all = self.modules.iter();
        let (at, _) = all.find(|(p, m)| p.krate == place.krate && m.macros.contains(name))?;
        let top = std::iter::once("crate");
        let path = top.chain(at.path.iter().map(String::as_str)).chain([name]);
        Some(path.map(str::to_owned).collect())
    }

    fn looked_up(&self, place: &Place, path: &[String], line: usize) -> Option<Use> {
        let mut through = Vec::new();
        let foreign = self.follow(place, path, &mut through, 0);
        let leaves = through.last().is_some_and(|to| to != place) || foreign.is_some();
        leaves.then(|| Use {
            from: place.clone(),
            file: self.files[place].clone(),
            line,
            written: path.join("::"),
            foreign,
            through,
        })
    }

    /// Goes where `path` leads from `place`; what is not ours comes back.
    fn follow(
        &self,
        place: &Place,
        path: &[String],
        through: &mut Vec<Place>,
        turns: usize,
    ) -> Option<Vec<String>> {
        let (first, mut rest) = path.split_first()?;
        let module = &self.modules[place];
        let mut at = match first.as_str() {
            "crate" => Place::top(&place.krate),
            "self" => place.clone(),
            "super" => place.parent(),
            // `::name` is a crate, whatever is here
            "" => match rest.split_first() {
                Some((krate, rest)) if self.crates.contains_key(krate) => {
                    return self.inside(Place::top(krate), rest, through, turns);
                }
                _ => return Some(rest.to_vec()),
            },
            name if self.modules.contains_key(&place.child(name)) => place.child(name),
            name => {
                let import = module.imports.iter().find(|import| import.name == name);
                // `use a::a` does not import itself
                let import = import.filter(|import| !import.path.starts_with(path));
                let import = import.or_else(|| self.behind_a_star(place, module, name));
                return match (import, self.crates.get_key_value(name)) {
                    (Some(import), _) if turns < MOST_TURNS => {
                        let rest = if import.name == "*" { path } else { rest };
                        let path = [&import.path, rest].concat();
                        self.follow(place, &path, through, turns + 1)
                    }
                    (_, Some((krate, _))) if *krate != place.krate || place.room() == "main" => {
                        self.inside(Place::top(krate), rest, through, turns)
                    }
                    _ if module.defined.contains(name) => None,
                    _ => Some(path.to_vec()),
                };
            }
        };
        while rest.first().is_some_and(|name| name == "super") {
            (at, rest) = (at.parent(), &rest[1..]);
        }
        self.inside(at, rest, through, turns)
    }

    /// Goes on inside a module.
    fn inside(
        &self,
        at: Place,
        rest: &[String],
        through: &mut Vec<Place>,
        turns: usize,
    ) -> Option<Vec<String>> {
        let module = self.modules.get(&at)?;
        let Some((name, further)) = rest.split_first() else {
            through.push(at);
            return None;
        };
        if self.modules.contains_key(&at.child(name)) {
            return self.inside(at.child(name), further, through, turns);
        }
        through.push(at.clone());
        if name == "*" || turns > MOST_TURNS {
            return None;
        }
        let import = module.imports.iter().find(|import| import.name == *name);
        let import = import.or_else(|| self.behind_a_star(&at, module, name));
        let import = import.filter(|_| !module.defined.contains(name))?;
        let path = match import.name.as_str() {
            "*" => [&import.path, rest].concat(),
            _ => [&import.path, further].concat(),
        };
        // what comes from elsewhere through a module of ours is not ours, and no matter here
        self.follow(&at, &path, through, turns + 1);
        None
    }

    /// The `use x::*` that brings `name` in, where `x` is ours.
    fn behind_a_star<'a>(&self, at: &Place, module: &'a Module, name: &str) -> Option<&'a Import> {
        let is_ours = |first: &str| {
            matches!(first, "crate" | "self" | "super")
                || self.modules.contains_key(&at.child(first))
                || self.crates.contains_key(first)
        };
        let mut stars = module.imports.iter().filter(|import| import.name == "*");
        stars.find(|star| {
            let mut through = Vec::new();
            if star.path.first().is_some_and(|first| is_ours(first)) {
                self.follow(at, &star.path, &mut through, 1);
            }
            through.last().is_some_and(|place| {
                let target = &self.modules[place];
                target.defined.contains(name)
                    || target.imports.iter().any(|import| import.name == name)
                    || self.modules.contains_key(&place.child(name))
            })
        })
    }
}
