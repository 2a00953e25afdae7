//! The order of modules: a module imports only what the layers before its own declare.
//!
//! [`violations`] reads the sources of a crate as tokens, so that it also sees paths in macros, expressions and
//! types, not only `use` lines. Code under `#[cfg(test)]` is left out.

use std::{
    fs,
    path::{Path, PathBuf},
};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// The server's top-level modules, as documented in its `lib.rs`.
const SERVER: &[&[&str]] = &[
    &[
        "budget",
        "convention",
        "demand",
        "error",
        "health_check",
        "limits",
        "middleware",
        "reserve",
        "wire",
    ],
    &["atlas_slots", "net", "saved", "web"],
    &["rigs"],
    &["answer", "call", "config", "executor", "validate"],
    &["memory", "objects", "track"],
    &["atlases"],
    &["search"],
    &["services"],
    &["serve"],
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

/// Every import against the order, as `file:line: what is wrong`. A module may import modules of the rows before its
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
    for import in &scan.imports {
        let Import { file, line, from, to } = import;
        let place = format!("{}:{line}", file.display());
        let Some(to) = to
            .as_deref()
            .filter(|to| scan.top_level.iter().any(|module| module == to))
        else {
            found.push(format!("{place}: `{from}` imports through the crate root"));
            continue;
        };
        let is_against_order = match (row_of(from), row_of(to)) {
            (Some(from_row), Some(to_row)) => to_row >= from_row,
            // Reported above.
            _ => false,
        };
        if from != to && is_against_order {
            found.push(format!(
                "{place}: `{from}` imports `{to}`, which is not in an earlier layer"
            ));
        }
    }
    found
}

/// A path from one module of the crate to another.
struct Import {
    file: PathBuf,
    line: usize,
    /// The top-level module that contains it.
    from: String,
    /// The top-level module that it names; none for the crate root.
    to: Option<String>,
}

/// What was found in the files read so far.
#[derive(Default)]
struct Scan {
    top_level: Vec<String>,
    imports: Vec<Import>,
}

/// Where the tokens come from.
struct Place<'a> {
    file: &'a Path,
    /// The folder of the modules that the file declares.
    folder: PathBuf,
    /// The path of the module, without `crate`.
    module: Vec<String>,
}

impl Scan {
    fn file(&mut self, file: &Path, module: &[String]) {
        let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let tokens: TokenStream = text
            .parse()
            .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let folder = file.parent().expect("a file is in a folder");
        let folder = match file.file_stem().and_then(|stem| stem.to_str()) {
            Some("lib" | "mod") | None => folder.to_owned(),
            Some(stem) => folder.join(stem),
        };
        let place = Place {
            file,
            folder,
            module: module.to_owned(),
        };
        self.tokens(tokens, &place);
    }

