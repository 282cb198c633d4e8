//! A recursive-descent parser of conditions.
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

use crate::condition::{Aggregate, ComparisonOperator, Condition, ExpressionError, ExpressionNode};
use sweep_files::{Cell, CellKind, Column, ResultTable};

/// The greatest depth of nested parentheses and signs. Basis: far more than people write, and far
/// less than the stack holds. Doubling it doubles the stack that the parser may need.
const MAX_DEPTH: usize = 64;

/// The greatest length of a text, in bytes. Basis: far more than people write. Doubling it doubles
/// the time and memory that a hostile text may take.
const MAX_TEXT_BYTES: usize = 4096;

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Word(String),
    Text(String),
    Sign(&'static str),
    End,
}

/// The operators and separators. The first match is taken, so that `<=` stands before `<`.
const SIGNS: [&str; 13] = ["<=", ">=", "==", "!=", "<", ">", "(", ")", "+", "-", "*", "/", ","];

/// Operators of other languages, and the ones to use.
const FOREIGN: [(&str, &str); 5] =
    [("&&", "and"), ("||", "or"), ("!", "not"), ("=", "=="), ("<>", "!=")];

/// The functions: an aggregate, or `None` for a function of single rows.
const FUNCTIONS: [(&str, Option<Aggregate>); 7] = [
    ("abs", None),
    ("count", Some(Aggregate::Count)),
    ("share", Some(Aggregate::Share)),
    ("min", Some(Aggregate::Least)),
    ("max", Some(Aggregate::Greatest)),
    ("mean", Some(Aggregate::Mean)),
    // NaN is a placeholder for the probability that the parser reads.
    ("quantile", Some(Aggregate::Quantile(f64::NAN))),
];

type SpannedToken = (Token, Range<usize>);

/// A node with its type and its position in the text.
struct TypedNode {
    node: ExpressionNode,
    kind: CellKind,
    span: Range<usize>,
}

type ParseResult = Result<TypedNode, ExpressionError>;

/// The comparison operators.
const COMPARISONS: [(&str, ComparisonOperator); 6] = [
    ("<", ComparisonOperator(Ordering::is_lt)),
    ("<=", ComparisonOperator(Ordering::is_le)),
    (">", ComparisonOperator(Ordering::is_gt)),
    (">=", ComparisonOperator(Ordering::is_ge)),
    ("==", ComparisonOperator(Ordering::is_eq)),
    ("!=", ComparisonOperator(Ordering::is_ne)),
];

/// A constructor of a binary operator's node.
type BinaryNode = fn(Box<ExpressionNode>, Box<ExpressionNode>) -> ExpressionNode;

/// The operators of sums.
const SUMS: [(&str, BinaryNode); 2] = [
    ("+", |left, right| ExpressionNode::Binary(|a, b| a + b, left, right)),
    ("-", |left, right| ExpressionNode::Binary(|a, b| a - b, left, right)),
];
/// The operators of products.
const PRODUCTS: [(&str, BinaryNode); 2] = [
    ("*", |left, right| ExpressionNode::Binary(|a, b| a * b, left, right)),
    ("/", |left, right| ExpressionNode::Binary(|a, b| a / b, left, right)),
];

/// Returns an error at a position.
fn error_at<T>(
    title: impl Into<String>,
    span: Range<usize>,
    expected: impl Into<String>,
) -> Result<T, ExpressionError> {
    Err(ExpressionError { title: title.into(), span, expected: expected.into(), candidates: None })
}

