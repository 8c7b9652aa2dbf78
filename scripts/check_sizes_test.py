#!/usr/bin/env python3
"""Checks scripts/check_sizes.py with planted files; the exit code is 1 when it misses one."""

import subprocess
import sys

import check_sizes
import planted
from check_sizes import Checker


def lines(count, text="  run();"):
    return "\n".join([text] * count)


def function(name, body):
    """A function of so many lines."""
    return f"void {name}() {{\n{lines(body - 2)}\n}}"


def methods(name, count, body=1):
    return "\n".join(f"void {name}::f{i}() {{\n{lines(body - 2)}\n}}" if body > 1 else f"void {name}::f{i}() {{}}" for i in range(count))


def nest(*openings):
    """These, each in the one before, and their closing braces."""
    depth = sum(text.count("{") - text.count("}") for text in openings)
    return "\n".join(openings) + "\n" + "}" * depth


# A class whose functions lie in a header and two files.
SPREAD = {
    "src/a/spread.h": "namespace a {\nclass Spread {\n public:\n  Spread() : x_{1} {}\n  int x_;\n};\n}",
    "src/a/spread.cc": f"namespace a {{\n{methods('Spread', 22)}\n}}",
    "src/a/spread_more.cc": f"namespace a {{\n{methods('Spread', 23)}\n}}",
}
# So many headers with one includer each would be over the share, were they not included twice.
SHARED = {f"src/s/h{i}.h": "int h;" for i in range(4)} | {
    "src/s/one.cc": '#include "s/h0.h"\n#include "h1.h"\n#include "s/h2.h"\n#include "s/h3.h"',
    "src/s/two.cc": '#include "s/h1.h"\n#include "s/h2.h"\n#include "s/h3.h"', "src/s/h0.cc": '#include "s/h0.h"'}

# (file, text, problem): None where no problem may be found.
CASES = [
    ("src/a/long.cc", lines(401, "int a;"), "has 401 lines, the limit is 400 lines"),
    ("src/a/full.cc", lines(400, "int a;"), None),
    ("tests/a/long_test.cc", lines(401, "int a;"), "has 401 lines"),
    ("src/a/long.h", lines(201, "int a;"), "the header src/a/long.h has 201 lines"),
    ("src/a/full.h", lines(200, "int a;"), None),
    ("src/a/b.cc", function("stretch", 61), "the function stretch has 61 lines"),
    ("src/a/c.cc", function("fits", 60), None),
    ("src/a/d.cc", f"namespace a {{\nnamespace {{\n{function('hidden', 61)}\n}}\n}}", "the function a::(anonymous)::hidden has 61"),
    ("src/a/e.cc", f"class E {{\n{function('inside', 61)}\n}};", "the function E::inside has 61"),
    ("src/a/f.cc", f"T C<T>::k(int a,\n          int b) const\n  requires true {{\n{lines(58)}\n}}", "has 62 lines"),
    ("src/a/g.cc", f'const char* kText = R"({{{{{{ void f() {{\n{lines(70)})";\n{function("after_text", 59)}', None),
    ("src/a/h.cc", f"G::G(int a)\n    : a_{{a}},\n      b_(a) {{\n{lines(58)}\n}}", "has 62 lines"),
    ("tests/a/t_test.cc", f"TEST(Suite, Case) {{\n{lines(59)}\n}}", "the function TEST(Suite.Case) has 61"),
    ("tests/a/p_test.cc", f"RC_GTEST_PROP(Suite, Property, (int a, int b)) {{\n{lines(59)}\n}}", "RC_GTEST_PROP(Suite.Property) has 61"),
    ("src/a/n1.cc", f"void n1() {{\n{nest('if (a) {', 'for (;;) {', 'while (b()) {', 'switch (c) {')}\n}}", "the nesting of n1 has 4 levels"),
    ("src/a/n2.cc", f"void n2() {{\n{nest('if (a) {', '} else {', 'do {', 'try {')}\n}}", None),
    ("src/a/n3.cc", "void n3() {\n" + nest("if constexpr (a) {", "each([&](int i) {" + nest("do {", "try {", "if (f(x)) {") + "});") + "\n}", "n3 has 4"),
    ("src/a/n4.cc", f"struct N {{\nvoid n4() {{\n{nest('if (a) {', 'for (;;) {', 'while (b()) {', 'int x[] {', 'T t(1) {')}\n}}\n}};", None),
    ("src/a/spread.h", SPREAD["src/a/spread.h"], "the class a::Spread has 46 functions and 46 lines"),
    ("src/a/many.cc", f"struct Many {{}};\n{methods('Many', 45)}", None),
    ("src/a/heavy.cc", f"struct Heavy {{}};\n{methods('Heavy', 20, 31)}", "the class Heavy has 20 functions and 620 lines"),
    ("src/a/room.cc", f"namespace room {{}}\n{methods('room', 46)}", None),
    ("src/a/x1.cc", f"namespace {{\nstruct Twin {{}};\n{methods('Twin', 30)}\n}}", None),
    ("src/a/x2.cc", f"namespace {{\nstruct Twin {{}};\n{methods('Twin', 30)}\n}}", None),
    ("bench/y.cc", function("excepted", 70), None),
    ("bench/z.cc", function("ceiled", 70), None),
    ("bench/u.cc", function("grown", 71), "the function grown has 71 lines, its row in scripts/ceilings.txt:3 allows 70 lines"),
    ("bench/v.cc", function("shrunk", 65), None),
    ("bench/w.cc", lines(410, "int a;"), None),
]
EXCEPTIONS = ("# kind name: reason\nfunction excepted: a table\nfunction fits: it fits\nfile src/a/long.cc: it is long\n"
              "function nothing: there is none\nfunction stretch:")
