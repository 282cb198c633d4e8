"""Finds where Rust code does not follow the rules of language that a program can check.

`check_lines.py` runs it; CONTRIBUTING.md has the rules. A finding is a place, a kind and a text.
"""

import collections
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

# The last commit whose subject the rule does not hold for.
LAST_OLD_SUBJECT = "8ddff34c"
SUBJECT_COLUMNS = 72
IMPERATIVES = set("""
    Accept Add Allow Announce Answer Apply Ask Avoid Bound Build Call Change Check Clarify Clean
    Close Collect Compare Compute Copy Correct Count Cut Decide Declare Delete Derive Describe
    Document Draw Drop End Exclude Expect Explain Export Extend Fail Find Fix Follow Format Give
    Guard Handle Hold Implement Import Improve Include Install Integrate Join Keep Leave Let Limit
    List Load Lock Make Map Mark Match Measure Mend Merge Move Name Note Order Parse Plot Point
    Prefer Print Promise Protect Prove Put Raise Read Record Reduce Refuse Release Remove Rename
    Renew Repair Replace Report Require Reset Respect Restore Return Review Rewrite Round Run Save
    Say Search Separate Set Share Shorten Show Simplify Skip Solve Sort Speed Split Start State Stop
    Store Support Take Tell Test Tighten Track Trust Try Turn Type Unify Update Use Validate Verify
    Wait Warn Widen Wrap Write
""".split())

# Beginnings of comments that do not stand alone. "Whether" may document a bool.
BEGINNING = re.compile(r"(What|Where|Whether|How|Of|As|Its|One|The same|Those|By)\b")
# Names that say nothing without their module.
BARE = {"MOST", "CLOSE", "SHARE", "REACH", "KINDS"}

COMMENT = re.compile(r"\s*(///|//!|//)(?!/)\s?(.*)")
ATTRIBUTE = re.compile(r"\s*#!?\[")
FUNCTION = re.compile(
    r"\s*(pub(\([a-z: ]+\))? )?(default )?(const )?(async )?(unsafe )?(extern \"C\" )?fn (\w+)")
CONSTANT = re.compile(r"\s*(pub(\([a-z: ]+\))? )?(const|static) ([A-Z][A-Z0-9_]*): [^,]*(=|;)")
TYPE = re.compile(r"(pub(\([a-z: ]+\))? )?(struct|enum|union|trait|type) ([A-Z]\w*)")
TUPLE = re.compile(
    r"let \(((?:mut )?[a-z_]\w*(?:, (?:mut )?[a-z_]\w*)*)\)(?:: \([^=]*\))? =\s*\(")
