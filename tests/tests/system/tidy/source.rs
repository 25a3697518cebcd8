//! Splits Rust sources into code, comments and string literals, for the language rules.

/// The parts of a source, each with the line breaks of the whole, so that line numbers
/// agree.
#[derive(Default)]
pub(super) struct Parts {
    /// Code without comments and without the content of string literals.
    pub(super) code: String,
    /// Comments and doc comments.
    pub(super) comments: String,
    /// The content of string literals.
    pub(super) strings: String,
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    Code,
    Line,
    /// A block comment with its depth, for they nest.
    Block(usize),
    Text,
    /// A raw string literal with its number of `#`.
    Raw(usize),
}

/// Number of `#` of a raw string literal that starts at `rest`, which begins with `r`.
fn raw_hashes(rest: &[char]) -> Option<usize> {
    let hashes = rest[1..].iter().take_while(|c| **c == '#').count();
    (rest.get(1 + hashes) == Some(&'"')).then_some(hashes)
}

/// Splits a source into its parts.
pub(super) fn parts(text: &str) -> Parts {
    let all: Vec<char> = text.chars().collect();
    let mut parts = Parts::default();
    let (mut part, mut at) = (Part::Code, 0);
    while at < all.len() {
        let rest = &all[at..];
        let (c, next) = (rest[0], rest.get(1).copied());
        if c == '\n' {
            for out in [&mut parts.code, &mut parts.comments, &mut parts.strings] {
                out.push('\n');
            }
            if part == Part::Line {
                part = Part::Code;
            }
            at += 1;
            continue;
        }
        let before = at.checked_sub(1).map(|i| all[i]);
        let in_word = before.is_some_and(|c| c.is_alphanumeric() || c == '_');
        let mut taken = 1;
        match part {
            Part::Code if c == '/' && next == Some('/') => part = Part::Line,
            Part::Code if c == '/' && next == Some('*') => {
                part = Part::Block(1);
                taken = 2;
            }
            Part::Code if c == 'r' && (!in_word || before == Some('b')) => match raw_hashes(rest) {
                Some(hashes) => {
                    part = Part::Raw(hashes);
                    taken = 2 + hashes;
                }
                None => parts.code.push(c),
            },
            Part::Code if c == '"' => part = Part::Text,
            // A character literal that could be taken for the start of a string.
            Part::Code if c == '\'' && next == Some('\\') => {
                taken = 2 + rest[2..].iter().skip(1).take_while(|c| **c != '\'').count() + 2;
            }
            Part::Code if c == '\'' && rest.get(2) == Some(&'\'') => taken = 3,
            Part::Code => parts.code.push(c),
            Part::Line => parts.comments.push(c),
            Part::Block(depth) if c == '*' && next == Some('/') => {
                part = if depth == 1 {
                    Part::Code
                } else {
                    Part::Block(depth - 1)
                };
                taken = 2;
            }
            Part::Block(depth) if c == '/' && next == Some('*') => {
                part = Part::Block(depth + 1);
                taken = 2;
            }
            Part::Block(_) => parts.comments.push(c),
            Part::Text if c == '\\' && next != Some('\n') => taken = 2,
            Part::Text if c == '"' => {
                part = Part::Code;
                parts.strings.push(' ');
            }
            Part::Text => parts.strings.push(c),
            Part::Raw(hashes) if c == '"' && ends_raw(rest, hashes) => {
                part = Part::Code;
                parts.strings.push(' ');
                taken = 1 + hashes;
            }
            Part::Raw(_) => parts.strings.push(c),
        }
        at += taken;
    }
    parts
}

/// Whether a raw string literal with so many `#` ends at `rest`, which begins with `"`.
fn ends_raw(rest: &[char], hashes: usize) -> bool {
    rest.len() > hashes && rest[1..=hashes].iter().all(|c| *c == '#')
}

#[test]
fn source_is_split_into_code_comments_and_strings() {
    let text = "let a = \"b // c\\\" d\"; // e \"f\n/* g /* h */ i */ let r = r#\"j\"k\"#;\nlet q = '\"'; let l: &'a str = '\\'';\n";
    let parts = parts(text);
    let lines = |text: &str| {
        text.lines()
            .map(str::trim)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        lines(&parts.code),
        ["let a = ;", "let r = ;", "let q = ; let l: &'a str = ;"]
    );
    assert_eq!(lines(&parts.comments), ["/ e \"f", "g  h  i", ""]);
    assert_eq!(lines(&parts.strings), ["b // c d", "j\"k", ""]);
}