    fn tokens(&mut self, stream: TokenStream, place: &Place<'_>) {
        let tokens: Vec<TokenTree> = stream.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            if is_test_attribute(&tokens[at..]) {
                at = end_of_item(&tokens, at + 2);
                continue;
            }
            match &tokens[at] {
                TokenTree::Ident(word) if word == "mod" => {
                    at += 1 + self.declaration(&tokens[at + 1..], place);
                }
                TokenTree::Ident(word) if word == "crate" || word == "super" || word == "self" => {
                    let preceded_by_path = at >= 2 && is_path_separator(&tokens[at - 2..]);
                    let is_use = at >= 1 && is_word(&tokens[at - 1], "use");
                    if !preceded_by_path && (is_use || is_path_separator(&tokens[at + 1..])) {
                        at = self.path(&tokens, at, &mut Vec::new(), place);
                    } else {
                        at += 1;
                    }
                }
                TokenTree::Group(group) => {
                    self.tokens(group.stream(), place);
                    at += 1;
                }
                _ => at += 1,
            }
        }
    }

    /// Reads the module that is declared after `mod`, here or in another file; gives how many tokens it took.
    fn declaration(&mut self, tokens: &[TokenTree], place: &Place<'_>) -> usize {
        let [TokenTree::Ident(name), next, ..] = tokens else {
            return 0;
        };
        let name = name.to_string();
        if place.module.is_empty() {
            self.top_level.push(name.clone());
        }
        let module: Vec<String> = place.module.iter().cloned().chain([name.clone()]).collect();
        let folder = place.folder.join(&name);
        match next {
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                let inner = Place {
                    file: place.file,
                    folder,
                    module,
                };
                self.tokens(group.stream(), &inner);
            }
            _ => {
                let files = [place.folder.join(format!("{name}.rs")), folder.join("mod.rs")];
                let file = files.iter().find(|file| file.exists());
                self.file(
                    file.unwrap_or_else(|| panic!("no file of module {name}")),
                    &module,
                );
            }
        }
        2
    }

    /// Reads a path with its groups; gives the place after it.
    fn path(
        &mut self,
        tokens: &[TokenTree],
        start: usize,
        path: &mut Vec<String>,
        place: &Place<'_>,
    ) -> usize {
        let mut at = start;
        loop {
            match tokens.get(at) {
                Some(TokenTree::Ident(word)) => path.push(word.to_string()),
                Some(TokenTree::Punct(punct)) if punct.as_char() == '*' => path.push("*".to_owned()),
                Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => {
                    let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                    for branch in inner.split(|token| is_punct(token, ',')) {
                        if !branch.is_empty() {
                            self.path(branch, 0, &mut path.clone(), place);
                        }
                    }
                    return at + 1;
                }
                // Generic arguments after `::`, as in `crate::a::f::<T>`.
                _ => break,
            }
            at += 1;
            if !is_path_separator(&tokens[at..]) {
                break;
            }
            at += 2;
        }
        let line = tokens[start].span().start().line;
        self.resolve(path, line, place);
        at
    }

    fn resolve(&mut self, path: &[String], line: usize, place: &Place<'_>) {
        let Some(from) = place.module.first() else {
            return;
        };
        let mut module = place.module.clone();
        let mut rest = path;
        while let [first, others @ ..] = rest {
            match first.as_str() {
                "crate" => module.clear(),
                "super" => {
                    module.pop();
                }
                "self" => {}
                _ => break,
            }
            rest = others;
        }
        module.extend(rest.iter().cloned());
        self.imports.push(Import {
            file: place.file.to_owned(),
            line,
            from: from.clone(),
            to: module.into_iter().next(),
        });
    }
}

fn is_punct(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

fn is_word(token: &TokenTree, word: &str) -> bool {
    matches!(token, TokenTree::Ident(ident) if ident == word)
}

/// Do the tokens begin with `::`?
fn is_path_separator(tokens: &[TokenTree]) -> bool {
    matches!(tokens, [a, b, ..] if is_punct(a, ':') && is_punct(b, ':'))
}

/// Do the tokens begin with `#[cfg(test)]` or a `cfg(all(test, …))`?
fn is_test_attribute(tokens: &[TokenTree]) -> bool {
    let [hash, TokenTree::Group(group), ..] = tokens else {
        return false;
    };
    let text: String = group.to_string().split_whitespace().collect();
    is_punct(hash, '#') && (text.starts_with("[cfg(test)") || text.starts_with("[cfg(all(test,"))
}

/// The place after the item that begins at `start`: after its body or its semicolon, or after the comma of a field.
fn end_of_item(tokens: &[TokenTree], start: usize) -> usize {
    const ITEMS: [&str; 10] = [
        "const", "enum", "fn", "impl", "mod", "static", "struct", "trait", "type", "use",
    ];
    let mut is_item = false;
    let mut at = start;
    while let Some(token) = tokens.get(at) {
        at += 1;
        is_item |= ITEMS.iter().any(|word| is_word(token, word));
        let is_body = matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace);
        if is_body || is_punct(token, ';') || (!is_item && is_punct(token, ',')) {
            // `use a::{b, c};` ends after its group.
            return at + usize::from(is_body && tokens.get(at).is_some_and(|token| is_punct(token, ';')));
        }
    }
    at
}

