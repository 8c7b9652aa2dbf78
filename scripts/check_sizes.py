#!/usr/bin/env python3
"""Checks the sizes of files, headers, functions and classes, and tells how many headers a single file includes.

    scripts/check_sizes.py [--root DIR]     check every .h and .cc that git knows or would add

scripts/check_sizes_test.py checks the checker.

The limits are the constants below. A function is what has a body: methods, cases of GoogleTest and properties of rapidcheck
too; its lines are those from its name to its closing brace. Its nesting is that of the blocks of if, else, for, while, do,
switch, try and catch, through a lambda, too. A class has the functions that are defined in it or for it, in
whichever file, and their lines. universal-ctags finds both.

scripts/size_exceptions.txt names what may be larger for good, `KIND NAME: reason`, where KIND is `function`, `class` or `nesting`: at most
MOST_EXCEPTIONS, and none for the length of a file. scripts/ceilings.txt names what is too large today and may not grow,
`KIND NAME FIGURE...`, where KIND may also be `file`, `header` or `nesting` (of a function); a class has two figures, its functions and their lines. A row of
either that is not needed fails too.

A header and the .cc of its name are one here: where a single other one of PRODUCT includes a header, both could be one file.
SHARED_LITTLE is the largest share of these in per cent.

Each finding is one line `file:line: what; remedy`, and the exit code is 1; 2 where ctags is missing.
"""

import collections
import json
import os
import re
import subprocess
import sys

import ceilings
import checker_main
from check_layers import bare_code, line_of

FILE_LINES = 400
HEADER_LINES = 200
FUNCTION_LINES = 60
NESTING = 3
CLASS_FUNCTIONS = 45
CLASS_LINES = 600
MOST_EXCEPTIONS = 5
SHARED_LITTLE = 20
PRODUCT = ("include/", "policies/", "src/", "netns/")

BRACKET = re.compile(r"[(){}]")
# What stands before the parenthesis of a statement, and before a block that has none.
CONDITION = re.compile(r"\b(?:if|for|while|switch|catch)(?:\s+constexpr)?\s*\Z")
BLOCK = re.compile(r"\b(?:else|do|try)\s*\Z")
EXCEPTIONS = "scripts/size_exceptions.txt"
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">\n]+)[">]', re.MULTILINE)
# A property reads as a function to ctags only without the parentheses around its arguments.
CTAGS = ["ctags", "--options=NONE", "--output-format=json", "--fields=+neKsZS", "--kinds-C++=fcsu", "--langmap=C++:+.h",
         "-DRC_GTEST_PROP(a,b,c)=void RC_GTEST_PROP(a,b)", "-DRC_GTEST_FIXTURE_PROP(a,b,c)=void RC_GTEST_FIXTURE_PROP(a,b)",
         "-L", "-", "-f", "-"]

# Where it is, and its figures, in the order of their limits.
Thing = collections.namedtuple("Thing", "where figures")
LIMITS = {"file": (FILE_LINES,), "header": (HEADER_LINES,), "function": (FUNCTION_LINES,),
          "nesting": (NESTING,), "class": (CLASS_FUNCTIONS, CLASS_LINES)}
UNITS = {"class": ("functions", "lines of bodies"), "nesting": ("levels",)}
REMEDIES = {"file": "divide it by what it is about", "header": "divide it by what it is about",
            "function": "give a part of it a name", "nesting": "give what is inside a name", "class": "take out what has a purpose of its own"}


