#!/usr/bin/env python3
"""Checks scripts/check_citations.py with planted citations; the exit code is 1 when it misses one."""

import sys

import planted
from check_citations import Checker

DOCUMENT = """# Title

## Reference times
Text. See [below](#the-set-up-now).

## The set-up: `now`

### 2.1 Numbered
"""

# (file, text, problem): each text is a file of its own; None where no problem may be found.
CASES = [
    ("a.h", '// Late by docs/paper.md, "Reference times".', None),
    ("b.h", '// Late by docs/paper.md, "Reference\n// times" and "The set-up: now".', None),
    ("c.h", '// Late by docs/paper.md, "Reference\n// clocks".', 'no heading "Reference clocks"'),
    ("d.h", '// Late by docs/paper.md, "Reference times" and\n// "Nothing".', 'no heading "Nothing"'),
    ("e.h", "// As transport.md says.", "transport.md is not in the repository"),
    ("f.h", "// As measured (testbed.md\n// §2.2).", "testbed.md is not in the repository"),
    ("g.h", "// As in NOTES\n// §4.2.", "`NOTES` is not"),
    ("h.h", "// As in the notes (§4.2).", "`§4.2`: of which document?"),
    ("i.h", "// Gains of RFC 6298\n// §2, and RFC 9000 section 14.", None),
    ("j.h", "// Bounded by section 3.\nint a;", "of which document?"),
    ("k.h", "// docs/paper.md §2.1", None),
    ("l.h", "// docs/paper.md\n// §7", "docs/paper.md has no section 7"),
    ("m.h", "// Criterion (issue 5): fast.", "`issue 5`"),
    ("n.h", "// Criterion of issue\n// 12: fast.", "`issue 12`"),
    ("o.h", "// Reported in quic-go/quic-go issue 5768\n// and OpenIRL/srtla pull request 5.", None),
    ("p.h", "// As the issue asks.", "`the issue asks`"),
    ("q.h", "// See src/link/nature.h.", "src/link/nature.h is not"),
    ("r.h", "/* See\n * link/nature.h. */", "link/nature.h is not"),
    ("s.h", "// See core/link/nature.h, nature.h, src/core/link/ and <sys/socket.h>, linux/if_link.h.", None),
    ("t.h", "// As observer.cc.", "observer.cc is not"),
    ("u.h", 'const char* s = "see docs/nothing.md";', "docs/nothing.md is not"),
    ("v.h", 'const char* s = "made/up.h"; // tests/GROUP/name_test.cc, https://a.org/b.md', None),
    ("w.h", "// By docs/paper.md#reference-times.", None),
    ("x.h", "// By docs/paper.md#nothing.", "no anchor #nothing"),
    ("a.md", "[text](docs/paper.md#reference-times) and [that](docs/paper.md#the-set-up-now).", None),
    ("b.md", "[text](docs/paper.md#old)", "no such heading"),
    ("c.md", "[text](paper.md)", "paper.md"),
    ("d.md", "[a link\nover lines](nowhere.png)", "link to nowhere.png"),
    ("e.md", "Lies in `src/eval/run.h`.", "src/eval/run.h is not"),
    ("f.md", "`Type::kLimit` is `kLimt`.", "kLimt is not in the code"),
    ("docs/f.md", "[text](paper.md), [src](../src/core/link/nature.h), [web](https://a.org/x.md#y)", None),
    ("a.toml", "# Fitted in realtime.md section 9", "realtime.md is not"),
    ("b.toml", "# As issue\n# 7 wants", "`issue 7`"),
    ("a.py", "# see scripts/gone.sh", "scripts/gone.sh is not"),
    ("c.py", "x = 1  # see scripts/gone.sh", "scripts/gone.sh is not"),
    ("d.py", 'x = "scripts/gone.sh"', None),
    (".ci/run", "# see scripts/gone.sh", "scripts/gone.sh is not"),
    ("y.h", "// As measured, and/or issue 5.", "`issue 5`"),
    ("z.h", "// In src/core issue 5.", "`issue 5`"),
    ("aa.h", "// By issue no. 5.", "`issue no. 5`"),
    ("ab.h", "// By GH-12.", "`GH-12`"),
    ("ac.h", "// See ../shared/reference/style for why.", "../shared/reference/style"),
    ("g.md", "Data are in `../shared/data`.", None),
    ("b.py", 'x = open("paper.md")  # a part of a path', None),
]


def check(root):
    return [f"{path}:{line}: {what}" for path, line, what in Checker(root).run().problems]


def self_test():
    tree = {"docs/paper.md": DOCUMENT, "src/core/link/nature.h": "int kLimit;"}
    failures, problems = planted.run(check, tree, CASES)
    if not any(problem.startswith("r.h:2:") for problem in problems):
        failures.append(f"wrong line number: {[p for p in problems if p.startswith('r.h:')]}")
    failures += [problem for problem in problems if problem.startswith("docs/paper.md:")]
    return planted.tell("citations", len(CASES) + 2, failures)


if __name__ == "__main__":
    sys.exit(self_test())
