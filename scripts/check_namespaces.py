#!/usr/bin/env python3
"""Checks that the namespace of each file is that of its folder, so that a name says where it lies.

    scripts/check_namespaces.py [--root DIR]     check the tree; part of `scripts/check.sh layers`

scripts/check_namespaces_test.py checks the checker.

The namespace is `interneuron::` and the last name of the folder's path: src/core/flow has interneuron::flow. NAMES has the
folders where another reads better, each for all folders below it. A file may open namespaces within that one, and declare classes of
another folder ahead of their definition. Public names are in `interneuron` itself: a .cc may define them there if the first
header that it includes is one of include/interneuron, or beside what it has in its own namespace. What a file opens outside of
`interneuron` (std, that of a library) is not looked at.

scripts/ceilings.txt lists the folders that do not follow yet, `namespace FOLDER...`. A folder that does must be struck there.
Each finding is one line `file:line: what; remedy`, and the exit code is 1.
"""

import os
import re
import sys

import ceilings
import checker_main
from check_layers import bare_code, line_of

ROOTS = ("include", "policies", "src", "netns", "bench")
# What everybody uses and the doors have no namespace of their own; a group whose folders are one thing has one for all.
NAMES = {"include": "", "src/core/base": "", "src/core/endpoint": "", "src/node": "io", "src/node/loop": "", "src/app/cli": "cli", "src/lab/cli": "cli",
         # A namespace secure cannot stand beside the public function secure(), which makes a policy.
         "src/core/secure": "crypto",
         # A namespace toml would hide that of toml++ from all of interneuron.
         "src/app/toml": "toml_reader",
         "netns": "netns", "bench": "bench"}
TOP = "interneuron"

SCOPE = re.compile(r"\bnamespace(?:\s+([\w:]+))?\s*\{|[{}]")
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\\\n]|\\.|\\\n)*", re.MULTILINE | re.DOTALL)
AHEAD = re.compile(r"(?:\s*(?:template\s*<[^<>]*>\s*)?(?:class|struct|enum(?:\s+class)?)\s+\w+(?:\s*:\s*[\w:]+)?\s*;)*\s*\Z")
FIRST_HEADER = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"\n]+)"', re.MULTILINE)


def name_of(folder):
    """The namespace of a folder."""
    place = folder
    while place and place not in NAMES:
        place = os.path.dirname(place)
    last = NAMES[place] if place else os.path.basename(folder)
    return f"{TOP}::{last}" if last else TOP


def opened(code):
    """{namespace: line} of those that have something in them but other namespaces and classes declared ahead."""
    text = DIRECTIVE.sub(lambda match: "\n" * match.group().count("\n"), code)
    found, stack, begin = {}, [], 0
    for match in [*SCOPE.finditer(text), None]:
        inside = next((name for name in reversed(stack) if name is not None), "")
        piece = text[begin:match.start() if match else len(text)]
        if inside and inside not in found and not AHEAD.match(piece):
            found[inside] = line_of(text, begin + len(piece) - len(piece.lstrip()))
        if not match:
            break
        begin = match.end()
        if match.group() == "}":
            if stack:
                stack.pop()
        elif match.group() == "{":
            stack.append(None)
        else:
            stack.append("::".join(filter(None, (inside, match[1]))))
    return found


class Checker:
    def __init__(self, root):
        self.root = root
        self.files = 0
        self.problems = []

    def run(self):
        rows = {folder: line for line, _, words in ceilings.read(self.root, ("namespace",)) for folder in words}
        odd = set()
        self.folders = {}
        for top in ROOTS:
            for directory, names, files in os.walk(os.path.join(self.root, top)):
                names.sort()
                paths = [os.path.join(directory, name) for name in sorted(files) if name.endswith((".h", ".cc"))]
                if paths:
                    self.folders[os.path.relpath(directory, self.root)] = paths
        self.taken = {name_of(folder): folder for folder in self.folders}
        for folder, paths in self.folders.items():
            problems = [problem for path in paths for problem in self.check_file(folder, path)]
            if problems:
                odd.add(folder)
            if folder not in rows:
                self.problems += problems
        for folder, line in rows.items():
            if folder not in self.folders:
                self.problems.append(f"{ceilings.where(line)}: there is no folder {folder}; strike it or write its new name")
            elif folder not in odd:
                self.problems.append(f"{ceilings.where(line)}: all of {folder} is in {name_of(folder)} by now; strike it")
        self.late = len(rows)
        return self

    def check_file(self, folder, path):
        self.files += 1
        with open(path, encoding="utf-8", errors="replace") as file:
            code = bare_code(file.read())
        own = name_of(folder)
        names = opened(code)
        for name, line in names.items():
            if name.split("::")[0] == TOP and not self.may_open(own, name, path, names, code):
                yield (f"{os.path.relpath(path, self.root)}:{line}: is in the namespace {name}, that of {folder} is {own}; move it "
                       "there")

    def may_open(self, own, name, path, names, code):
        if own == TOP:  # and within it whatever is no folder's
            return name == TOP or "::".join(name.split("::")[:2]) not in self.taken
        if name == TOP and path.endswith(".cc"):
            first = FIRST_HEADER.search(code)
            return own in names or bool(first and first[1].startswith("interneuron/"))
        return name == own or name.startswith(own + "::")


def checked(root):
    checker = Checker(root).run()
    return checker.problems, f"{checker.files} files of {len(checker.folders)} folders, {checker.late} of which do not follow yet"


if __name__ == "__main__":
    sys.exit(checker_main.main("namespaces", __doc__, checked))
