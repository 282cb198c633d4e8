//! The grammar of conditions.
//!
//! ```text
//! condition  := and ('or' and)*
//! and        := not ('and' not)*
//! not        := 'not' not | comparison
//! comparison := sum [('<' | '<=' | '>' | '>=' | '==' | '!=') sum | 'is' ['not'] 'null']
//! sum        := product (('+' | '-') product)*
//! product    := factor (('*' | '/') factor)*
//! factor     := '-' factor | NUMBER | "TEXT" | 'true' | 'false' | COLUMN | '(' condition ')'
//!             | 'abs' '(' sum ')'
//!             | ('count' | 'share') '(' condition ')' | ('min' | 'max' | 'mean') '(' sum ')'
//!             | 'quantile' '(' sum ',' NUMBER ')'
//! ```

use std::cmp::Ordering;
use std::ops::Range;

use crate::condition::{Comparison, Condition, Fold, Mistake, Node};
use sweep_files::{Cell, CellKind, Column, ResultTable};

/// Deepest nesting: what no person writes, and no stack minds.
const DEEPEST: usize = 64;

/// Longest text of a condition.
const LONGEST: usize = 4096;

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Word(String),
    Text(String),
    Sign(&'static str),
    End,
}

/// Longer signs first.
const SIGNS: [&str; 13] = ["<=", ">=", "==", "!=", "<", ">", "(", ")", "+", "-", "*", "/", ","];

/// What other languages write, and what is meant.
const FOREIGN: [(&str, &str); 5] =
    [("&&", "and"), ("||", "or"), ("!", "not"), ("=", "=="), ("<>", "!=")];

/// Words that are no columns, and how they fold all rows.
const FUNCTIONS: [(&str, Option<Fold>); 7] = [
    ("abs", None),
    ("count", Some(Fold::Count)),
    ("share", Some(Fold::Share)),
    ("min", Some(Fold::Least)),
    ("max", Some(Fold::Greatest)),
    ("mean", Some(Fold::Mean)),
    ("quantile", Some(Fold::Quantile(f64::NAN))),
];

type Spanned = (Token, Range<usize>);

/// What a node is.
struct Typed {
    node: Node,
    kind: CellKind,
    span: Range<usize>,
}

type Parsed = Result<Typed, Mistake>;

const COMPARISONS: [(&str, Comparison); 6] = [
    ("<", Comparison(Ordering::is_lt)),
    ("<=", Comparison(Ordering::is_le)),
    (">", Comparison(Ordering::is_gt)),
    (">=", Comparison(Ordering::is_ge)),
    ("==", Comparison(Ordering::is_eq)),
    ("!=", Comparison(Ordering::is_ne)),
];

/// How two parts become one.
type Joining = fn(Box<Node>, Box<Node>) -> Node;

const SUMS: [(&str, Joining); 2] = [
    ("+", |left, right| Node::Calculate(|a, b| a + b, left, right)),
    ("-", |left, right| Node::Calculate(|a, b| a - b, left, right)),
];
const PRODUCTS: [(&str, Joining); 2] = [
    ("*", |left, right| Node::Calculate(|a, b| a * b, left, right)),
    ("/", |left, right| Node::Calculate(|a, b| a / b, left, right)),
];

fn wrong<T>(
    title: impl Into<String>,
    span: Range<usize>,
    expected: impl Into<String>,
) -> Result<T, Mistake> {
    let (title, expected) = (title.into(), expected.into());
    Err(Mistake { title, span, expected, candidates: None })
}

