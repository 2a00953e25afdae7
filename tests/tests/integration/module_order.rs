//! The order of modules: a module imports only from the layers before its own.
//!
//! [`violations`] reads every path of the sources, also those in expressions, types and macros, not only `use` lines. Code under
//! `#[cfg(test)]` is left out. It relies on the sources' format, which `cargo fmt --check` guarantees: items end on a line of their
//! own indentation.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// The server's top-level modules, as documented in its `lib.rs`.
const SERVER: &[&[&str]] = &[
    &[
        "budget",
        "client",
        "convention",
        "error",
        "faults",
        "methods",
        "middleware",
        "reload",
        "warning_rate",
        "wire",
    ],
    &[
        "limits",
        "listen",
        "log_lines",
        "metrics",
        "tls",
        "traces",
        "viewer",
    ],
    &[
        "access",
        "atlas_slots",
        "executor",
        "health_check",
        "net",
        "saved",
        "web",
    ],
    &["rigs"],
    &["answer", "call", "config", "validate"],
    &["connect", "memory", "objects", "open_files", "track"],
    &["atlases"],
    &["search"],
    &["services"],
    &["monitor"],
    &["fuzzing", "serve"],
];

/// The core's layers, as documented in its `lib.rs`.
const CORE: &[&[&str]] = &[
    &["base"],
    &["geometry"],
    &["model"],
    &["thesis", "physical"],
    &["rating"],
    &["propose"],
    &["known"],
    &["search"],
];

#[test]
fn core_layers_import_only_earlier_ones() {
    assert_layered("server/synthesis/src", CORE);
}

#[test]
fn server_modules_import_only_earlier_layers() {
    assert_layered("server/src", SERVER);
}

/// Checks a crate's sources, given by their path in the workspace.
fn assert_layered(src: &str, layers: &[&[&str]]) {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the crate is in the workspace");
    let found = violations(&workspace.join(src), layers);
    assert!(
        found.is_empty(),
        "imports against the order of layers:\n{}",
        found.join("\n")
    );
}

/// Every import against the order, as `file:line: fault`. A module may import modules of the rows before its
/// own; since modules of one row may not import each other, an order without violations has no circle.
///
/// Modules that the order does not list, listed modules that do not exist, and imports through the crate root are
/// violations too. The crate root itself (`lib.rs`) may import anything.
fn violations(src: &Path, layers: &[&[&str]]) -> Vec<String> {
    let row_of = |module: &str| layers.iter().position(|row| row.contains(&module));
    let root = src.join("lib.rs");
    let mut scan = Scan::default();
    scan.file(&root, &[]);

    let mut found = Vec::new();
    for module in &scan.top_level {
        if row_of(module).is_none() {
            found.push(format!("{}: `{module}` is in no layer", root.display()));
        }
    }
    for module in layers.iter().copied().flatten() {
        if !scan.top_level.iter().any(|top_level| top_level == module) {
            found.push(format!("{}: there is no module `{module}`", root.display()));
        }
    }
    for Import { place, from, to } in &scan.imports {
        if !scan.top_level.contains(to) {
            found.push(format!("{place}: `{from}` imports `{to}` through the crate root"));
        } else if from != to && row_of(to) >= row_of(from) {
            found.push(format!(
                "{place}: `{from}` imports `{to}`, which is not in an earlier layer"
            ));
        }
    }
    found
}

/// A path from one top-level module of the crate to another.
struct Import {
    /// File and line.
    place: String,
    from: String,
    to: String,
}

/// The modules and imports of the files read so far.
#[derive(Default)]
struct Scan {
    top_level: Vec<String>,
    imports: Vec<Import>,
}

impl Scan {
    /// Reads the file of a module, which is named without `crate`, and those of the modules that it declares.
    fn file(&mut self, file: &Path, module: &[String]) {
        let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let text = without_tests(&text);
        for line in text.lines() {
            let Some(name) = declared(line) else { continue };
            if module.is_empty() {
                self.top_level.push(name.to_owned());
            }
            let inner = [module, &[name.to_owned()]].concat();
            self.file(&file_of(file, name), &inner);
        }
        let Some(from) = module.first() else { return };
        for (at, prefix) in ["crate::", "super::"]
            .into_iter()
            .flat_map(|prefix| text.match_indices(prefix))
        {
            // The rest of a longer name or path.
            if text[..at].ends_with(|before: char| before.is_alphanumeric() || "_:$".contains(before)) {
                continue;
            }
            let mut rest = &text[at..];
            let mut depth = if prefix == "crate::" { module.len() } else { 0 };
            rest = rest.strip_prefix("crate::").unwrap_or(rest);
            while let Some(above) = rest.strip_prefix("super::") {
                (rest, depth) = (above, depth + 1);
            }
            // Paths that end below the crate root stay in the module.
            if depth >= module.len() {
                let line = text[..at].matches('\n').count() + 1;
                let place = format!("{}:{line}", file.display());
                self.imports
                    .extend(first_names(rest).into_iter().map(|to| Import {
                        place: place.clone(),
                        from: from.clone(),
                        to: to.to_owned(),
                    }));
            }
        }
    }
}

/// The module that a line declares in a file of its own.
fn declared(line: &str) -> Option<&str> {
    let (before, name) = line.strip_suffix(';')?.rsplit_once("mod ")?;
    (before.is_empty() || before.trim_start().starts_with("pub")).then_some(name)
}

/// The file of a module that is declared in another one.
fn file_of(parent: &Path, name: &str) -> PathBuf {
    let folder = match parent.file_stem().and_then(|stem| stem.to_str()) {
        Some("lib" | "mod") => parent.with_file_name(""),
        _ => parent.with_extension(""),
    };
    let files = [
        folder.join(format!("{name}.rs")),
        folder.join(name).join("mod.rs"),
    ];
    let file = files.into_iter().find(|file| file.exists());
    file.unwrap_or_else(|| panic!("{}: no file of module {name}", parent.display()))
}

/// The first names of a path, or of each branch of a group of paths.
fn first_names(path: &str) -> Vec<&str> {
    let Some(group) = path.strip_prefix('{') else {
        let end = path.find(|letter: char| !letter.is_alphanumeric() && letter != '_');
        return vec![&path[..end.unwrap_or(path.len())]];
    };
    let (mut names, mut depth, mut start) = (Vec::new(), 0, 0);
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            ',' | '}' if depth == 0 => {
                let branch = group[start..at].trim();
                names.extend(
                    (!branch.is_empty())
                        .then(|| first_names(branch))
                        .into_iter()
                        .flatten(),
                );
                start = at + 1;
                if letter == '}' {
                    break;
                }
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    names
}

/// The code without comments and tests, with the same number of lines.
fn without_tests(text: &str) -> String {
    let mut lines = text.lines();
    let mut code = String::new();
    while let Some(line) = lines.next() {
        let indentation = &line[..line.len() - line.trim_start().len()];
        if ["#[cfg(test)]", "#[cfg(all(test"]
            .iter()
            .any(|attribute| line.trim().starts_with(attribute))
        {
            // Further attributes, then the item to its end.
            let is_attribute = |line: &str| line.trim().starts_with("#[");
            let mut item = lines.by_ref().inspect(|_| code.push('\n'));
            let first = item.find(|line| !is_attribute(line)).unwrap_or_default();
            if !first.ends_with([';', ',', '}']) {
                let _ = item.find(|line| {
                    let end = line.strip_prefix(indentation).unwrap_or_default();
                    matches!(end, "}" | "};" | "}," | ");")
                });
            }
        } else {
            code.push_str(line.split("//").next().unwrap_or_default());
        }
        code.push('\n');
    }
    code
}
