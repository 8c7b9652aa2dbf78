#!/usr/bin/env python3
"""Checks that what code and documents cite is in the repository.

    scripts/check_citations.py [--root DIR]     check the tree

scripts/check_citations_test.py checks the checker.

Lines that a comment or a paragraph was wrapped over are read as one. What is checked, in every text file of the tree:

  name.md                      the document exists: from the top of the repository, or from the citing file's folder
  name.md, "Heading"           it has this heading; `"A" and "B"` both, code may cite `name.md#anchor`
  [text](path#anchor)          the same for links of Markdown, to any file
  §4.2, section 4.2            an RFC, another standard or a draft is named before it in the paragraph; of a document of
                               ours it must be a numbered heading
  issue 5, pull request 5      somebody else's: `owner/repository issue 5`; numbers of ours mean nothing to a reader
  NOTES, ../shared             what only some of us have
  a/b.h, src/core/link/, b.cc  in comments and Markdown: the file or folder exists
  `kName`, `Type::kName`       in Markdown: code has a constant of this name

RFCs and papers, by number or title, are cited freely. Each violation is one line `file:line: what`; the exit code is 1.
The tests of the checkers are left out, since they plant what the others must not have.
"""

import os
import re
import sys

import checker_main

SKIPPED_FOLDERS = {".git", "build", "out", "__pycache__"}
SKIPPED_FILES = {"LICENSE", "scripts/check_citations.py", "scripts/check_citations_test.py", "scripts/check_docs_test.py"}
CODE = (".h", ".cc", ".in")
HASHED = (".py", ".sh", ".toml", ".cmake", ".txt", ".yml", "/run")
# Where a path in a comment may begin, as for the compiler; the citing file's folder comes first.
PLACES = ("", "src", "include", "tests", "docs")
TOPS = ("include", "policies", "src", "netns", "bench", "tests", "docs", "scripts", "examples", "cmake", "tc_profiles")
# Paths that stand for others, as tests/GROUP/name_test.cc does.
PLACEHOLDER = re.compile(r"(?:^|/)[A-Z]{2,}(?:/|$)")
# Headers of the system and of libraries, which are no files of ours.
SYSTEM = re.compile(r"(?:arpa|asm|linux|net|netinet|netpacket|sys|bits|boost|opencv2|Eigen|nlohmann|gtest|rapidcheck)/")

# A line break with the comment mark of the next line, in any of the languages used here.
WRAP = re.compile(r"\n[ \t]*(?:///?|\*(?!/)|#+(?!\w)|--)?[ \t]*")
STRING_OR_COMMENT = re.compile(r"""R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)'(?:\\.|[^'\\\n])+'|//[^\n]*|/\*.*?\*/""",
                               re.S)
URL = re.compile(r"https?://[^\s)>\]]+")
MD = re.compile(r"(?<![\w/.])((?:[\w.-]+/)*[\w.-]+\.md)\b(?:#([\w-]+))?")
HEADINGS = re.compile(r"""(?:,|:)?\s+(?:and\s+|,\s*)?["“]([^"”]{2,90})["”]""")
SECTION = re.compile(r"§+\s*(\d[\d.]*\d|\d)|\b[Ss]ections?\s+(\d+(?:\.\d+)*)")
STANDARD = re.compile(r"RFC\s*\d+|\bdraft-[\w-]+|ITU-T|3GPP|\bTS\s\d|IEEE|ISO|ETSI|SMPTE")
ISSUE = re.compile(r"\b(?:[Ii]ssue|[Pp]ull request|PR)s?\s+(?:#|[Nn]o\.?\s*|[Nn]umber\s+)?\d+|\bGH-\d+|\bthe issue\s+(?:asks|says|wants|requires|demands)\b")
FOREIGN = re.compile(r"(?<![\w./-])(?!(?:and/or|%s)\b)[\w.-]+/[\w.-]+\s+\Z" % "|".join(f"{top}/" for top in TOPS))
PRIVATE = re.compile(r"\bNOTES\b|\.\./shared/(?!data\b)[\w./-]*")
LINK = re.compile(r"\[[^\]\[]*(?:\[[^\]]*\][^\]\[]*)?\]\(([^)\s]+)\)")
PATH = re.compile(r"(?<![\w/.~$<{*@:-])((?:[\w.-]+/)*[\w-]+\.(?:h|cc|py|sh|lua|cmake)|(?:%s)(?:/[\w.-]+)+/?)"
                  r"(?![\w/*{<…-])" % "|".join(TOPS))