CEILINGS = "circle src/a a.cc b.cc\nfunction ceiled 70\nfunction grown 70\nfunction shrunk 70\nfile bench/w.cc 410\nclass Many 46 600"

# (row of a file, problem)
ROWS = [
    ("scripts/size_exceptions.txt:2", None),
    ("scripts/size_exceptions.txt:3", "fits is no function above the limit; strike"),
    ("scripts/size_exceptions.txt:4", "for lengths of files there is none"),
    ("scripts/size_exceptions.txt:5", "nothing is no function above the limit; strike"),
    ("scripts/size_exceptions.txt:6", "write `function NAME: reason`"),
    ("scripts/ceilings.txt:1", None),
    ("scripts/ceilings.txt:2", None),
    ("scripts/ceilings.txt:4", None),
    ("scripts/ceilings.txt:5", None),
    ("scripts/ceilings.txt:6", "Many is no class above the limit; strike"),
]


def check(root):
    subprocess.run(["git", "init", "-q", root], check=True)
    return Checker(root).run().problems


def problems_of(tree):
    return planted.run(check, tree, [])[1]


def self_test():
    tree = SPREAD | {"scripts/size_exceptions.txt": EXCEPTIONS, "scripts/ceilings.txt": CEILINGS}
    failures, problems = planted.run(check, tree, CASES)
    for row, what in ROWS:
        found = [problem for problem in problems if problem.startswith(row + ":")]
        if bool(found) != bool(what) or (what and what not in found[0]):
            failures.append(f"{row}: expected {what!r}, found {found}")
    if not any(problem.startswith("src/a/d.cc:3:") for problem in problems):
        failures.append(f"wrong line number: {[p for p in problems if p.startswith('src/a/d.cc:')]}")

    names = [f"f{i}" for i in range(check_sizes.MOST_EXCEPTIONS + 1)]
    many = {f"src/{name}.cc": function(name, 61) for name in names}
    for allowed in (names[1:], names):
        rows = "\n".join(f"function {name}: a table" for name in allowed)
        found = any("6 exceptions, the limit is 5" in p for p in problems_of(many | {"scripts/size_exceptions.txt": rows}))
        if found != (allowed == names):
            failures.append(f"{len(allowed)} exceptions: {'fail' if found else 'pass'}")

    # It is h0 alone, which one file includes beside its own: 1 of 6.
    for limit, expected in ((16, True), (17, False)):
        check_sizes.SHARED_LITTLE = limit
        found = [problem for problem in problems_of(SHARED) if "a single file that includes" in problem]
        if bool(found) != expected or any("of: src/s/h0" not in problem for problem in found):
            failures.append(f"headers of a single file, limit {limit}: {found}")
    return planted.tell("sizes", len(CASES) + len(ROWS) + 5, failures)


if __name__ == "__main__":
    sys.exit(self_test())
