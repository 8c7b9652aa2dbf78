#!/usr/bin/env python3
"""Checks scripts/check_alone.py with planted files, which it compiles; the exit code is 1 when it misses one."""

import json
import os
import subprocess
import sys

import planted
from check_alone import DAYS, Checker, by_folder, circles_of, of_day

# a and b call each other, c calls a, d and e share what is inline.
CIRCLE = {
    "src/ring/all.h": "#pragma once\nnamespace ring {\nint a(); int b(); int c();\ninline int shared() { return 1; }\n"
                      "struct S { static int value; virtual ~S(); };\n}",
    "src/ring/a.cc": '#include "ring/all.h"\nint ring::a() { return b(); }',
    "src/ring/b.cc": '#include "ring/all.h"\nint ring::b() { return S::value + a(); }\nint ring::S::value = 1;',
    "src/ring/c.cc": '#include "ring/all.h"\nint ring::c() { return a() + shared(); }\nring::S::~S() {}',
    "src/ring/d.cc": '#include "ring/all.h"\nint d() { return ring::shared() + ring::c(); }',
}
TREE = CIRCLE | {
    "src/line/a.cc": "int b();\nint a() { return b(); }",
    "src/line/b.cc": "static int a() { return 1; }\nint b() { return a(); }",
    "src/bad/sizes.h": "#include <cstdint>\ninline std::int64_t bytes() { return kHeaderBytes; }",
    "src/bad/a.cc": "\nstd::string name();",
    "src/bad/b.cc": '#include "bad/sizes.h"',
    "src/bad/c.cc": '#include "bad/nowhere.h"',
    "src/two/a.cc": "int b();\nint a() { return b(); }",
    "src/two/b.cc": "int a();\nint b() { return a(); }",
    "src/two/c.cc": "int a() { return 1; }\n",
    "tests/ring/a.cc": "int b();\nint a() { return b(); }",
    "tests/ring/b.cc": "int a();\nint b() { return a(); }",
}
FAULTY = ("src/bad/a.cc:2: does not compile alone: ", "src/bad/sizes.h:2: does not compile alone as a part of src/bad/b.cc: ",
          "src/bad/c.cc:1: does not compile alone: bad/nowhere.h: No such file")
RING = "src/ring/a.cc:1: a.cc b.cc call each other in a circle; "

# (scripts/ceilings.txt, the problems that these rows bring or leave: beginnings of lines)
CEILINGS = [
    ("", (RING, "src/two/a.cc:1: a.cc b.cc call")),
    ("# why\ncircle src/ring a.cc b.cc\ncircle src/two b.cc a.cc\nfunction a 70", ()),
    ("circle src/ring a.cc b.cc d.cc\ncircle src/two a.cc b.cc",
     ("scripts/ceilings.txt:1: the circle has become smaller; make the row `circle src/ring a.cc b.cc`",)),
    ("circle src/ring a.cc c.cc\ncircle src/two a.cc b.cc", (RING, "scripts/ceilings.txt:1: src/ring has no circle of a.cc c.cc any")),
    ("circle src/ring a.cc b.cc\ncircle src/two a.cc b.cc\ncircle src/line a.cc b.cc",
     ("scripts/ceilings.txt:3: src/line has no circle of a.cc b.cc any more; strike",)),
    ("circle src/ring a.cc b.cc\ncircle src/two a.cc b.cc\ncircle src/gone a.cc b.cc", ("scripts/ceilings.txt:3: there is no folder",)),
    ("circle src/ring a.cc b.cc\ncircle src/two a.cc b.cc\ncircle src/line a.cc z.cc",
     ("scripts/ceilings.txt:3: there is no src/line/z.cc", "scripts/ceilings.txt:3: src/line has no circle of a.cc z.cc any")),
    ("circle src/ring a.cc b.cc\ncircle src/two a.cc b.cc\nno-circle src/line src/ring", ("scripts/ceilings.txt:1: src/ring may have no",)),
]


class Planted(Checker):
    """Compiles what does not change between the cases once."""
    compiled = {}

    def compile(self, path):
        if path not in self.compiled:
            self.compiled[path] = super().compile(path)
        return self.compiled[path]


def check(root):
    build = os.path.join(root, "build/alone")
    os.makedirs(build)
    subprocess.run(["git", "init", "-q", root], check=True)
    made = [os.path.join(build, "made.cc"), *(os.path.join(root, path) for path in TREE if path.endswith(".cc"))]
    commands = [{"directory": build, "file": path, "command": f"c++ -I{root}/src -DTEXT=\\\"a\\\" -O3 -o nowhere/x.o -c {path}"}
                for path in made if path != os.path.join(root, "src/two/c.cc")]
    with open(os.path.join(build, "compile_commands.json"), "w", encoding="utf-8") as file:
        json.dump(commands, file)
    failures = []
    for text, expected in CEILINGS:
        with open(os.path.join(root, "scripts/ceilings.txt"), "w", encoding="utf-8") as file:
            file.write(text)
        checker = Planted(root, build, 2)
        problems = checker.run(list(checker.folders)).problems
        wanted = [*FAULTY, *expected]
        if len(problems) != len(wanted) or any(not any(p.startswith(w) for p in problems) for w in wanted):
            failures.append(f"{text!r}: expected {wanted}, found {problems}")
        if "" == text and not any(p.endswith("a.cc -> b.cc (ring::b), b.cc -> a.cc (ring::a)") for p in problems):
            failures.append(f"does not tell the symbols: {problems}")
    return failures


def self_test():
    failures = planted.run(check, TREE | {"scripts/ceilings.txt": ""}, [])[1]
    folders = by_folder([f"src/f{i}/{j}.cc" for i in range(40) for j in range(1 + i % 7)])
    dealt = [of_day(folders, day) for day in range(1, DAYS + 1)]
    if sorted(folder for day in dealt for folder in day) != sorted(folders):
        failures.append("not each folder has one day")
    sizes = [sum(len(folders[folder]) for folder in day) for day in dealt]
    if max(sizes) - min(sizes) > 3:
        failures.append(f"the days have {sizes} files")
    two = {"a": {"b": "x"}, "b": {"a": "x", "c": "x"}, "c": {"d": "x"}, "d": {"e": "x"}, "e": {"c": "x"}, "f": {"a": "x"}}
    if [sorted(circle) for circle in circles_of(two)] != [["c", "d", "e"], ["a", "b"]]:
        failures.append(f"circles of {two}: {circles_of(two)}")
    return planted.tell("alone", len(CEILINGS) + 4, failures)


if __name__ == "__main__":
    sys.exit(self_test())
