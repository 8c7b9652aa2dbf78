#!/usr/bin/env python3
"""Checks scripts/check_docs.py with planted documents; the exit code is 1 when it misses one."""

import sys

import planted
from check_docs import LONGEST_LINE, LONGEST_README, check

FULL = "x" * LONGEST_LINE
INDEXED = "# Title\n\n## Index\n\n- [One](#one)\n- [`Two` and more](#two-and-more)\n\n"

# (file, text, problem): each text is a file of its own; None where no problem may be found.
CASES = [
    ("docs/a.md", FULL, None),
    ("docs/b.md", "short\n" + FULL + "y", "161 characters"),
    ("docs/c.md", "é" * LONGEST_LINE, None),
    ("docs/d.md", "| " + FULL + " |", "164 characters"),
    ("docs/e.md", "```\n" + FULL + "y\n```", "161 characters"),
    ("ARCHITECTURE.md", "|" + FULL, None),
    ("src/core/README.md", "|" + FULL, None),
    ("netns/README.md", FULL + "y", "161 characters"),
    ("docs/ARCHITECTURE.md", FULL + "y", "161 characters"),
    ("build/f.md", FULL + "y", None),
    ("README.md", "line\n" * LONGEST_README, "201 lines"),
    ("policies/README.md", "line\n" * LONGEST_README, None),
    ("docs/g.md", INDEXED + "## One\n\n## `Two` and more\n", None),
    ("docs/h.md", INDEXED + "## One\n\n## Two\n", "the index differs from the headings: two, two-and-more"),
    ("docs/i.md", INDEXED + "## `Two` and more\n\n## One\n", "in their order"),
    ("docs/j.md", INDEXED + "## One\n\n```\n## Three\n```\n\n## `Two` and more\n", None),
    ("docs/k.txt", FULL + "y", None),
]


def self_test():
    failures, problems = planted.run(lambda root: check(root)[0], {}, CASES)
    if not any(problem.startswith("docs/b.md:2:") for problem in problems):
        failures.append(f"wrong line number: {[p for p in problems if p.startswith('docs/b.md:')]}")
    return planted.tell("docs", len(CASES) + 1, failures)


if __name__ == "__main__":
    sys.exit(self_test())