/// A crate of the given files in a folder of its own, removed at the end.
struct Sources(PathBuf);

impl Sources {
    fn new(test: &str, files: &[(&str, &str)]) -> Self {
        let folder = std::env::temp_dir().join(format!("grasp-layers-{}-{test}", std::process::id()));
        for (name, text) in files {
            let file = folder.join(name);
            fs::create_dir_all(file.parent().expect("a file is in a folder")).expect("a folder can be made");
            fs::write(file, text).expect("a file can be written");
        }
        Self(folder)
    }

    fn violations(&self, layers: &[&[&str]]) -> Vec<String> {
        let prefix = format!("{}/", self.0.display());
        violations(&self.0, layers)
            .into_iter()
            .map(|text| text.replace(&prefix, ""))
            .collect()
    }
}

impl Drop for Sources {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn reports_imports_against_the_order_by_file_and_line() {
    let sources = Sources::new(
        "against",
        &[
            ("lib.rs", "mod base;\nmod top;\nmod side;\npub use top::Top;\n"),
            (
                "base.rs",
                "pub mod inner;\nuse std::fmt;\nfn f() -> usize { let x = 1; vec![crate::top::SIZE + x][0] }\n",
            ),
            (
                "base/inner.rs",
                "use super::f;\nuse super::super::{\n    side::S,\n    base::g,\n};\n",
            ),
            (
                "top/mod.rs",
                "mod deep;\npub struct Top;\nuse crate::{base, Top};\n",
            ),
            (
                "top/deep.rs",
                "mod inline { use super::super::super::side; }\npub(in crate::top) fn f() {}\n",
            ),
            ("side.rs", "use crate::*;\nfn f(self) { self.x }\n"),
        ],
    );
    assert_eq!(
        sources.violations(&[&["base"], &["side", "top"]]),
        [
            "base/inner.rs:3: `base` imports `side`, which is not in an earlier layer",
            "base.rs:3: `base` imports `top`, which is not in an earlier layer",
            "top/deep.rs:1: `top` imports `side`, which is not in an earlier layer",
            "top/mod.rs:3: `top` imports through the crate root",
            "side.rs:1: `side` imports through the crate root",
        ]
    );
    // A circle has no order that allows it.
    assert_eq!(
        sources.violations(&[&["side"], &["top"], &["base"]]).len(),
        3,
        "base is after top, which imports it"
    );
}

#[test]
fn ignores_code_of_tests() {
    let sources = Sources::new(
        "tests",
        &[
            ("lib.rs", "mod base;\nmod top;\n"),
            (
                "base.rs",
                "struct S {\n    #[cfg(test)]\n    top: crate::top::T,\n}\n#[cfg(test)]\nuse crate::{top::T, top};\n\
                 #[cfg(test)]\n#[allow(unused)]\nmod tests { use crate::top; }\n#[cfg(test)]\nmod other;\n\
                 fn f() { crate::top::f() }\n",
            ),
            ("top.rs", "use crate::base;\n"),
        ],
    );
    assert_eq!(
        sources.violations(&[&["base"], &["top"]]),
        ["base.rs:12: `base` imports `top`, which is not in an earlier layer"]
    );
}

#[test]
fn reports_modules_that_the_order_does_not_match() {
    let sources = Sources::new(
        "unlisted",
        &[
            ("lib.rs", "mod a;\nmod b;\n"),
            ("a.rs", ""),
            ("b.rs", "use crate::a;\n"),
        ],
    );
    assert_eq!(
        sources.violations(&[&["b"], &["gone"]]),
        ["lib.rs: `a` is in no layer", "lib.rs: there is no module `gone`",]
    );
}