def list_files(root):
    listed = subprocess.run(["git", "-c", f"safe.directory={root}", "ls-files", "--cached", "--others", "--exclude-standard",
                             "--", "*.h", "*.cc"], cwd=root, check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted({path for path in listed if os.path.isfile(os.path.join(root, path))})


def read(root, path):
    with open(os.path.join(root, path), encoding="utf-8", errors="replace") as file:
        return file.read()


def tags_of(root, files):
    out = subprocess.run(CTAGS, input="\n".join(files), cwd=root, check=True, capture_output=True, text=True).stdout
    return [tag for tag in map(json.loads, out.splitlines()) if tag["_type"] == "tag" and "end" in tag]


def full_name(tag):
    """Its name with all scopes; an anonymous namespace or lambda, whose name ctags makes up, has none."""
    name = tag["name"]
    if name.startswith(("TEST", "RC_GTEST")):
        name += tag["signature"].replace(",", ".")
    name = "::".join(filter(None, (tag.get("scope"), name)))
    return re.sub(r"__anon\w+", "(anonymous)", name).replace(" ", "")


def nested(code):
    """[(line, depth)] of the blocks of statements within others."""
    blocks, opened, closed, found = [], [], (0, 0), []
    for match in BRACKET.finditer(code):
        here, bracket = match.start(), match.group()
        if bracket == "(":
            opened.append(here)
        elif bracket == ")":
            closed = (opened.pop() if opened else 0, match.end())
        elif bracket == "{":
            blocks.append(bool(BLOCK.search(code, max(0, here - 40), here)) if code[closed[1]:here].strip() else
                          bool(CONDITION.search(code, max(0, closed[0] - 40), closed[0])))
            if blocks[-1] and sum(blocks) > 1:
                found.append((line_of(code, here), sum(blocks)))
        elif blocks:
            blocks.pop()
    return found


def nesting_of(root, files, tags):
    """{("nesting", name): Thing} of the functions that have blocks in each other."""
    functions, things = collections.defaultdict(list), {}
    for tag in tags:
        if tag["kind"] == "function" and not tag["name"].startswith("__anon"):
            functions[tag["path"]].append(tag)
    for path in files:
        for line, depth in nested(bare_code(read(root, path))):
            around = max((tag for tag in functions[path] if tag["line"] <= line <= tag["end"]), key=lambda tag: tag["line"], default=None)
            key = "nesting", full_name(around) if around else path
            if key not in things or things[key].figures < (depth,):
                things[key] = Thing(f"{path}:{line}", (depth,))
    return things


def things_of(root, files):
    """{(kind, name): Thing} of everything that a limit is for. Of functions of one name it is the longest."""
    things = {}
    for path in files:
        kind = "header" if path.endswith(".h") else "file"
        things[kind, path] = Thing(f"{path}:1", (read(root, path).count("\n"),))
    tags = tags_of(root, files)
    things |= nesting_of(root, files, tags)
    classes = {(full_name(tag), tag["path"] if "__anon" in tag.get("scope", "") else ""): tag
               for tag in tags if tag["kind"] != "function"}
    bodies = collections.defaultdict(list)
    for tag in (tag for tag in tags if tag["kind"] == "function"):
        lines, name = tag["end"] - tag["line"] + 1, full_name(tag)
        if ("function", name) not in things or things["function", name].figures < (lines,):
            things["function", name] = Thing(f"{tag['path']}:{tag['line']}", (lines,))
        owner = (name.rpartition("::")[0] if "(" not in tag["name"] else "", tag["path"] if "__anon" in tag.get("scope", "") else "")
        if owner in classes:
            bodies[owner].append(lines)
    for owner, lines in bodies.items():
        tag, key = classes[owner], ("class", owner[0])
        figures = (len(lines), sum(lines))
        if key not in things or things[key].figures < figures:
            things[key] = Thing(f"{tag['path']}:{tag['line']}", figures)
    return things


def shared_little(root, files):
    """The headers that a single file includes, and how many there are of a header with its .cc, or either alone."""
    stem = {path: path.rpartition(".")[0] for path in files if path.startswith(PRODUCT)}
    includers = collections.defaultdict(set)
    for path in stem:
        for header in INCLUDE.findall(read(root, path)):
            for place in (os.path.dirname(path), "include", "src", ""):
                target = stem.get(os.path.normpath(os.path.join(place, header)))
                if target:
                    includers[target].add(stem[path])
                    break
    return sorted(name for name, others in includers.items() if len(others - {name}) == 1), len(set(stem.values()))


def titled(kind, name):
    return f"{kind} of {name}" if kind == "nesting" else f"{kind} {name}"


def in_words(kind, figures):
    return " and ".join(f"{figure} {unit}" for figure, unit in zip(figures, UNITS.get(kind, ("lines",))))


class Checker:
    def __init__(self, root):
        self.root = root
        self.problems = []

    def run(self):
        self.files = list_files(self.root)
        self.things = things_of(self.root, self.files)
        self.large = {key: thing for key, thing in self.things.items()
                      if any(figure > limit for figure, limit in zip(thing.figures, LIMITS[key[0]]))}
        excepted = self.read_exceptions()
        ceiling = self.read_ceilings()
        for (kind, name), thing in sorted(self.large.items()):
            if (kind, name) not in excepted and (kind, name) not in ceiling:
                self.problems.append(f"{thing.where}: the {titled(kind, name)} has {in_words(kind, thing.figures)}, the limit is "
                                     f"{in_words(kind, LIMITS[kind])}; {REMEDIES[kind]}")
        self.alone, self.rooms = shared_little(self.root, self.files)
        self.share = 100 * len(self.alone) / max(1, self.rooms)
        if self.share > SHARED_LITTLE:
            self.problems.append(f"scripts/check_sizes.py:1: {self.share:.0f} % of the headers have a single file that includes "
                                 f"them, the limit is {SHARED_LITTLE} %; move some into it, of: {' '.join(self.alone)}")
        return self

    def read_exceptions(self):
        excepted = {}
        path = os.path.join(self.root, EXCEPTIONS)
        if os.path.exists(path):
            for number, line in enumerate(read(self.root, EXCEPTIONS).splitlines(), 1):
                if line.strip() and not line.startswith("#"):
                    self.read_exception(f"{EXCEPTIONS}:{number}", line, excepted)
        if len(excepted) > MOST_EXCEPTIONS:
            self.problems.append(f"{EXCEPTIONS}:1: {len(excepted)} exceptions, the limit is {MOST_EXCEPTIONS}; make some of these smaller")
        return excepted

    def read_exception(self, where, line, excepted):
        thing, _, reason = line.partition(": ")
        kind, _, name = thing.partition(" ")
        if kind not in ("function", "class", "nesting") or not name or not reason.strip():
            self.problems.append(f"{where}: write `function NAME: reason`, `class` or `nesting`; for lengths of files there is none")
        elif (kind, name) not in self.large:
            self.problems.append(f"{where}: {name} is no {kind} above the limit; strike the row")
        else:
            excepted[kind, name] = where

    def read_ceilings(self):
        ceiling = set()
        for line, kind, words in ceilings.read(self.root, LIMITS):
            where, name, figures = ceilings.where(line), words[0], tuple(map(int, words[1:]))
            thing = self.large.get((kind, name))
            if not thing:
                self.problems.append(f"{where}: {name} is no {kind} above the limit; strike the row")
                continue
            ceiling.add((kind, name))
            if len(figures) != len(thing.figures) or any(figure > limit for figure, limit in zip(thing.figures, figures)):
                self.problems.append(f"{thing.where}: the {titled(kind, name)} has {in_words(kind, thing.figures)}, its row in "
                                     f"{where} allows {in_words(kind, figures)}; {REMEDIES[kind]}")
        return ceiling


def checked(root):
    checker = Checker(root).run()
    print(f"headers that a single file includes: {len(checker.alone)} of {checker.rooms} = {checker.share:.0f} %")
    kinds = collections.Counter(kind for kind, _ in checker.things)
    lines = sum(thing.figures[0] for (kind, _), thing in checker.things.items() if kind in ("file", "header"))
    return checker.problems, (f"{lines} lines in {len(checker.files)} files, {kinds['function']} functions, {kinds['class']} classes, "
                              f"{len(checker.large)} of them larger than the limit by an exception or a ceiling")


if __name__ == "__main__":
    sys.exit(checker_main.main("sizes", __doc__, checked))