/// Splits a text into tokens, the last of which is [`Token::End`].
fn tokenize(text: &str) -> Result<Vec<SpannedToken>, ExpressionError> {
    if text.len() > MAX_TEXT_BYTES {
        let expected = format!("expected at most {MAX_TEXT_BYTES} characters");
        return error_at("the expression is too long", 0..MAX_TEXT_BYTES.min(1), expected);
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
                return error_at(title, at..at + length, "expected a number such as 1.5 or 2e-3");
            };
            (Token::Number(number), length)
        } else if first.is_alphabetic() || first == '_' {
            let ends = |c: char| !(c.is_alphanumeric() || c == '_');
            let length = rest.find(ends).unwrap_or(rest.len());
            (Token::Word(rest[..length].to_owned()), length)
        } else if first == '"' || first == '\'' {
            let Some(end) = rest[1..].find(first) else {
                let span = at..text.len();
                return error_at(
                    "a text without an end",
                    span,
                    format!("expected a closing {first}"),
                );
            };
            (Token::Text(rest[1..=end].to_owned()), end + 2)
        } else if let Some((foreign, own)) = FOREIGN.iter().find(|(foreign, _)| {
            rest.starts_with(foreign) && !(rest.starts_with("==") || rest.starts_with("!="))
        }) {
            let title = format!("`{foreign}` is not part of an expression");
            return error_at(title, at..at + foreign.len(), format!("expected `{own}`"));
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(*sign)) {
            (Token::Sign(sign), sign.len())
        } else {
            let title = format!("`{first}` is not part of an expression");
            let expected = "expected columns, numbers, `<`, `and`, ...";
            return error_at(title, at..at + first.len_utf8(), expected);
        };
        found.push((token, at..at + length));
        at += length;
    }
    found.push((Token::End, text.len()..text.len()));
    Ok(found)
}

/// Returns the length of the number at the beginning of a text. All characters count that cannot
/// begin another token, so that `1.5.2` and `2kg` are each one invalid number.
fn number_length(text: &str) -> usize {
    let mut previous = ' ';
    text.find(|c: char| {
        let is_exponent_sign = matches!(c, '+' | '-') && matches!(previous, 'e' | 'E');
        let continues = c.is_alphanumeric() || c == '.' || c == '_' || is_exponent_sign;
        previous = c;
        !continues
    })
    .unwrap_or(text.len())
}

impl Condition {
    /// Parses a condition over the columns of a file.
    ///
    /// # Errors
    /// The first error in the text.
    pub fn parse(text: &str, table: &ResultTable) -> Result<Self, ExpressionError> {
        parse_expression(text, &table.columns, CellKind::Flag)
    }

    /// Returns the conditions that the expression joins by `and`; the whole text if it joins none,
    /// or joins some by `or` too.
    pub fn conjuncts(&self) -> Vec<&str> {
        let Ok(tokens) = tokenize(&self.text) else { return vec![&self.text] };
        let mut depth = 0_usize;
        let mut parts = Vec::new();
        let mut start = 0;
        for (token, span) in tokens {
            match token {
                Token::Sign("(") => depth += 1,
                Token::Sign(")") => depth = depth.saturating_sub(1),
                Token::Word(word) if depth == 0 && word == "or" => return vec![&self.text],
                Token::Word(word) if depth == 0 && word == "and" => {
                    parts.push(self.text[start..span.start].trim());
                    start = span.end;
                }
                _ => {}
            }
        }
        parts.push(self.text[start..].trim());
        parts
    }
}

#[derive(Default)]
struct Parser<'a> {
    tokens: Vec<SpannedToken>,
    /// The index of the next token.
    next: usize,
    columns: &'a [Column],
    /// The names of the columns read so far.
    used: Vec<String>,
    aggregates: Vec<(Aggregate, ExpressionNode)>,
    by_row: bool,
    in_aggregate: bool,
    depth: usize,
}

/// Parses an expression of a wanted type over these columns.
pub(crate) fn parse_expression(
    text: &str,
    columns: &[Column],
    wanted: CellKind,
) -> Result<Condition, ExpressionError> {
    let mut parser = Parser { tokens: tokenize(text)?, columns, ..Parser::default() };
    let root = parser.disjunction()?;
    let (token, span) = parser.peek().clone();
    if token != Token::End {
        let expected = "expected `and`, `or`, a comparison, or the end";
        return error_at("the expression goes on after its end", span, expected);
    }
    if root.kind != wanted {
        let (not, expected) = match wanted {
            CellKind::Flag => {
                ("neither holds nor fails", "expected a comparison, as in `ratio_max < 1.5`")
            }
            _ => ("cannot be minimised", "expected a number, as in `max(ratio_max)`"),
        };
        let title = format!("the expression is {}, which {not}", root.kind.name());
        return error_at(title, root.span, expected);
    }
    let Parser { used, aggregates, by_row, .. } = parser;
    let by_row = by_row || aggregates.is_empty();
    Ok(Condition {
        text: text.trim().to_owned(),
        columns: used,
        root: root.node,
        aggregates,
        by_row,
    })
}