fn tokens(text: &str) -> Result<Vec<Spanned>, Mistake> {
    if text.len() > LONGEST {
        let expected = format!("expected at most {LONGEST} characters");
        return wrong("the expression is too long", 0..LONGEST.min(1), expected);
    }
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let (token, length) = if first.is_whitespace() {
            at += first.len_utf8();
            continue;
        } else if first.is_ascii_digit() || first == '.' {
            let length = number_length(rest);
            let number = rest[..length].parse::<f64>().ok().filter(|number| number.is_finite());
            let Some(number) = number else {
                let title = format!("`{}` is not a number", &rest[..length]);
                return wrong(title, at..at + length, "expected a number such as 1.5 or 2e-3");
            };
            (Token::Number(number), length)
        } else if first.is_alphabetic() || first == '_' {
            let ends = |c: char| !(c.is_alphanumeric() || c == '_');
            let length = rest.find(ends).unwrap_or(rest.len());
            (Token::Word(rest[..length].to_owned()), length)
        } else if first == '"' || first == '\'' {
            let Some(end) = rest[1..].find(first) else {
                let span = at..text.len();
                return wrong("a text without an end", span, format!("expected a closing {first}"));
            };
            (Token::Text(rest[1..=end].to_owned()), end + 2)
        } else if let Some((foreign, own)) = FOREIGN.iter().find(|(foreign, _)| {
            rest.starts_with(foreign) && !(rest.starts_with("==") || rest.starts_with("!="))
        }) {
            let title = format!("`{foreign}` is not part of an expression");
            return wrong(title, at..at + foreign.len(), format!("expected `{own}`"));
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(*sign)) {
            (Token::Sign(sign), sign.len())
        } else {
            let title = format!("`{first}` is not part of an expression");
            let expected = "expected columns, numbers, `<`, `and`, ...";
            return wrong(title, at..at + first.len_utf8(), expected);
        };
        found.push((token, at..at + length));
        at += length;
    }
    found.push((Token::End, text.len()..text.len()));
    Ok(found)
}

/// How far a number goes: digits, a point, an exponent.
fn number_length(text: &str) -> usize {
    let mut before = ' ';
    text.find(|c: char| {
        let sign = matches!(c, '+' | '-') && matches!(before, 'e' | 'E');
        let part = c.is_alphanumeric() || c == '.' || c == '_' || sign;
        before = c;
        !part
    })
    .unwrap_or(text.len())
}

impl Condition {
    /// Reads a condition over the columns of a file.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn parse(text: &str, table: &ResultTable) -> Result<Self, Mistake> {
        expression(text, &table.columns, CellKind::Flag)
    }
}

#[derive(Default)]
struct Parser<'a> {
    tokens: Vec<Spanned>,
    next: usize,
    columns: &'a [Column],
    used: Vec<String>,
    folds: Vec<(Fold, Node)>,
    by_row: bool,
    in_fold: bool,
    depth: usize,
}

/// Reads an expression over these columns: true or false, or a number.
pub(crate) fn expression(
    text: &str,
    columns: &[Column],
    wanted: CellKind,
) -> Result<Condition, Mistake> {
    let mut parser = Parser { tokens: tokens(text)?, columns, ..Parser::default() };
    let root = parser.any_of()?;
    let (token, span) = parser.peek().clone();
    if token != Token::End {
        let expected = "expected `and`, `or`, a comparison, or the end";
        return wrong("the expression goes on after its end", span, expected);
    }
    if root.kind != wanted {
        let (not, expected) = match wanted {
            CellKind::Flag => {
                ("neither holds nor fails", "expected a comparison, as in `ratio_max < 1.5`")
            }
            _ => ("cannot be minimised", "expected a number, as in `max(ratio_max)`"),
        };
        let title = format!("the expression is {}, which {not}", root.kind.name());
        return wrong(title, root.span, expected);
    }
    let Parser { used, folds, by_row, .. } = parser;
    let by_row = by_row || folds.is_empty();
    Ok(Condition { text: text.trim().to_owned(), columns: used, root: root.node, folds, by_row })
}

