//! The rooms of the framework, and the circles of all crates: which file may use which.
//!
//! A file uses another where a path of its code, outside of its unit tests, leads there. A path that
//! ends at a re-export of a room counts as a path to the file that defines the name.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::root;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// Rooms of the framework from the lowest to the highest.
const ROOMS: [&str; 14] = [
    "calendar",
    "checkpoint",
    "input",
    "files",
    "document",
    "units",
    "state",
    "model",
    "compose",
    "plugin",
    "filter",
    "smooth",
    "session",
    "run",
];

/// Largest number of files in a circle: a trait and its context may know each other.
const CIRCLE: usize = 2;

type Module = Vec<String>;

/// Source of a crate: its modules, each with its file.
struct Source {
    files: BTreeMap<Module, (PathBuf, syn::File)>,
}

/// Paths of a file's code that begin with `crate` or `super`.
#[derive(Default)]
struct Paths(Vec<Vec<String>>);

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("cfg") && a.parse_args::<syn::Path>().is_ok_and(|p| p.is_ident("test"))
    })
}

/// Full paths of a tree of imports.
fn imports(tree: &syn::UseTree, before: &[String], found: &mut Vec<Vec<String>>) {
    let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
    match tree {
        syn::UseTree::Path(path) => imports(&path.tree, &with(&path.ident), found),
        syn::UseTree::Name(name) if name.ident == "self" => found.push(before.to_vec()),
        syn::UseTree::Name(name) => found.push(with(&name.ident)),
        syn::UseTree::Rename(name) => found.push(with(&name.ident)),
        syn::UseTree::Glob(_) => found.push(before.to_vec()),
        syn::UseTree::Group(group) => {
            group.items.iter().for_each(|tree| imports(tree, before, found));
        }
    }
}

