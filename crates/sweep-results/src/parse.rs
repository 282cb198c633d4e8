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
    Symbol(&'static str),
    End,
}

/// The operators and separators. The first match is taken, so that `<=` stands before `<`.
const SYMBOLS: [&str; 13] = ["<=", ">=", "==", "!=", "<", ">", "(", ")", "+", "-", "*", "/", ","];

/// Operators of other languages, and the ones to use.
const FOREIGN_OPERATORS: [(&str, &str); 5] =
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
const SUM_OPERATORS: [(&str, BinaryNode); 2] = [
    ("+", |left, right| ExpressionNode::Binary(|a, b| a + b, left, right)),
    ("-", |left, right| ExpressionNode::Binary(|a, b| a - b, left, right)),
];
/// The operators of products.
const PRODUCT_OPERATORS: [(&str, BinaryNode); 2] = [
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
        let expectation = format!("expected at most {MAX_TEXT_BYTES} characters");
        return error_at("the expression is too long", 0..MAX_TEXT_BYTES.min(1), expectation);
    }
    let mut tokens = Vec::new();
    let mut offset = 0;
    while let Some(first) = text[offset..].chars().next() {
        let remaining_text = &text[offset..];
        let (token, length) = if first.is_whitespace() {
            offset += first.len_utf8();
            continue;
        } else if first.is_ascii_digit() || first == '.' {
            let token_length = number_length(remaining_text);
            let number = remaining_text[..token_length]
                .parse::<f64>()
                .ok()
                .filter(|number| number.is_finite());
            let Some(number) = number else {
                let title = format!("`{}` is not a number", &remaining_text[..token_length]);
                return error_at(
                    title,
                    offset..offset + token_length,
                    "expected a number such as 1.5 or 2e-3",
                );
            };
            (Token::Number(number), token_length)
        } else if first.is_alphabetic() || first == '_' {
            let is_end_of_word = |letter: char| !(letter.is_alphanumeric() || letter == '_');
            let token_length = remaining_text.find(is_end_of_word).unwrap_or(remaining_text.len());
            (Token::Word(remaining_text[..token_length].to_owned()), token_length)
        } else if first == '"' || first == '\'' {
            let Some(quote_length) = remaining_text[1..].find(first) else {
                let span = offset..text.len();
                return error_at(
                    "a text without an end",
                    span,
                    format!("expected a closing {first}"),
                );
            };
            (Token::Text(remaining_text[1..=quote_length].to_owned()), quote_length + 2)
        } else if let Some((foreign_operator, replacement)) =
            FOREIGN_OPERATORS.iter().find(|(foreign_operator, _)| {
                remaining_text.starts_with(foreign_operator)
                    && !(remaining_text.starts_with("==") || remaining_text.starts_with("!="))
            })
        {
            let title = format!("`{foreign_operator}` is not part of an expression");
            return error_at(
                title,
                offset..offset + foreign_operator.len(),
                format!("expected `{replacement}`"),
            );
        } else if let Some(symbol) =
            SYMBOLS.iter().find(|symbol| remaining_text.starts_with(*symbol))
        {
            (Token::Symbol(symbol), symbol.len())
        } else {
            let title = format!("`{first}` is not part of an expression");
            let expectation = "expected columns, numbers, `<`, `and`, ...";
            return error_at(title, offset..offset + first.len_utf8(), expectation);
        };
        tokens.push((token, offset..offset + length));
        offset += length;
    }
    tokens.push((Token::End, text.len()..text.len()));
    Ok(tokens)
}

/// Returns the length of the number at the beginning of a text. All characters count that cannot
/// begin another token, so that `1.5.2` and `2kg` are each one invalid number.
fn number_length(text: &str) -> usize {
    let mut previous_letter = ' ';
    text.find(|letter: char| {
        let is_exponent_sign = matches!(letter, '+' | '-') && matches!(previous_letter, 'e' | 'E');
        let is_part_of_number =
            letter.is_alphanumeric() || letter == '.' || letter == '_' || is_exponent_sign;
        previous_letter = letter;
        !is_part_of_number
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
        let mut conjuncts = Vec::new();
        let mut start = 0;
        for (token, span) in tokens {
            match token {
                Token::Symbol("(") => depth += 1,
                Token::Symbol(")") => depth = depth.saturating_sub(1),
                Token::Word(word) if depth == 0 && word == "or" => return vec![&self.text],
                Token::Word(word) if depth == 0 && word == "and" => {
                    conjuncts.push(self.text[start..span.start].trim());
                    start = span.end;
                }
                _ => {}
            }
        }
        conjuncts.push(self.text[start..].trim());
        conjuncts
    }
}

#[derive(Default)]
struct Parser<'a> {
    tokens: Vec<SpannedToken>,
    /// The index of the next token.
    next_index: usize,
    columns: &'a [Column],
    /// The names of the columns read so far.
    used_columns: Vec<String>,
    aggregates: Vec<(Aggregate, ExpressionNode)>,
    is_by_row: bool,
    is_in_aggregate: bool,
    depth: usize,
}