impl Parser<'_> {
    fn peek(&self) -> &Spanned {
        &self.tokens[self.next.min(self.tokens.len() - 1)]
    }

    fn take(&mut self) -> Spanned {
        let token = self.peek().clone();
        self.next += 1;
        token
    }

    fn takes_word(&mut self, word: &'static str) -> bool {
        self.takes_one(&[(word, ())]).is_some()
    }

    /// The next word or sign and what it means, if it is one of these.
    fn takes_one<T: Copy>(&mut self, known: &[(&'static str, T)]) -> Option<(&'static str, T)> {
        let next = match &self.peek().0 {
            Token::Word(word) => word.as_str(),
            Token::Sign(sign) => sign,
            _ => return None,
        };
        let found = known.iter().find(|(name, _)| *name == next).copied()?;
        self.next += 1;
        Some(found)
    }

    fn any_of(&mut self) -> Parsed {
        self.joined(Self::all_of, CellKind::Flag, &[("or", Node::Or)])
    }

    fn all_of(&mut self) -> Parsed {
        self.joined(Self::negated, CellKind::Flag, &[("and", Node::And)])
    }

    /// Parts of one kind, joined from the left to a part of that kind.
    fn joined(
        &mut self,
        part: fn(&mut Self) -> Parsed,
        kind: CellKind,
        known: &[(&'static str, Joining)],
    ) -> Parsed {
        let mut left = part(self)?;
        while let Some((word, node)) = self.takes_one(known) {
            let right = part(self)?;
            let why = match kind {
                CellKind::Flag => format!("`{word}` joins what is true or false"),
                _ => "only numbers are calculated with".to_owned(),
            };
            for side in [&left, &right] {
                expect(side, kind, &why)?;
            }
            let span = left.span.start..right.span.end;
            left = Typed { node: node(Box::new(left.node), Box::new(right.node)), kind, span };
        }
        Ok(left)
    }

    fn negated(&mut self) -> Parsed {
        let start = self.peek().1.start;
        if !self.takes_word("not") {
            return self.comparison();
        }
        let inner = self.deeper(Self::negated)?;
        expect(&inner, CellKind::Flag, "`not` turns true into false")?;
        let span = start..inner.span.end;
        Ok(Typed { node: Node::Not(Box::new(inner.node)), kind: CellKind::Flag, span })
    }

    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        if self.takes_word("is") {
            let negated = self.takes_word("not");
            let end = self.peek().1.clone();
            if !self.takes_word("null") {
                return wrong("`is` asks for null", end, "expected `null` or `not null`");
            }
            let span = left.span.start..end.end;
            let node = Node::IsNull(Box::new(left.node));
            let node = if negated { Node::Not(Box::new(node)) } else { node };
            return Ok(Typed { node, kind: CellKind::Flag, span });
        }
        let Some((_, comparison)) = self.takes_one(&COMPARISONS) else { return Ok(left) };
        let right = self.sum()?;
        if left.kind != right.kind {
            let title = format!("{} is compared with {}", left.kind.name(), right.kind.name());
            let expected = match left.kind {
                CellKind::Text => "expected a text, as in \"ok\"".to_owned(),
                kind => format!("expected {}", kind.name()),
            };
            return wrong(title, right.span, expected);
        }
        let again = self.peek().1.clone();
        if self.takes_one(&COMPARISONS).is_some() {
            let expected = "expected `and`: write `a < x and x < b`";
            return wrong("a comparison of three values", again, expected);
        }
        let span = left.span.start..right.span.end;
        let node = Node::Compare(comparison, Box::new(left.node), Box::new(right.node));
        Ok(Typed { node, kind: CellKind::Flag, span })
    }

    fn sum(&mut self) -> Parsed {
        self.joined(Self::product, CellKind::Number, &SUMS)
    }

    fn product(&mut self) -> Parsed {
        self.joined(Self::factor, CellKind::Number, &PRODUCTS)
    }

    fn factor(&mut self) -> Parsed {
        let (token, span) = self.take();
        let typed = |node, kind| Ok(Typed { node, kind, span: span.clone() });
        match token {
            Token::Number(number) => typed(Node::Literal(Cell::Number(number)), CellKind::Number),
            Token::Text(text) => typed(Node::Literal(Cell::Text(text)), CellKind::Text),
            Token::Sign("-") => {
                let inner = self.deeper(Self::factor)?;
                expect(&inner, CellKind::Number, "only a number has a sign")?;
                let span = span.start..inner.span.end;
                let node = Node::Changed(|number| -number, Box::new(inner.node));
                Ok(Typed { node, kind: CellKind::Number, span })
            }
            Token::Sign("(") => {
                let inner = self.deeper(Self::any_of)?;
                let end = self.closing()?;
                Ok(Typed { span: span.start..end, ..inner })
            }
            Token::Word(word) if word == "true" || word == "false" => {
                typed(Node::Literal(Cell::Flag(word == "true")), CellKind::Flag)
            }
            Token::Word(word) if self.peek().0 == Token::Sign("(") => {
                match FUNCTIONS.iter().find(|(name, _)| *name == word) {
                    Some((name, fold)) => self.function(name, *fold, span),
                    None => unknown_function(word, span),
                }
            }
            Token::Word(word) => self.column(&word, span),
            Token::Sign(_) | Token::End => {
                let title = match token {
                    Token::Sign(sign) => format!("`{sign}` where a value should be"),
                    _ => "the expression ends too early".to_owned(),
                };
                wrong(title, span, "expected a column, a number or `(`")
            }
        }
    }

    fn column(&mut self, word: &str, span: Range<usize>) -> Parsed {
        let Some(column) = self.columns.iter().find(|column| column.name == word) else {
            let names = self.columns.iter().map(|column| column.name.clone());
            let names = names.chain(FUNCTIONS.map(|(name, _)| name.to_owned())).collect();
            return Err(Mistake {
                title: format!("unknown column `{word}`"),
                span,
                expected: "expected a column of the file, or a \"text\" in quotes".to_owned(),
                candidates: Some((word.to_owned(), names)),
            });
        };
        self.by_row |= !self.in_fold;
        let known = self.used.iter().position(|used| used == word);
        let place = known.unwrap_or_else(|| {
            self.used.push(word.to_owned());
            self.used.len() - 1
        });
        Ok(Typed { node: Node::Column(place), kind: column.kind, span })
    }

    fn function(&mut self, word: &str, mut fold: Option<Fold>, span: Range<usize>) -> Parsed {
        self.next += 1;
        if fold.is_some() && self.in_fold {
            let title = format!("`{word}` within another function over all rows");
            return wrong(title, span, "expected a value of single rows");
        }
        let outer = self.in_fold;
        self.in_fold |= fold.is_some();
        let inner = self.deeper(Self::any_of);
        self.in_fold = outer;
        let inner = inner?;
        if let Some(Fold::Quantile(part)) = &mut fold {
            *part = self.part()?;
        }
        let end = self.closing()?;
        let wanted = match fold {
            Some(Fold::Count | Fold::Share) => CellKind::Flag,
            _ => CellKind::Number,
        };
        expect(&inner, wanted, &format!("`{word}` takes {}", wanted.name()))?;
        let node = match fold {
            Some(fold) => {
                self.folds.push((fold, inner.node));
                Node::Folded(self.folds.len() - 1)
            }
            None => Node::Changed(f64::abs, Box::new(inner.node)),
        };
        Ok(Typed { node, kind: CellKind::Number, span: span.start..end })
    }

    /// The part of all rows that a quantile is of.
    fn part(&mut self) -> Result<f64, Mistake> {
        let expected = "expected a comma and a number from 0 to 1, as in `quantile(x, 0.95)`";
        let (sign, span) = self.take();
        if sign != Token::Sign(",") {
            return wrong("`quantile` takes a number and a part of all rows", span, expected);
        }
        match self.take() {
            (Token::Number(part), _) if part <= 1.0 => Ok(part),
            (Token::Number(percent), span) if percent <= 100.0 => {
                let title = format!("`{percent}` is not a part of all rows");
                let part = percent / 100.0;
                wrong(title, span, format!("expected a number from 0 to 1: {part} for {percent} %"))
            }
            (_, span) => wrong("`quantile` takes a part of all rows", span, expected),
        }
    }

    /// The end of a closing parenthesis.
    fn closing(&mut self) -> Result<usize, Mistake> {
        let (token, span) = self.take();
        if token == Token::Sign(")") {
            return Ok(span.end);
        }
        wrong("a parenthesis without an end", span, "expected `)`")
    }

    fn deeper(&mut self, parse: fn(&mut Self) -> Parsed) -> Parsed {
        if self.depth == DEEPEST {
            let span = self.peek().1.clone();
            let expected = format!("expected at most {DEEPEST} levels");
            return wrong("the expression is nested too deeply", span, expected);
        }
        self.depth += 1;
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }
}

fn unknown_function(word: String, span: Range<usize>) -> Parsed {
    let names = FUNCTIONS.map(|(name, _)| name.to_owned());
    Err(Mistake {
        title: format!("unknown function `{word}`"),
        span,
        expected: format!("expected one of {}", names.join(", ")),
        candidates: Some((word, names.into())),
    })
}

fn expect(found: &Typed, wanted: CellKind, why: &str) -> Result<(), Mistake> {
    if found.kind == wanted {
        return Ok(());
    }
    let expected = format!("expected {}, found {}", wanted.name(), found.kind.name());
    wrong(why, found.span.clone(), expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn refused(text: &str) -> (String, String) {
        let table = sample::table();
        let mistake = Condition::parse(text, &table).unwrap_err();
        let at = text.get(mistake.span.clone()).unwrap_or("").to_owned();
        (at, format!("{}: {}", mistake.title, mistake.expected))
    }

    #[test]
    fn mistakes_are_pointed_at() {
        for (text, at, said) in [
            ("ratio_mx < 1.5", "ratio_mx", "unknown column `ratio_mx`"),
            ("sqrt(ratio_max) > 0", "sqrt", "unknown function `sqrt`: expected one of abs, count"),
            ("ratio_max = 1.5", "=", "expected `==`"),
            ("ratio_max < 2 && reliable", "&&", "expected `and`"),
            ("!reliable", "!", "expected `not`"),
            ("1 < ratio_max < 2", "<", "a < x and x < b"),
            ("ratio_max < \"2\"", "\"2\"", "a number is compared with a text"),
            ("status == 1", "1", "as in \"ok\""),
            ("ratio_max", "ratio_max", "neither holds nor fails"),
            ("ratio_max <", "", "ends too early"),
            ("(ratio_max < 2", "", "expected `)`"),
            ("ratio_max < 2 reliable", "reliable", "after its end"),
            ("reliable + 1 > 2", "reliable", "only numbers"),
            ("not ratio_max", "ratio_max", "expected true or false, found a number"),
            ("count(ratio_max) > 1", "ratio_max", "`count` takes true or false"),
            ("max(count(reliable)) > 1", "count", "over all rows"),
            ("ratio_max < 1.5.2", "1.5.2", "not a number"),
            ("ratio_max < 1e999", "1e999", "not a number"),
            ("ratio_max < 2kg", "2kg", "not a number"),
            ("status == \"ok", "\"ok", "closing"),
            ("ratio_max is 3", "3", "expected `null`"),
            ("ratio_max < €", "€", "not part of"),
            ("quantile(ratio_max, 95) < 1", "95", "0.95 for 95 %"),
            ("", "", "ends too early"),
        ] {
            let (found, message) = refused(text);
            assert_eq!(found, at, "{text}: {message}");
            assert!(message.contains(said), "{text}: {message}");
        }
        let deep = format!("{}reliable{}", "(".repeat(100), ")".repeat(100));
        assert!(refused(&deep).1.contains("too deeply"));
        assert!(refused(&format!("{}reliable", "not ".repeat(900))).1.contains("too deeply"));
        assert!(refused(&"-".repeat(5000)).1.contains("too long"));
    }

    #[test]
    fn what_is_about_rows_is_told_from_what_is_about_the_file() {
        let table = sample::table();
        let by_row = |text: &str| Condition::parse(text, &table).unwrap().by_row;
        assert!(by_row("ratio_max < 1.5 and reliable"));
        assert!(by_row("ratio_max < 2 * mean(ratio_max)"));
        assert!(!by_row("count(not reliable) == 0 and max(abs(ratio_max - 1)) < 3"));
    }
}