CONSTANT = re.compile(r"\bk[A-Z]\w+")
HEADING = re.compile(r"^#{1,6} +(.+?) *#*$", re.M)
# What stands before the comment of a line in a language whose comments begin with #: the whole line when it has none.
TRAILING = re.compile(r"^(?:(?!(?:^|[ \t])#[ \t!]).)*", re.M)
FENCE = re.compile(r"^```.*?^```", re.M | re.S)


def keep_length(match):
    """As many blanks as the match has characters, so that offsets into the text stay right."""
    return " " * len(match.group())


def unwrap(text):
    """Joins the lines of each paragraph: line breaks and comment marks become blanks. Offsets stay right."""
    return "\n\n".join(WRAP.sub(keep_length, part) for part in re.split(r"\n\n", text))


def plain(heading):
    """A heading as headings are compared: lower case, without backquotes, single blanks."""
    return re.sub(r"\s+", " ", heading.replace("`", "")).strip().lower()


def anchor(heading):
    """The anchor that GitHub makes of a heading."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.replace("`", "")).lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


def comments_of(text):
    """The text with everything but comments replaced by blanks. Offsets stay right."""
    out, end = [], 0
    for match in STRING_OR_COMMENT.finditer(text):
        out.append(re.sub(r"[^\n]", " ", text[end:match.start()]))
        whole = match.group()
        out.append(whole if whole.startswith(("//", "/*")) else re.sub(r"[^\n]", " ", whole))
        end = match.end()
    out.append(re.sub(r"[^\n]", " ", text[end:]))
    return "".join(out)


class Checker:
    """Checks one tree. After run() `problems` has (file, line, what) and `citations` how many were looked at.

    Methods check_... take a file's path, its text (`whole`: unwrapped) and problem(position, what), which reports.
    """

    def __init__(self, root):
        self.root = root
        self.files = set()
        self.folders = {""}
        self.names = set()
        self.documents = {}
        self.constants = set()
        self.problems = []
        self.citations = 0

    def run(self):
        for directory, folders, files in os.walk(self.root):
            folders[:] = sorted(f for f in folders if f not in SKIPPED_FOLDERS)
            where = os.path.relpath(directory, self.root)
            where = "" if where == "." else where
            self.folders.add(where)
            self.files |= {os.path.join(where, name) for name in files}
            self.names |= set(files)
        texts = {path: self.read(path) for path in sorted(self.files - SKIPPED_FILES)}
        for path, text in texts.items():
            if path.endswith(CODE):
                self.constants |= set(CONSTANT.findall(text or ""))
        for path, text in texts.items():
            if text is not None:
                self.check(path, text)
        return self

    def read(self, path):
        """The text of a file; None when it is no text."""
        try:
            with open(os.path.join(self.root, path), "rb") as file:
                return None if b"\0" in file.peek(4096)[:4096] else file.read().decode("utf-8")
        except (UnicodeDecodeError, FileNotFoundError):
            return None

    def headings(self, path):
        """The headings of a Markdown document, read once."""
        if path not in self.documents:
            self.documents[path] = HEADING.findall(FENCE.sub("", self.read(path) or ""))
        return self.documents[path]

    def check(self, path, text):
        def problem(position, what):
            self.problems.append((path, text.count("\n", 0, position) + 1, what))
        markdown = path.endswith(".md")
        whole = URL.sub(keep_length, unwrap(text))
        self.check_documents(path, whole, problem)
        self.check_sections(path, whole, problem)
        for match in ISSUE.finditer(whole):
            self.citations += 1
            if not FOREIGN.search(whole, max(0, match.start() - 80), match.start()):
                problem(match.start(), f"`{squeeze(match)}`: say what it is; another project's is `owner/repository {squeeze(match)}`")
        for match in PRIVATE.finditer(whole):
            problem(match.start(), f"`{match.group()}` is not in the repository")
        if markdown:
            for match in LINK.finditer(URL.sub(keep_length, FENCE.sub(blank_lines, text))):
                self.check_link(path, match, problem)
            self.check_paths(path, whole, problem)
            for match in re.finditer(r"`(?!kName`)(?:\w+::)*(k[A-Z]\w+)`", whole):
                self.citations += 1
                if match.group(1) not in self.constants:
                    problem(match.start(), f"{match.group(1)} is not in the code")
        elif path.endswith(CODE):
            self.check_paths(path, unwrap(comments_of(text)), problem)
        elif path.endswith(HASHED):
            self.check_paths(path, TRAILING.sub(keep_length, text), problem)

    def locate(self, path, cited, places=("",)):
        """The file or folder that `cited` names in the file `path`: below that file's folder or one of `places`."""
        for place in (os.path.dirname(path), *places):
            found = os.path.normpath(os.path.join(place, cited)) if cited else path
            if found in self.files or found in self.folders:
                return found
        return None

    def check_documents(self, path, whole, problem):
        for match in MD.finditer(whole):
            self.citations += 1
            cited = match.group(1)
            if cited in self.names and whole[match.start() - 1:match.start()] + whole[match.end():match.end() + 1] == '""':
                # A string of code that is a file name and nothing else is a part of a path.
                continue
            found = self.locate(path, cited)
            if found is None:
                problem(match.start(), f"{cited} is not in the repository")
                continue
            if match.group(2) and match.group(2) not in map(anchor, self.headings(found)):
                problem(match.start(), f"{cited} has no anchor #{match.group(2)}")
            if whole[match.end():match.end() + 1] not in (",", ":"):
                continue
            known, position = set(map(plain, self.headings(found))), match.end()
            while (heading := HEADINGS.match(whole, position)):
                if plain(heading.group(1)) not in known:
                    problem(match.start(), f'{cited} has no heading "{squeeze(heading.group(1))}"')
                position = heading.end()

    def check_sections(self, path, whole, problem):
        for match in SECTION.finditer(whole):
            self.citations += 1
            number = match.group(1) or match.group(2)
            before = whole[whole.rfind("\n\n", 0, match.start()) + 1:match.start()]
            standard = max((m.start() for m in STANDARD.finditer(before)), default=-1)
            document = max(MD.finditer(before), key=lambda m: m.start(), default=None)
            if document and document.start() > standard:
                found = self.locate(path, document.group(1))
                numbered = re.compile(re.escape(number) + r"[. ]")
                if found and not any(numbered.match(heading) for heading in self.headings(found)):
                    problem(match.start(), f"{document.group(1)} has no section {number}")
            elif standard < 0:
                problem(match.start(), f"`{squeeze(match)}`: of which document?")

    def check_link(self, path, match, problem):
        self.citations += 1
        target, _, wanted = match.group(1).partition("#")
        if re.match(r"[a-z]+:", target):
            return
        found = self.locate(path, target) if target else path
        # A browser takes links as relative to the folder of the file, never to the top of the repository.
        if target and os.path.normpath(os.path.join(os.path.dirname(path), target)) != found:
            problem(match.start(), f"link to {target}, which is not there")
        elif wanted and wanted not in map(anchor, self.headings(found)):
            problem(match.start(), f"link to {match.group(1)}: no such heading")

    def check_paths(self, path, whole, problem):
        for match in PATH.finditer(whole):
            cited = match.group(1).rstrip(".")
            if "/" not in cited:
                if "." in cited and cited not in self.names:
                    problem(match.start(), f"{cited} is not in the repository")
                self.citations += "." in cited
            elif not SYSTEM.match(cited) and not PLACEHOLDER.search(cited) and ".." not in cited:
                self.citations += 1
                if self.locate(path, cited, PLACES) is None:
                    problem(match.start(), f"{cited} is not in the repository")


def squeeze(match):
    """The text of a match, or a string, on one line."""
    return re.sub(r"\s+", " ", match if isinstance(match, str) else match.group())


def blank_lines(match):
    """Blanks in place of the match; its line breaks stay."""
    return re.sub(r"[^\n]", " ", match.group())


def checked(root):
    checker = Checker(root).run()
    problems = [f"{path}:{line}: {what}" for path, line, what in checker.problems]
    return problems, f"{len(checker.files)} files, {checker.citations} citations, all of them resolve"


if __name__ == "__main__":
    sys.exit(checker_main.main("citations", __doc__, checked))