impl Parser<'_> {
    fn peek(&self) -> &SpannedToken {
        &self.tokens[self.next.min(self.tokens.len() - 1)]
    }

    fn next_token(&mut self) -> SpannedToken {
        let token = self.peek().clone();
        self.next += 1;
        token
    }

    fn accepts_word(&mut self, word: &'static str) -> bool {
        self.accept_any(&[(word, ())]).is_some()
    }

    /// Consumes the next token and returns its name and meaning, if it is one of these.
    fn accept_any<T: Copy>(&mut self, known: &[(&'static str, T)]) -> Option<(&'static str, T)> {
        let next = match &self.peek().0 {
            Token::Word(word) => word.as_str(),
            Token::Sign(sign) => sign,
            _ => return None,
        };
        let found = known.iter().find(|(name, _)| *name == next).copied()?;
        self.next += 1;
        Some(found)
    }

    fn disjunction(&mut self) -> ParseResult {
        self.binary_operators(Self::conjunction, CellKind::Flag, &[("or", ExpressionNode::Or)])
    }

    fn conjunction(&mut self) -> ParseResult {
        self.binary_operators(Self::negation, CellKind::Flag, &[("and", ExpressionNode::And)])
    }

    /// Parses operands of one type, joined by left-associative operators of that type.
    fn binary_operators(
        &mut self,
        operand: fn(&mut Self) -> ParseResult,
        kind: CellKind,
        known: &[(&'static str, BinaryNode)],
    ) -> ParseResult {
        let mut left = operand(self)?;
        while let Some((word, node)) = self.accept_any(known) {
            let right = operand(self)?;
            let rule = match kind {
                CellKind::Flag => format!("`{word}` joins what is true or false"),
                _ => "only numbers are calculated with".to_owned(),
            };
            for side in [&left, &right] {
                expect(side, kind, &rule)?;
            }
            let span = left.span.start..right.span.end;
            left = TypedNode { node: node(Box::new(left.node), Box::new(right.node)), kind, span };
        }
        Ok(left)
    }

    fn negation(&mut self) -> ParseResult {
        let start = self.peek().1.start;
        if !self.accepts_word("not") {
            return self.comparison();
        }
        let inner = self.nested(Self::negation)?;
        expect(&inner, CellKind::Flag, "`not` turns true into false")?;
        let span = start..inner.span.end;
        Ok(TypedNode {
            node: ExpressionNode::Not(Box::new(inner.node)),
            kind: CellKind::Flag,
            span,
        })
    }

    fn comparison(&mut self) -> ParseResult {
        let left = self.sum()?;
        if self.accepts_word("is") {
            let negated = self.accepts_word("not");
            let end = self.peek().1.clone();
            if !self.accepts_word("null") {
                return error_at("`is` asks for null", end, "expected `null` or `not null`");
            }
            let span = left.span.start..end.end;
            let node = ExpressionNode::IsNull(Box::new(left.node));
            let node = if negated { ExpressionNode::Not(Box::new(node)) } else { node };
            return Ok(TypedNode { node, kind: CellKind::Flag, span });
        }
        let Some((_, comparison)) = self.accept_any(&COMPARISONS) else { return Ok(left) };
        let right = self.sum()?;
        if left.kind != right.kind {
            let title = format!("{} is compared with {}", left.kind.name(), right.kind.name());
            let expected = match left.kind {
                CellKind::Text => "expected a text, as in \"ok\"".to_owned(),
                kind => format!("expected {}", kind.name()),
            };
            return error_at(title, right.span, expected);
        }
        let second = self.peek().1.clone();
        if self.accept_any(&COMPARISONS).is_some() {
            let expected = "expected `and`: write `a < x and x < b`";
            return error_at("a comparison of three values", second, expected);
        }
        let span = left.span.start..right.span.end;
        let node = ExpressionNode::Compare(comparison, Box::new(left.node), Box::new(right.node));
        Ok(TypedNode { node, kind: CellKind::Flag, span })
    }

    fn sum(&mut self) -> ParseResult {
        self.binary_operators(Self::product, CellKind::Number, &SUMS)
    }

    fn product(&mut self) -> ParseResult {
        self.binary_operators(Self::factor, CellKind::Number, &PRODUCTS)
    }

    fn factor(&mut self) -> ParseResult {
        let (token, span) = self.next_token();
        let typed = |node, kind| Ok(TypedNode { node, kind, span: span.clone() });
        match token {
            Token::Number(number) => {
                typed(ExpressionNode::Literal(Cell::Number(number)), CellKind::Number)
            }
            Token::Text(text) => typed(ExpressionNode::Literal(Cell::Text(text)), CellKind::Text),
            Token::Sign("-") => {
                let inner = self.nested(Self::factor)?;
                expect(&inner, CellKind::Number, "only a number has a sign")?;
                let span = span.start..inner.span.end;
                let node = ExpressionNode::Unary(|number| -number, Box::new(inner.node));
                Ok(TypedNode { node, kind: CellKind::Number, span })
            }
            Token::Sign("(") => {
                let inner = self.nested(Self::disjunction)?;
                let end = self.closing_parenthesis()?;
                Ok(TypedNode { span: span.start..end, ..inner })
            }
            Token::Word(word) if word == "true" || word == "false" => {
                typed(ExpressionNode::Literal(Cell::Flag(word == "true")), CellKind::Flag)
            }
            Token::Word(word) if self.peek().0 == Token::Sign("(") => {
                match FUNCTIONS.iter().find(|(name, _)| *name == word) {
                    Some((name, aggregate)) => self.function(name, *aggregate, span),
                    None => unknown_function(word, span),
                }
            }
            Token::Word(word) => self.column(&word, span),
            Token::Sign(_) | Token::End => {
                let title = match token {
                    Token::Sign(sign) => format!("`{sign}` where a value should be"),
                    _ => "the expression ends too early".to_owned(),
                };
                error_at(title, span, "expected a column, a number or `(`")
            }
        }
    }

    fn column(&mut self, word: &str, span: Range<usize>) -> ParseResult {
        let Some(column) = self.columns.iter().find(|column| column.name == word) else {
            let names = self.columns.iter().map(|column| column.name.clone());
            let names = names.chain(FUNCTIONS.map(|(name, _)| name.to_owned())).collect();
            return Err(ExpressionError {
                title: format!("unknown column `{word}`"),
                span,
                expected: "expected a column of the file, or a \"text\" in quotes".to_owned(),
                candidates: Some((word.to_owned(), names)),
            });
        };
        self.by_row |= !self.in_aggregate;
        let known = self.used.iter().position(|used| used == word);
        let place = known.unwrap_or_else(|| {
            self.used.push(word.to_owned());
            self.used.len() - 1
        });
        Ok(TypedNode { node: ExpressionNode::Column(place), kind: column.kind, span })
    }

    fn function(
        &mut self,
        word: &str,
        mut aggregate: Option<Aggregate>,
        span: Range<usize>,
    ) -> ParseResult {
        self.next += 1;
        if aggregate.is_some() && self.in_aggregate {
            let title = format!("`{word}` within another function over all rows");
            return error_at(title, span, "expected a value of single rows");
        }
        let outer = self.in_aggregate;
        self.in_aggregate |= aggregate.is_some();
        let inner = self.nested(Self::disjunction);
        self.in_aggregate = outer;
        let inner = inner?;
        if let Some(Aggregate::Quantile(probability)) = &mut aggregate {
            *probability = self.probability()?;
        }
        let end = self.closing_parenthesis()?;
        let wanted = match aggregate {
            Some(Aggregate::Count | Aggregate::Share) => CellKind::Flag,
            _ => CellKind::Number,
        };
        expect(&inner, wanted, &format!("`{word}` takes {}", wanted.name()))?;
        let node = match aggregate {
            Some(aggregate) => {
                self.aggregates.push((aggregate, inner.node));
                ExpressionNode::Aggregate(self.aggregates.len() - 1)
            }
            None => ExpressionNode::Unary(f64::abs, Box::new(inner.node)),
        };
        Ok(TypedNode { node, kind: CellKind::Number, span: span.start..end })
    }

    /// Parses the probability of a quantile.
    fn probability(&mut self) -> Result<f64, ExpressionError> {
        let expected = "expected a comma and a number from 0 to 1, as in `quantile(x, 0.95)`";
        let (sign, span) = self.next_token();
        if sign != Token::Sign(",") {
            return error_at("`quantile` takes a number and a part of all rows", span, expected);
        }
        match self.next_token() {
            (Token::Number(probability), _) if probability <= 1.0 => Ok(probability),
            (Token::Number(percent), span) if percent <= 100.0 => {
                let title = format!("`{percent}` is not a part of all rows");
                let probability = percent / 100.0;
                error_at(
                    title,
                    span,
                    format!("expected a number from 0 to 1: {probability} for {percent} %"),
                )
            }
            (_, span) => error_at("`quantile` takes a part of all rows", span, expected),
        }
    }

    /// Consumes a closing parenthesis and returns its end.
    fn closing_parenthesis(&mut self) -> Result<usize, ExpressionError> {
        let (token, span) = self.next_token();
        if token == Token::Sign(")") {
            return Ok(span.end);
        }
        error_at("a parenthesis without an end", span, "expected `)`")
    }

    /// Parses a nested expression, up to the greatest depth.
    fn nested(&mut self, parse: fn(&mut Self) -> ParseResult) -> ParseResult {
        if self.depth == MAX_DEPTH {
            let span = self.peek().1.clone();
            let expected = format!("expected at most {MAX_DEPTH} levels");
            return error_at("the expression is nested too deeply", span, expected);
        }
        self.depth += 1;
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }
}

fn unknown_function(word: String, span: Range<usize>) -> ParseResult {
    let names = FUNCTIONS.map(|(name, _)| name.to_owned());
    Err(ExpressionError {
        title: format!("unknown function `{word}`"),
        span,
        expected: format!("expected one of {}", names.join(", ")),
        candidates: Some((word, names.into())),
    })
}

/// Returns an error that states a rule if a node has another type than the wanted one.
fn expect(found: &TypedNode, wanted: CellKind, rule: &str) -> Result<(), ExpressionError> {
    if found.kind == wanted {
        return Ok(());
    }
    let expected = format!("expected {}, found {}", wanted.name(), found.kind.name());
    error_at(rule, found.span.clone(), expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    /// Returns the text at an error's position, and its message.
    fn parse_error(text: &str) -> (String, String) {
        let table = sample::table();
        let error = Condition::parse(text, &table).unwrap_err();
        let at = text.get(error.span.clone()).unwrap_or("").to_owned();
        (at, format!("{}: {}", error.title, error.expected))
    }

    #[test]
    fn errors_have_positions_and_reasons() {
        for (text, at, part) in [
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
            let (found, message) = parse_error(text);
            assert_eq!(found, at, "{text}: {message}");
            assert!(message.contains(part), "{text}: {message}");
        }
        let deep = format!("{}reliable{}", "(".repeat(100), ")".repeat(100));
        assert!(parse_error(&deep).1.contains("too deeply"));
        assert!(parse_error(&format!("{}reliable", "not ".repeat(900))).1.contains("too deeply"));
        assert!(parse_error(&"-".repeat(5000)).1.contains("too long"));
    }

    #[test]
    fn expressions_by_row_differ_from_aggregates() {
        let table = sample::table();
        let by_row = |text: &str| Condition::parse(text, &table).unwrap().by_row;
        assert!(by_row("ratio_max < 1.5 and reliable"));
        assert!(by_row("ratio_max < 2 * mean(ratio_max)"));
        assert!(!by_row("count(not reliable) == 0 and max(abs(ratio_max - 1)) < 3"));
    }
}