/// Parses an expression of an expected type over these columns.
pub(crate) fn parse_expression(
    text: &str,
    columns: &[Column],
    expected_kind: CellKind,
) -> Result<Condition, ExpressionError> {
    let mut parser = Parser { tokens: tokenize(text)?, columns, ..Parser::default() };
    let root = parser.parse_disjunction()?;
    let (token, span) = parser.peek().clone();
    if token != Token::End {
        let expected = "expected `and`, `or`, a comparison, or the end";
        return error_at("the expression goes on after its end", span, expected);
    }
    if root.kind != expected_kind {
        let (objection, expected) = match expected_kind {
            CellKind::Flag => {
                ("neither holds nor fails", "expected a comparison, as in `ratio_max < 1.5`")
            }
            _ => ("cannot be minimised", "expected a number, as in `max(ratio_max)`"),
        };
        let title = format!("the expression is {}, which {objection}", root.kind.name());
        return error_at(title, root.span, expected);
    }
    let Parser { used_columns, aggregates, is_by_row, .. } = parser;
    let is_by_row = is_by_row || aggregates.is_empty();
    Ok(Condition {
        text: text.trim().to_owned(),
        columns: used_columns,
        root: root.node,
        aggregates,
        is_by_row,
    })
}

impl Parser<'_> {
    fn peek(&self) -> &SpannedToken {
        &self.tokens[self.next_index.min(self.tokens.len() - 1)]
    }

    fn next_token(&mut self) -> SpannedToken {
        let token = self.peek().clone();
        self.next_index += 1;
        token
    }

    fn accept_word(&mut self, word: &'static str) -> bool {
        self.accept_any(&[(word, ())]).is_some()
    }

    /// Consumes the next token and returns its name and meaning, if it is one of these.
    fn accept_any<T: Copy>(&mut self, names: &[(&'static str, T)]) -> Option<(&'static str, T)> {
        let next_name = match &self.peek().0 {
            Token::Word(word) => word.as_str(),
            Token::Symbol(symbol) => symbol,
            _ => return None,
        };
        let accepted_name = names.iter().find(|(name, _)| *name == next_name).copied()?;
        self.next_index += 1;
        Some(accepted_name)
    }

    fn parse_disjunction(&mut self) -> ParseResult {
        self.parse_binary_operators(
            Self::parse_conjunction,
            CellKind::Flag,
            &[("or", ExpressionNode::Or)],
        )
    }

    fn parse_conjunction(&mut self) -> ParseResult {
        self.parse_binary_operators(
            Self::parse_negation,
            CellKind::Flag,
            &[("and", ExpressionNode::And)],
        )
    }

    /// Parses operands of one type, joined by left-associative operators of that type.
    fn parse_binary_operators(
        &mut self,
        operand: fn(&mut Self) -> ParseResult,
        kind: CellKind,
        operators: &[(&'static str, BinaryNode)],
    ) -> ParseResult {
        let mut left_node = operand(self)?;
        while let Some((word, node)) = self.accept_any(operators) {
            let right_node = operand(self)?;
            let rule = match kind {
                CellKind::Flag => format!("`{word}` joins what is true or false"),
                _ => "only numbers are calculated with".to_owned(),
            };
            for operand_node in [&left_node, &right_node] {
                expect_kind(operand_node, kind, &rule)?;
            }
            let span = left_node.span.start..right_node.span.end;
            left_node = TypedNode {
                node: node(Box::new(left_node.node), Box::new(right_node.node)),
                kind,
                span,
            };
        }
        Ok(left_node)
    }

    fn parse_negation(&mut self) -> ParseResult {
        let start_offset = self.peek().1.start;
        if !self.accept_word("not") {
            return self.parse_comparison();
        }
        let inner_node = self.parse_nested(Self::parse_negation)?;
        expect_kind(&inner_node, CellKind::Flag, "`not` turns true into false")?;
        let span = start_offset..inner_node.span.end;
        Ok(TypedNode {
            node: ExpressionNode::Not(Box::new(inner_node.node)),
            kind: CellKind::Flag,
            span,
        })
    }

    fn parse_comparison(&mut self) -> ParseResult {
        let left_node = self.parse_sum()?;
        if self.accept_word("is") {
            let is_negated = self.accept_word("not");
            let null_span = self.peek().1.clone();
            if !self.accept_word("null") {
                return error_at("`is` asks for null", null_span, "expected `null` or `not null`");
            }
            let span = left_node.span.start..null_span.end;
            let node = ExpressionNode::IsNull(Box::new(left_node.node));
            let node = if is_negated { ExpressionNode::Not(Box::new(node)) } else { node };
            return Ok(TypedNode { node, kind: CellKind::Flag, span });
        }
        let Some((_, comparison)) = self.accept_any(&COMPARISONS) else { return Ok(left_node) };
        let right_node = self.parse_sum()?;
        if left_node.kind != right_node.kind {
            let title =
                format!("{} is compared with {}", left_node.kind.name(), right_node.kind.name());
            let expected = match left_node.kind {
                CellKind::Text => "expected a text, as in \"ok\"".to_owned(),
                kind => format!("expected {}", kind.name()),
            };
            return error_at(title, right_node.span, expected);
        }
        let second_span = self.peek().1.clone();
        if self.accept_any(&COMPARISONS).is_some() {
            let expected = "expected `and`: write `a < x and x < b`";
            return error_at("a comparison of three values", second_span, expected);
        }
        let span = left_node.span.start..right_node.span.end;
        let node = ExpressionNode::Compare(
            comparison,
            Box::new(left_node.node),
            Box::new(right_node.node),
        );
        Ok(TypedNode { node, kind: CellKind::Flag, span })
    }

    fn parse_sum(&mut self) -> ParseResult {
        self.parse_binary_operators(Self::parse_product, CellKind::Number, &SUM_OPERATORS)
    }

    fn parse_product(&mut self) -> ParseResult {
        self.parse_binary_operators(Self::parse_factor, CellKind::Number, &PRODUCT_OPERATORS)
    }

    fn parse_factor(&mut self) -> ParseResult {
        let (token, span) = self.next_token();
        let typed_node = |node, kind| Ok(TypedNode { node, kind, span: span.clone() });
        match token {
            Token::Number(number) => {
                typed_node(ExpressionNode::Literal(Cell::Number(number)), CellKind::Number)
            }
            Token::Text(text) => {
                typed_node(ExpressionNode::Literal(Cell::Text(text)), CellKind::Text)
            }
            Token::Symbol("-") => {
                let inner_node = self.parse_nested(Self::parse_factor)?;
                expect_kind(&inner_node, CellKind::Number, "only a number has a sign")?;
                let span = span.start..inner_node.span.end;
                let node = ExpressionNode::Unary(|number| -number, Box::new(inner_node.node));
                Ok(TypedNode { node, kind: CellKind::Number, span })
            }
            Token::Symbol("(") => {
                let inner_node = self.parse_nested(Self::parse_disjunction)?;
                let closing_end = self.accept_closing_parenthesis()?;
                Ok(TypedNode { span: span.start..closing_end, ..inner_node })
            }
            Token::Word(word) if word == "true" || word == "false" => {
                typed_node(ExpressionNode::Literal(Cell::Flag(word == "true")), CellKind::Flag)
            }
            Token::Word(word) if self.peek().0 == Token::Symbol("(") => {
                match FUNCTIONS.iter().find(|(name, _)| *name == word) {
                    Some((name, aggregate)) => self.parse_function(name, *aggregate, span),
                    None => unknown_function_error(word, span),
                }
            }
            Token::Word(word) => self.parse_column(&word, span),
            Token::Symbol(_) | Token::End => {
                let title = match token {
                    Token::Symbol(symbol) => format!("`{symbol}` where a value should be"),
                    _ => "the expression ends too early".to_owned(),
                };
                error_at(title, span, "expected a column, a number or `(`")
            }
        }
    }

    fn parse_column(&mut self, word: &str, span: Range<usize>) -> ParseResult {
        let Some(column) = self.columns.iter().find(|column| column.name == word) else {
            let valid_names = self.columns.iter().map(|column| column.name.clone());
            let valid_names =
                valid_names.chain(FUNCTIONS.map(|(name, _)| name.to_owned())).collect();
            return Err(ExpressionError {
                title: format!("unknown column `{word}`"),
                span,
                expected: "expected a column, or a \"text\" in quotes".to_owned(),
                candidates: Some((word.to_owned(), valid_names)),
            });
        };
        self.is_by_row |= !self.is_in_aggregate;
        let index_if_used = self.used_columns.iter().position(|used_column| used_column == word);
        let index = index_if_used.unwrap_or_else(|| {
            self.used_columns.push(word.to_owned());
            self.used_columns.len() - 1
        });
        Ok(TypedNode { node: ExpressionNode::Column(index), kind: column.kind, span })
    }

    fn parse_function(
        &mut self,
        word: &str,
        mut aggregate: Option<Aggregate>,
        span: Range<usize>,
    ) -> ParseResult {
        self.next_index += 1;
        if aggregate.is_some() && self.is_in_aggregate {
            let title = format!("`{word}` within another function over all rows");
            return error_at(title, span, "expected a value of single rows");
        }
        let was_in_aggregate = self.is_in_aggregate;
        self.is_in_aggregate |= aggregate.is_some();
        let inner_node = self.parse_nested(Self::parse_disjunction);
        self.is_in_aggregate = was_in_aggregate;
        let inner_node = inner_node?;
        if let Some(Aggregate::Quantile(probability)) = &mut aggregate {
            *probability = self.parse_probability()?;
        }
        let closing_end = self.accept_closing_parenthesis()?;
        let expected_kind = match aggregate {
            Some(Aggregate::Count | Aggregate::Share) => CellKind::Flag,
            _ => CellKind::Number,
        };
        expect_kind(
            &inner_node,
            expected_kind,
            &format!("`{word}` takes {}", expected_kind.name()),
        )?;
        let node = match aggregate {
            Some(aggregate) => {
                self.aggregates.push((aggregate, inner_node.node));
                ExpressionNode::Aggregate(self.aggregates.len() - 1)
            }
            None => ExpressionNode::Unary(f64::abs, Box::new(inner_node.node)),
        };
        Ok(TypedNode { node, kind: CellKind::Number, span: span.start..closing_end })
    }

    /// Parses the probability of a quantile.
    fn parse_probability(&mut self) -> Result<f64, ExpressionError> {
        let expected = "expected a comma and a number from 0 to 1, as in `quantile(x, 0.95)`";
        let (comma, span) = self.next_token();
        if comma != Token::Symbol(",") {
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
    fn accept_closing_parenthesis(&mut self) -> Result<usize, ExpressionError> {
        let (token, span) = self.next_token();
        if token == Token::Symbol(")") {
            return Ok(span.end);
        }
        error_at("a parenthesis without an end", span, "expected `)`")
    }

    /// Parses a nested expression, up to the greatest depth.
    fn parse_nested(&mut self, parse: fn(&mut Self) -> ParseResult) -> ParseResult {
        if self.depth == MAX_DEPTH {
            let span = self.peek().1.clone();
            let expected = format!("expected at most {MAX_DEPTH} levels");
            return error_at("the expression is nested too deeply", span, expected);
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }
}

fn unknown_function_error(word: String, span: Range<usize>) -> ParseResult {
    let function_names = FUNCTIONS.map(|(name, _)| name.to_owned());
    Err(ExpressionError {
        title: format!("unknown function `{word}`"),
        span,
        expected: format!("expected one of {}", function_names.join(", ")),
        candidates: Some((word, function_names.into())),
    })
}

/// Returns an error that states a rule if a node has another type than the expected one.
fn expect_kind(
    node: &TypedNode,
    expected_kind: CellKind,
    rule: &str,
) -> Result<(), ExpressionError> {
    if node.kind == expected_kind {
        return Ok(());
    }
    let expected = format!("expected {}, found {}", expected_kind.name(), node.kind.name());
    error_at(rule, node.span.clone(), expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    /// Returns the text at an error's position, and its message.
    fn parse_error(text: &str) -> (String, String) {
        let table = sample::table();
        let error = Condition::parse(text, &table).unwrap_err();
        let text_at_error = text.get(error.span.clone()).unwrap_or("").to_owned();
        (text_at_error, format!("{}: {}", error.title, error.expected))
    }

    #[test]
    fn errors_have_positions_and_reasons() {
        for (text, text_at_error, message_part) in [
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
            let (reported_text, message) = parse_error(text);
            assert_eq!(reported_text, text_at_error, "{text}: {message}");
            assert!(message.contains(message_part), "{text}: {message}");
        }
        let deep_text = format!("{}reliable{}", "(".repeat(100), ")".repeat(100));
        assert!(parse_error(&deep_text).1.contains("too deeply"));
        assert!(parse_error(&format!("{}reliable", "not ".repeat(900))).1.contains("too deeply"));
        assert!(parse_error(&"-".repeat(5000)).1.contains("too long"));
    }

    #[test]
    fn expressions_by_row_differ_from_aggregates() {
        let table = sample::table();
        let is_by_row = |text: &str| Condition::parse(text, &table).unwrap().is_by_row;
        assert!(is_by_row("ratio_max < 1.5 and reliable"));
        assert!(is_by_row("ratio_max < 2 * mean(ratio_max)"));
        assert!(!is_by_row("count(not reliable) == 0 and max(abs(ratio_max - 1)) < 3"));
    }
}
