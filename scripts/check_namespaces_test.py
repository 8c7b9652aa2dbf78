#!/usr/bin/env python3
"""Checks scripts/check_namespaces.py with planted files; the exit code is 1 when it misses one."""

import sys

import planted
from check_namespaces import Checker, name_of

# (file, text, problem): None where no problem may be found.
CASES = [
    ("src/core/flow/a.h", "namespace interneuron::flow {\nint a;\n}", None),
    ("src/core/flow/b.h", "namespace interneuron {\nnamespace flow {\nint a;\n}\n}", None),
    ("src/core/flow/c.h", "namespace interneuron::flow {\nnamespace {\nint a;\n}\nnamespace detail {\nint b;\n}\n}", None),
    ("src/core/flow/d.h", "namespace interneuron {\nint a;\n}", "is in the namespace interneuron, that of src/core/flow is interneuron::flow"),
    ("src/core/flow/e.h", "namespace interneuron::wire {\nclass A;\nstruct B;\n}\nnamespace interneuron::flow {\nint a;\n}", None),
    ("src/core/flow/f.h", "namespace interneuron::wire {\nclass A {};\n}", "is in the namespace interneuron::wire"),
    ("src/core/flow/g.cc", '#include "interneuron/link.h"\nnamespace interneuron {\nint a;\n}', None),
    ("src/core/flow/h.cc", '#include "core/flow/h.h"\n#include "interneuron/link.h"\nnamespace interneuron {\nint a;\n}', "namespace interneuron,"),
    ("src/core/flow/i.cc", '#include "core/flow/h.h"\nnamespace interneuron {\nint a;\nnamespace flow {\nint b;\n}\n}', None),
    ("src/core/flow/j.h", '#include "interneuron/link.h"\nnamespace interneuron {\nint a;\n}', "namespace interneuron,"),
    ("src/core/flow/k.cc", "// namespace interneuron {\nconst char* s = \"namespace x {\";\nnamespace interneuron::flow {\nvoid f() { { } }\n}", None),
    ("src/core/flow/l.cc", "namespace std {\nint a;\n}\nnamespace fs = std::filesystem;\nusing namespace x;\nint main() {}", None),
    ("src/core/flow/m.cc", "namespace interneuron::flower {\nint a;\n}", "namespace interneuron::flower"),
    ("src/core/base/a.h", "namespace interneuron {\nint a;\nnamespace water_filling {\nint b;\n}\n}", None),
    ("src/core/base/b.h", "namespace interneuron::flow {\nint a;\n}", "that of src/core/base is interneuron;"),
    ("include/interneuron/link.h", "namespace interneuron {\nint a;\n}", None),
    ("policies/a.cc", "namespace interneuron::policies {\nint a;\n}", None),
    ("netns/state/a.h", "namespace interneuron::netns {\nint a;\n}", None),
    ("netns/wiring/a.h", "namespace interneuron::netns::netlink {\nint a;\n}", None),
    ("netns/wiring/b.h", "namespace interneuron::wiring {\nint a;\n}", "that of netns/wiring is interneuron::netns"),
    ("src/late/a.h", "namespace interneuron::cli {\nint a;\n}", None),
    ("src/done/a.h", "namespace interneuron::done {\nint a;\n}", None),
]
CEILINGS = "namespace src/late\nnamespace src/done src/gone"
ROWS = ("scripts/ceilings.txt:2: all of src/done is in interneuron::done", "scripts/ceilings.txt:2: there is no folder src/gone")


def self_test():
    failures, problems = planted.run(lambda root: Checker(root).run().problems, {"scripts/ceilings.txt": CEILINGS}, CASES)
    rows = [problem for problem in problems if problem.startswith("scripts/")]
    if len(rows) != len(ROWS) or not all(any(row.startswith(expected) for row in rows) for expected in ROWS):
        failures.append(f"rows: expected {ROWS}, found {rows}")
    if not any(problem.startswith("src/core/flow/d.h:2:") for problem in problems):
        failures.append(f"wrong line number: {[p for p in problems if p.startswith('src/core/flow/d.h:')]}")
    for folder, name in (("src/app/doctor", "interneuron::doctor"), ("src/app/cli/eval", "interneuron::cli"), ("bench/nature", "interneuron::bench")):
        if name_of(folder) != name:
            failures.append(f"the namespace of {folder} is {name_of(folder)}, expected {name}")
    return planted.tell("namespaces", len(CASES) + 5, failures)


if __name__ == "__main__":
    sys.exit(self_test())
