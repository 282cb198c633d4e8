"""Finds deviations of Rust code from the rules of language that a program can check.

`check_lines.py` calls this module; CONTRIBUTING.md has the rules. A finding has a file, a line, a
kind and a text.
"""

import collections
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

# The last commit whose subject is not checked, because it is older than the rule.
LAST_OLD_SUBJECT = "8ddff34c"
MAX_SUBJECT_COLUMNS = 72
# Verbs with which the subject of a commit may begin.
IMPERATIVES = set("""
    Accept Add Allow Announce Answer Apply Ask Avoid Bind Bound Build Call Change Check Clarify
    Clean Close Collect Compare Complete Compute Copy Correct Count Cut Decide Declare Delete Derive
    Describe Document Draw Drop End Evaluate Exclude Expect Explain Export Extend Fail Find Fix
    Follow Format Give Guard Handle Hold Implement Import Improve Include Install Integrate Join
    Keep Leave Let Limit List Load Lock Make Map Mark Match Measure Mend Merge Move Name Note Order
    Parse Pass Plot Point Prefer Print Promise Protect Prove Put Raise Read Record Reduce Refuse
    Release Remove Rename Renew Repair Replace Report Require Reset Respect Restore Return Review
    Rewrite Round Run Save Say Search Separate Set Share Shorten Show Simplify Skip Solve Sort Speed
    Split Start State Stop Store Support Take Tell Test Tighten Track Trust Try Turn Type Unify
    Update Use Validate Verify Wait Warn Widen Wrap Write
""".split())

# First words of comments that are no sentences of their own. "Whether" may document a bool.
INVALID_BEGINNING = re.compile(r"(What|Where|Whether|How|Of|As|Its|One|The same|Those|By)\b")
# Names of constants that are unclear outside of their module.
UNCLEAR_CONSTANTS = {"MOST", "CLOSE", "SHARE", "REACH", "KINDS"}

COMMENT = re.compile(r"\s*(///|//!|//)(?!/)\s?(.*)")
ATTRIBUTE = re.compile(r"\s*#!?\[")
FUNCTION = re.compile(
    r"\s*(pub(\([a-z: ]+\))? )?(default )?(const )?(async )?(unsafe )?(extern \"C\" )?fn (\w+)")
CONSTANT = re.compile(r"\s*(pub(\([a-z: ]+\))? )?(const|static) ([A-Z][A-Z0-9_]*): [^,]*(=|;)")
TYPE = re.compile(r"(pub(\([a-z: ]+\))? )?(struct|enum|union|trait|type) ([A-Z]\w*)")
TUPLE = re.compile(
    r"let \(((?:mut )?[a-z_]\w*(?:, (?:mut )?[a-z_]\w*)*)\)(?:: \([^=]*\))? =\s*\(")
# Names that begin with a preposition.
OF_NAME = re.compile(r"\bof_[a-z0-9_]+")
TRAIT_BLOCK = re.compile(r"(unsafe )?impl\b.*\bfor\b")
STRING = re.compile(r'"(?:[^"\\]|\\.)*"')

# The kinds of findings with their descriptions.
KINDS = {
    "beginning": "comments that begin with What, Where, Of, ...",
    "verb": "documentation of a function that does not begin with a verb",
    "of_": "names of_*",
    "tuple": "tuples of plain bindings",
    "constant": "constants without a comment, or of a bare name",
    "twice": "type names that stand twice",
}

Finding = collections.namedtuple("Finding", "crate name line kind text")


def rust_files():
    """Returns the names of the repository's Rust files."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.rs"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split("\0")
    return [name for name in sorted(set(listing)) if name and (ROOT / name).is_file()]


def crate_of(name):
    """Returns the name of a file's crate, or of its top-level folder."""
    parts = name.split("/")
    return parts[1] if parts[0] == "crates" else parts[0]


def is_test(name):
    """Returns whether a file has only tests, benchmarks or examples."""
    return bool(re.search(r"(^|/)(tests|benches|examples)(/|\.rs$)", name))


def begins_with_verb(text):
    """Returns whether the spelling of a text's first word is that of a verb in third person."""
    word = re.match(r"[A-Z][a-z]+", text)
    return bool(word) and word[0].endswith("s") and word[0] not in {"This", "Its", "As", "Is"}


def tuple_ends_statement(text, opening):
    """Returns whether the parentheses at `opening` are a tuple that ends the statement."""
    depth, commas = 0, 0
    for index in range(opening, len(text)):
        if text[index] in "([{":
            depth += 1
        elif text[index] in ")]}":
            depth -= 1
            if depth == 0:
                return commas > 0 and text[index + 1:index + 2] == ";"
        elif text[index] == "," and depth == 1:
            commas += 1
    return False


