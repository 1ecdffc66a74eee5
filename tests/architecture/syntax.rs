//! What a file declares, imports and names.

use std::collections::BTreeSet;

use super::tokens::{Token, tokens};

/// A name that `use` brings into a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Import {
    /// As what it is known here; `*` for everything that is there.
    pub(crate) name: String,
    /// Where it is from, as written.
    pub(crate) path: Vec<String>,
    pub(crate) line: usize,
    /// `pub use`, to whomever.
    pub(crate) public: bool,
}

/// One module, as far as its own text goes. Whatever stands under `#[cfg(test)]` is left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Module {
    /// Modules in files of their own.
    pub(crate) declared: Vec<String>,
    /// Modules that stand in the same text.
    pub(crate) inline: Vec<(String, Module)>,
    pub(crate) imports: Vec<Import>,
    /// Names of its items.
    pub(crate) defined: BTreeSet<String>,
    pub(crate) macros: BTreeSet<String>,
    /// Paths of more than one word in its code, with their lines.
    pub(crate) paths: Vec<(Vec<String>, usize)>,
    /// Every word of its code, imports and paths aside.
    pub(crate) words: BTreeSet<String>,
    /// Macros that are called by one word.
    pub(crate) called: Vec<(String, usize)>,
}

/// Reads the text of a file.
pub(crate) fn module(source: &str) -> Module {
    let tokens = tokens(source);
    read(&mut Tokens { tokens: &tokens })
}

struct Tokens<'a> {
    tokens: &'a [Token<'a>],
}

impl<'a> Tokens<'a> {
    fn peek(&self, ahead: usize) -> &'a str {
        self.tokens.get(ahead).map_or("", |token| token.text)
    }

    fn next(&mut self) -> Option<Token<'a>> {
        let (first, rest) = self.tokens.split_first()?;
        self.tokens = rest;
        Some(*first)
    }

    fn skip(&mut self, count: usize) {
        self.tokens = self.tokens.get(count..).unwrap_or_default();
    }

    /// How many tokens there are to the end of the bracket that opens here.
    fn group(&self) -> usize {
        let mut depth = 0_usize;
        for (at, token) in self.tokens.iter().enumerate() {
            match token.text {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 {
                return at + 1;
            }
        }
        self.tokens.len()
    }

    /// An attribute, if there is one: whether it is `cfg(test)`.
    fn attribute(&mut self) -> Option<bool> {
        let inner = usize::from(self.peek(1) == "!");
        if self.peek(0) != "#" || self.peek(1 + inner) != "[" {
            return None;
        }
        self.skip(1 + inner);
        let length = self.group();
        let words: Vec<_> = self.tokens[..length].iter().map(|t| t.text).collect();
        self.skip(length);
        Some(words == ["[", "cfg", "(", "test", ")", "]"])
    }

    /// Leaves out an item, with its further attributes.
    fn skip_item(&mut self) {
        while self.attribute().is_some() {}
        let needs_end = matches!(self.peek(0), "use" | "const" | "static" | "let" | "type");
        while !self.tokens.is_empty() {
            let length = self.group();
            let last = self.tokens[length - 1].text;
            self.skip(length);
            if last == ";" || last == "}" && !needs_end {
                return;
            }
        }
    }
}

/// Reads to the end of the module's bracket, or of the text.
fn read(tokens: &mut Tokens<'_>) -> Module {
    let mut module = Module::default();
    let mut depth = 0_usize;
    let mut public = false;
    let mut before = "";
    while let Some(first) = tokens.tokens.first().copied() {
        if let Some(test) = tokens.attribute() {
            if test {
                tokens.skip_item();
            }
            continue;
        }
        match first.text {
            "}" if depth == 0 => {
                tokens.skip(1);
                return module;
            }
            "pub" if tokens.peek(1) == "(" => {
                tokens.skip(1);
                tokens.skip(tokens.group());
                (public, before) = (true, "pub");
                continue;
            }
            "mod" if tokens.peek(2) == ";" => {
                module.declared.push(tokens.peek(1).to_owned());
                tokens.skip(3);
            }
            "mod" if tokens.peek(2) == "{" => {
                let name = tokens.peek(1).to_owned();
                tokens.skip(3);
                module.inline.push((name, read(tokens)));
            }
            "use" if before != "+" => {
                tokens.skip(1);
                import(tokens, &[], public, &mut module.imports);
            }
            "macro_rules" if tokens.peek(1) == "!" => {
                module.macros.insert(tokens.peek(2).to_owned());
                tokens.skip(3);
            }
            "struct" | "enum" | "trait" | "fn" | "const" | "static" | "type" | "union"
                if depth == 0 && tokens.tokens.get(1).is_some_and(Token::is_word) =>
            {
                module.defined.insert(tokens.peek(1).to_owned());
                tokens.skip(1);
            }
            _ if first.is_word() => name(tokens, before, &mut module),
            text => {
                match text {
                    "(" | "[" | "{" => depth += 1,
                    ")" | "]" | "}" => depth = depth.saturating_sub(1),
                    _ => {}
                }
                tokens.skip(1);
            }
        }
        public = first.text == "pub";
        before = first.text;
    }
    module
}