impl<'a> Visit<'a> for Paths {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }
    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        imports(&item.tree, &[], &mut self.0);
    }
    fn visit_visibility(&mut self, _: &'a syn::Visibility) {} // `pub(super)` uses nothing
    fn visit_path(&mut self, path: &'a syn::Path) {
        self.0.push(path.segments.iter().map(|s| s.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

impl Source {
    fn read(folder: &Path) -> Self {
        let mut source = Self { files: BTreeMap::new() };
        source.add(folder, &Vec::new());
        source
    }

    fn add(&mut self, folder: &Path, module: &Module) {
        for entry in std::fs::read_dir(folder).expect("the folder is there") {
            let path = entry.expect("it can be read").path();
            let stem = path.file_stem().and_then(|s| s.to_str()).expect("a name").to_owned();
            let inner = [module.as_slice(), std::slice::from_ref(&stem)].concat();
            if path.is_dir() {
                self.add(&path, &inner);
            } else if path.extension().is_some_and(|e| e == "rs") && stem != "tests" {
                let text = std::fs::read_to_string(&path).expect("a text");
                let file = syn::parse_file(&text).unwrap_or_else(|e| panic!("{path:?}: {e}"));
                let here = matches!(stem.as_str(), "mod" | "lib" | "main");
                self.files.insert(if here { module.clone() } else { inner }, (path, file));
            }
        }
    }

    /// Module in which the name at the end of a path is defined.
    fn definer(&self, from: &Module, path: &[String]) -> Option<Module> {
        let mut at: Module = match path.first()?.as_str() {
            "crate" => Vec::new(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            "self" => from.clone(),
            first => {
                let child = [from.as_slice(), &[first.to_owned()]].concat();
                self.files.contains_key(&child).then_some(())?;
                child
            }
        };
        for name in &path[1..] {
            if name == "super" {
                at.pop();
                continue;
            }
            let inner = [at.as_slice(), std::slice::from_ref(name)].concat();
            if self.files.contains_key(&inner) {
                at = inner;
                continue;
            }
            return Some(self.re_exported(&at, name).unwrap_or(at));
        }
        Some(at)
    }

    /// Module from which a room re-exports a name.
    fn re_exported(&self, room: &Module, name: &str) -> Option<Module> {
        let (_, file) = self.files.get(room)?;
        let uses = file.items.iter().filter_map(|item| match item {
            syn::Item::Use(item) if !matches!(item.vis, syn::Visibility::Inherited) => Some(item),
            _ => None,
        });
        let mut paths = Vec::new();
        uses.for_each(|item| imports(&item.tree, &[], &mut paths));
        let path = paths.into_iter().find(|p| p.last().is_some_and(|last| last == name))?;
        self.definer(room, &path)
    }

    /// Whether a file only declares modules and re-exports their names.
    fn only_declares(&self, module: &Module) -> bool {
        let declares = |item: &syn::Item| match item {
            syn::Item::Mod(item) => item.content.is_none(),
            syn::Item::Use(_) => true,
            _ => false,
        };
        self.files[module].1.items.iter().all(declares)
    }

    /// For each file, the files that it uses.
    fn arrows(&self) -> BTreeMap<&Module, BTreeSet<Module>> {
        let mut arrows = BTreeMap::new();
        for (module, (_, file)) in &self.files {
            if self.only_declares(module) || module.is_empty() {
                continue; // a room's door, and the front page of the crate
            }
            let mut paths = Paths::default();
            paths.visit_file(file);
            let used = paths.0.iter().filter_map(|path| self.definer(module, path));
            let other = |used: &Module| used != module && !used.is_empty();
            arrows.insert(module, used.filter(other).collect());
        }
        arrows
    }
}

/// Modules that a module leads to.
fn reached(arrows: &BTreeMap<&Module, BTreeSet<Module>>, from: &Module) -> BTreeSet<Module> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from.clone()]);
    while let Some(module) = open.pop() {
        for next in arrows.get(&module).into_iter().flatten() {
            if reached.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    reached
}

/// Groups of files that use one another in a circle, largest first.
fn circles(source: &Source) -> Vec<Vec<String>> {
    let arrows = source.arrows();
    let reach: BTreeMap<&Module, BTreeSet<Module>> =
        arrows.keys().map(|m| (*m, reached(&arrows, m))).collect();
    let circle = |m: &Module| -> Vec<String> {
        let both = |other: &&Module| reach[m].contains(*other) && reach[*other].contains(m);
        reach.keys().copied().filter(both).map(|m| m.join("::")).collect()
    };
    let found: BTreeSet<Vec<String>> = reach.keys().map(|m| circle(m)).collect();
    found.into_iter().filter(|c| c.len() > 1).collect()
}

/// Folders of source of all crates below a folder, at any depth.
fn crates(folder: &Path, found: &mut Vec<PathBuf>) {
    if folder.join("Cargo.toml").exists() && folder.join("src").is_dir() {
        found.push(folder.join("src"));
    }
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        let name = path.file_name().and_then(|n| n.to_str()).expect("a name");
        if path.is_dir() && !name.starts_with('.') && !matches!(name, "target" | "src") {
            crates(&path, found);
        }
    }
}

/// All files of sources below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// A file of unit tests beside its source may be longer.
#[test]
fn no_file_of_sources_has_more_than_470_lines() {
    let (mut folders, mut files) = (Vec::new(), Vec::new());
    crates(root(), &mut folders);
    folders.iter().for_each(|folder| sources(folder, &mut files));
    assert!(files.len() > 500, "{} files", files.len());
    for file in files {
        let name = file.file_stem().and_then(|n| n.to_str()).expect("a name");
        let lines = std::fs::read_to_string(&file).expect("it can be read").lines().count();
        assert!(name.ends_with("tests") || lines <= 470, "{}: {lines} lines", file.display());
    }
}

#[test]
fn no_circle_of_any_crate_has_more_than_two_files() {
    let mut folders = Vec::new();
    crates(root(), &mut folders);
    assert!(folders.contains(&root().join("plugins/formats/mcap/src")), "{folders:#?}");
    let mut large = Vec::new();
    for folder in &folders {
        let circles = circles(&Source::read(folder)).into_iter().filter(|c| c.len() > CIRCLE);
        large.extend(circles.map(|c| format!("{}: {c:?}", folder.display())));
    }
    assert!(large.is_empty(), "circles of more than {CIRCLE} files: {large:#?}");
}

#[test]
fn each_room_of_the_framework_uses_only_the_rooms_below_it() {
    let source = Source::read(&root().join("framework/src"));
    let rank = |module: &Module| {
        let room = &module[0];
        ROOMS.iter().position(|r| r == room).unwrap_or_else(|| panic!("{room} is no room"))
    };
    let mut upward = Vec::new();
    for (module, used) in source.arrows() {
        if module.len() == 1 && module[0] == "prelude" {
            continue; // names from every room, for the authors of plugins
        }
        let above = used.iter().filter(|u| rank(u) > rank(module));
        upward.extend(above.map(|u| format!("{} -> {}", module.join("::"), u.join("::"))));
    }
    assert!(upward.is_empty(), "arrows that point upward: {upward:#?}");
}

#[test]
fn the_check_of_rooms_sees_a_circle_and_follows_re_exports() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    };
    write("lib.rs", "mod a; mod b; mod c;");
    write("a/mod.rs", "mod deep; pub use deep::{One};");
    write("a/deep.rs", "use crate::b::Two; pub struct One(Two);");
    write("b.rs", "use crate::c::Three; pub struct Two(Three);");
    write("c.rs", "pub struct Three(Option<Box<crate::a::One>>);");
    let found = circles(&Source::read(folder.path()));
    assert_eq!(found, [["a::deep", "b", "c"]]);
}