class Source:
    """The lines of a file and the findings in them."""

    def __init__(self, name):
        self.name, self.crate = name, crate_of(name)
        self.lines = (ROOT / name).read_text().splitlines()
        self.findings, self.types = [], []
        tests = [k for k, line in enumerate(self.lines) if line == "mod tests {"]
        self.first_test = 0 if is_test(name) else tests[0] if tests else len(self.lines)

    def add(self, index, kind, text):
        """Adds a finding at the line of an index."""
        self.findings.append(Finding(self.crate, self.name, index + 1, kind, text.strip()))

    def next_code(self, index):
        """Returns the index of the first line, from `index` on, of code except attributes."""
        while index < len(self.lines):
            line = self.lines[index]
            if ATTRIBUTE.match(line):
                # An attribute may take several lines.
                while index < len(self.lines) and not self.lines[index].rstrip().endswith("]"):
                    index += 1
            elif not COMMENT.match(line):
                return index
            index += 1
        return index

    def signature(self, index):
        """Returns a declaration as one line, without its body."""
        text = ""
        for line in self.lines[index:index + 12]:
            text += " " + line.strip()
            if line.rstrip().endswith(("{", ";", ",", "}")):
                break
        return text

    def check_comments(self):
        """Checks the first words of all comments."""
        previous_marker = None
        for index, line in enumerate(self.lines):
            comment = COMMENT.match(line)
            marker = comment[1] if comment else None
            if comment and marker != previous_marker:
                self.check_beginning(index, marker, comment[2])
            previous_marker = marker

    def check_beginning(self, index, marker, text):
        """Checks the first words of a comment."""
        beginning = INVALID_BEGINNING.match(text)
        declared = self.next_code(index)
        code = self.signature(declared)
        if beginning:
            if beginning[1] != "Whether" or not re.search(r"\bbool\b", code):
                self.add(index, "beginning", text)
        elif marker == "///" and declared < len(self.lines) and declared < self.first_test:
            is_predicate = text.startswith("Whether") and "bool" in code
            if FUNCTION.match(self.lines[declared]):
                if not (is_predicate or begins_with_verb(text)):
                    self.add(index, "verb", text)

    def check_code(self):
        """Checks names, bindings and constants, and collects types."""
        # The indentation of the current implementation of a trait. Its constants need no comment,
        # because the trait documents them.
        trait_indent = None
        seen = set()
        for index, line in enumerate(self.lines):
            if COMMENT.match(line):
                continue
            indent = line[:len(line) - len(line.lstrip())]
            if line.strip().startswith(("impl", "unsafe impl")):
                if TRAIT_BLOCK.match(self.signature(index).strip()):
                    trait_indent = indent
            elif line == f"{trait_indent}}}":
                trait_indent = None
            code = STRING.sub('""', line)
            for name in OF_NAME.findall(code):
                if name not in seen:
                    seen.add(name)
                    self.add(index, "of_", name)
            constant = CONSTANT.match(code)
            if constant and index < self.first_test and trait_indent is None:
                self.check_constant(index, constant[4])
            declared = TYPE.match(line)
            # An alias that instantiates a generic type of the same name has the same meaning.
            is_instance = declared and re.search(rf"= [\w:]+::{declared[4]}<", line)
            if declared and index < self.first_test and not is_instance:
                self.types.append((declared[4], index))
        text = "\n".join(
            "" if COMMENT.match(line) else STRING.sub('""', line) for line in self.lines)
        for match in TUPLE.finditer(text):
            if "," in match[1] and tuple_ends_statement(text, match.end() - 1):
                self.add(text.count("\n", 0, match.start()), "tuple", match[0])

    def check_constant(self, index, name):
        """Checks that a constant has a clear name and a comment."""
        if name in UNCLEAR_CONSTANTS:
            self.add(index, "constant", f"{name}: a bare name")
        above = index - 1
        while above >= 0 and ATTRIBUTE.match(self.lines[above]):
            above -= 1
        if above < 0 or not COMMENT.match(self.lines[above]):
            self.add(index, "constant", f"{name}: without a comment")


def language_findings():
    """Returns all findings in the repository's Rust files."""
    sources = [Source(name) for name in rust_files()]
    declarations_by_name = collections.defaultdict(list)
    for source in sources:
        source.check_comments()
        source.check_code()
        for name, index in source.types:
            declarations_by_name[name].append((source, index))
    for name, declarations in declarations_by_name.items():
        for source, index in declarations:
            others = [other for other in declarations if other != (source, index)]
            if others:
                elsewhere = ", ".join(f"{other.name}:{line + 1}" for other, line in others)
                source.add(index, "twice", f"{name}: also at {elsewhere}")
    return [finding for source in sources for finding in source.findings]


def subject_mistakes():
    """Yields mistakes about subjects of commits that are too long or begin with no imperative."""
    listing = subprocess.run(
        ["git", "log", "--no-merges", "--format=%h %s", f"{LAST_OLD_SUBJECT}..HEAD"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )
    if listing.returncode != 0:
        # The folder is a copy without history.
        return
    for line in listing.stdout.splitlines():
        commit, _, subject = line.partition(" ")
        word = subject.partition(" ")[0]
        if len(subject) > MAX_SUBJECT_COLUMNS:
            yield f"{commit}: a subject longer than {MAX_SUBJECT_COLUMNS} columns: {subject}"
        if word not in IMPERATIVES:
            yield f"{commit}: a subject that does not begin with an imperative: {subject}"


def mistakes():
    """Yields the texts of all mistakes."""
    for finding in language_findings():
        yield f"{finding.name}:{finding.line}: {KINDS[finding.kind]}: {finding.text}"
    yield from subject_mistakes()


def report(crates):
    """Yields the findings in the named crates, then the numbers of findings by crate and kind."""
    findings = language_findings()
    if crates:
        for finding in findings:
            if finding.crate in crates:
                yield f"{finding.name}:{finding.line}: {finding.kind}: {finding.text}"
    counts = collections.Counter((finding.crate, finding.kind) for finding in findings)
    names = sorted({finding.crate for finding in findings})
    yield f"{'crate':16}" + "".join(f"{kind:>11}" for kind in KINDS)
    for name in names:
        yield f"{name:16}" + "".join(f"{counts[name, kind]:>11}" for kind in KINDS)
    total = (sum(counts[name, kind] for name in names) for kind in KINDS)
    yield f"{'together':16}" + "".join(f"{count:>11}" for count in total)
    for kind, meaning in KINDS.items():
        yield f"{kind}: {meaning}"
