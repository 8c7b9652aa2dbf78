#!/usr/bin/env python3
"""Checks the form of the documents: lines that fit a window, a README that is a door, an index that is whole.

    scripts/check_docs.py [--root DIR]     check the tree

scripts/check_docs_test.py checks the checker. What is checked, in every Markdown document of the tree:

  lines      at most 160 characters, those of tables and examples too
  README.md  at most 200 lines
  an index   in a document with a heading "Index": it names each heading of the second level that follows, in their order

Each violation is one line `file:line: what`; the exit code is 1.
"""

import os
import re
import sys

from check_citations import FENCE, SKIPPED_FOLDERS, anchor, blank_lines

import checker_main

LONGEST_LINE = 160
LONGEST_README = 200
# Tables that another checker reads as one row a folder, with all that the folder may include.
EXCEPTIONS = re.compile(r"(ARCHITECTURE|src/\w+/README|netns/README)\.md")
INDEX = "Index"
SECOND_LEVEL = re.compile(r"^## +(.+?) *$", re.M)
LINK = re.compile(r"\]\(#([^)]*)\)")


def check_document(path, text):
    """The problems of one document: (line, what)."""
    problems = []
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        if len(line) > LONGEST_LINE and not (line.startswith("|") and EXCEPTIONS.fullmatch(path)):
            problems.append((number, f"{len(line)} characters; a line has at most {LONGEST_LINE}"))
    if path == "README.md" and len(lines) > LONGEST_README:
        problems.append((LONGEST_README + 1, f"{len(lines)} lines; {path} has at most {LONGEST_README}: docs/ has room"))
    plain = FENCE.sub(blank_lines, text)
    headings = list(SECOND_LEVEL.finditer(plain))
    for position, heading in enumerate(headings):
        if heading.group(1) != INDEX:
            continue
        after = headings[position + 1:]
        end = after[0].start() if after else len(plain)
        named = LINK.findall(plain, heading.end(), end)
        wanted = [anchor(other.group(1)) for other in after]
        if named != wanted:
            line = plain.count("\n", 0, heading.start()) + 1
            wrong = [name for name in wanted + named if (name in wanted) != (name in named)]
            problems.append((line, f"the index differs from the headings: {', '.join(wrong) or 'in their order'}"))
    return problems


def check(root):
    """The problems of a tree as lines, and how many documents it has."""
    problems, documents = [], 0
    for directory, folders, files in os.walk(root):
        folders[:] = sorted(folder for folder in folders if folder not in SKIPPED_FOLDERS)
        for name in sorted(files):
            if not name.endswith(".md"):
                continue
            path = os.path.relpath(os.path.join(directory, name), root)
            with open(os.path.join(root, path), encoding="utf-8") as file:
                found = check_document(path, file.read())
            documents += 1
            problems += [f"{path}:{line}: {what}" for line, what in found]
    return problems, documents


def checked(root):
    problems, documents = check(root)
    return problems, f"{documents} documents, all in form"


if __name__ == "__main__":
    sys.exit(checker_main.main("docs", __doc__, checked))