OF_NAME = re.compile(r"\bof_[a-z0-9_]+")
TRAIT_BLOCK = re.compile(r"(unsafe )?impl\b.*\bfor\b")
STRING = re.compile(r'"(?:[^"\\]|\\.)*"')

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
    """Names of the Rust files of the repository."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.rs"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split("\0")
    return [name for name in sorted(set(listed)) if name and (ROOT / name).is_file()]


def crate_of(name):
    """Name of the crate, or of the folder, that a file belongs to."""
    parts = name.split("/")
    return parts[1] if parts[0] == "crates" else parts[0]


def is_test(name):
    """Whether a file holds tests alone."""
    return bool(re.search(r"(^|/)(tests|benches|examples)(/|\.rs$)", name))


def begins_with_verb(text):
    """Whether a text begins with a verb in the third person, as far as its spelling shows."""
    word = re.match(r"[A-Z][a-z]+", text)
    return bool(word) and word[0].endswith("s") and word[0] not in {"This", "Its", "As", "Is"}


def tuple_ends_statement(text, opening):
    """Whether the parenthesis at `opening` is a tuple and the whole of the bound expression."""
    depth, commas = 0, 0
    for place in range(opening, len(text)):
        if text[place] in "([{":
            depth += 1
        elif text[place] in ")]}":
            depth -= 1
            if depth == 0:
                return commas > 0 and text[place + 1:place + 2] == ";"
        elif text[place] == "," and depth == 1:
            commas += 1
    return False


class Source:
    """The lines of a file, and what is found in them."""

    def __init__(self, name):
        self.name, self.crate = name, crate_of(name)
        self.lines = (ROOT / name).read_text().splitlines()
        self.findings, self.types = [], []
        tests = [k for k, line in enumerate(self.lines) if line == "mod tests {"]
        self.first_test = 0 if is_test(name) else tests[0] if tests else len(self.lines)

    def add(self, index, kind, text):
        """Notes a finding at the line of an index."""
        self.findings.append(Finding(self.crate, self.name, index + 1, kind, text.strip()))

    def next_code(self, index):
        """The first line from an index on that is neither attribute nor comment."""
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
        """A declaration as one line, up to its body."""
        text = ""
        for line in self.lines[index:index + 12]:
            text += " " + line.strip()
            if line.rstrip().endswith(("{", ";", ",", "}")):
                break
        return text

    def check_comments(self):
        """Looks at the first words of every comment."""
        previous = None
        for index, line in enumerate(self.lines):
            found = COMMENT.match(line)
            marker = found[1] if found else None
            if found and marker != previous:
                self.check_beginning(index, marker, found[2])
            previous = marker

    def check_beginning(self, index, marker, text):
        """Looks at the first words of one comment."""
        beginning = BEGINNING.match(text)
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
        """Looks at names, bindings, constants and types."""
        # The indentation of the implementation of a trait, whose constants the trait documents.
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
            # An instance of a generic type under its own name has the same meaning.
            is_instance = declared and re.search(rf"= [\w:]+::{declared[4]}<", line)
            if declared and index < self.first_test and not is_instance:
                self.types.append((declared[4], index))
        text = "\n".join(
            "" if COMMENT.match(line) else STRING.sub('""', line) for line in self.lines)
        for found in TUPLE.finditer(text):
            if "," in found[1] and tuple_ends_statement(text, found.end() - 1):
                self.add(text.count("\n", 0, found.start()), "tuple", found[0])

    def check_constant(self, index, name):
        """Looks at the name of a constant, and for a comment above it."""
        if name in BARE:
            self.add(index, "constant", f"{name}: a bare name")
        above = index - 1
        while above >= 0 and ATTRIBUTE.match(self.lines[above]):
            above -= 1
        if above < 0 or not COMMENT.match(self.lines[above]):
            self.add(index, "constant", f"{name}: without a comment")


def language_findings():
    """Everything that is found in the repository's Rust files."""
    sources = [Source(name) for name in rust_files()]
    places = collections.defaultdict(list)
    for source in sources:
        source.check_comments()
        source.check_code()
        for name, index in source.types:
            places[name].append((source, index))
    for name, found in places.items():
        for source, index in found:
            others = [other for other in found if other != (source, index)]
            if others:
                elsewhere = ", ".join(f"{other.name}:{line + 1}" for other, line in others)
                source.add(index, "twice", f"{name}: also at {elsewhere}")
    return [finding for source in sources for finding in source.findings]


def subject_mistakes():
    """Subjects of commits that are too long or do not begin with an imperative."""
    listed = subprocess.run(
        ["git", "log", "--no-merges", "--format=%h %s", f"{LAST_OLD_SUBJECT}..HEAD"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )
    if listed.returncode != 0:
        # A copy without history.
        return
    for line in listed.stdout.splitlines():
        commit, _, subject = line.partition(" ")
        word = subject.partition(" ")[0]
        if len(subject) > SUBJECT_COLUMNS:
            yield f"{commit}: a subject longer than {SUBJECT_COLUMNS} columns: {subject}"
        if word not in IMPERATIVES:
            yield f"{commit}: a subject that does not begin with an imperative: {subject}"


def mistakes():
    """Texts of everything that fails the check."""
    for finding in language_findings():
        yield f"{finding.name}:{finding.line}: {KINDS[finding.kind]}: {finding.text}"
    yield from subject_mistakes()


def report(crates):
    """Counts by crate and kind; with names of crates, every place in these."""
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