/// A word in code, or a path that begins with it.
fn name(tokens: &mut Tokens<'_>, before: &str, module: &mut Module) {
    let Some(first) = tokens.next() else { return };
    let mut path = vec![first.text.to_owned()];
    while tokens.peek(0) == "::" && tokens.tokens.get(1).is_some_and(Token::is_word) {
        path.push(tokens.peek(1).to_owned());
        tokens.skip(2);
    }
    if before == "." || before == "::" {
        return; // a field, a method, what follows `<…>::`
    }
    if path.len() > 1 {
        module.paths.push((path, first.line));
        return;
    }
    if tokens.peek(0) == "!" && tokens.peek(1) != "=" {
        module.called.push((path.remove(0), first.line));
    } else {
        module.words.insert(path.remove(0));
    }
}

/// A tree of names after `use`, and its end.
fn import(tokens: &mut Tokens<'_>, prefix: &[String], public: bool, imports: &mut Vec<Import>) {
    let mut path = prefix.to_vec();
    let mut line = tokens.tokens.first().map_or(0, |token| token.line);
    let mut name = None;
    while let Some(token) = tokens.next() {
        match token.text {
            "{" => {
                while tokens.peek(0) != "}" && !tokens.tokens.is_empty() {
                    import(tokens, &path, public, imports);
                }
                tokens.skip(1);
                if tokens.peek(0) == "," || tokens.peek(0) == ";" {
                    tokens.skip(1);
                }
                return;
            }
            "as" => name = tokens.next().map(|token| token.text.to_owned()),
            "self" if !path.is_empty() => line = token.line,
            "*" => name = Some("*".to_owned()),
            "::" if path.is_empty() => path.push(String::new()),
            "::" => {}
            "," | ";" => break,
            _ => {
                line = token.line;
                path.push(token.text.to_owned());
            }
        }
        if tokens.peek(0) == "}" {
            break;
        }
    }
    let name = name.or_else(|| path.last().cloned()).unwrap_or_default();
    imports.push(Import {
        name,
        path,
        line,
        public,
    });
}

#[test]
fn imports_paths_and_items_are_found_and_tests_are_not() {
    let module = module(
        "
        pub(crate) use self::a::{self, b::C as D, e::*};
        use super::f;
        use ::x::y;
        #[cfg(test)]
        mod tests { use crate::nothing; }
        #[cfg(test)]
        use super::nothing;
        pub(crate) mod g;
        mod h { pub fn i() -> j::K { crate::l::m::<N>() } }
        #[derive(O)] struct P { q: [r::S; 2] }
        impl P { fn t(&self) { self.u.v(); w!(x) } }
        ",
    );
    let imports: Vec<_> = module
        .imports
        .iter()
        .map(|i| format!("{}={} {}", i.name, i.path.join("::"), i.public))
        .collect();
    assert_eq!(
        imports,
        [
            "a=self::a true",
            "D=self::a::b::C true",
            "*=self::a::e true",
            "f=super::f false",
            "y=::x::y false"
        ]
    );
    assert_eq!(module.declared, ["g"]);
    assert_eq!(module.defined.iter().collect::<Vec<_>>(), ["P"]);
    let (name, inner) = &module.inline[0];
    assert_eq!((name.as_str(), inner.paths.len()), ("h", 2));
    assert_eq!(inner.paths[1].0, ["crate", "l", "m"]);
    assert_eq!(module.paths[0].0, ["r", "S"]);
    assert_eq!(module.called[0].0, "w");
}
