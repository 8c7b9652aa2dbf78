#!/usr/bin/env python3
"""Checks scripts/check_layers.py with made-up tables and violations; the exit code is 1 when it misses one."""

import sys

import planted
from check_layers import Checker, read_table

TABLE = """
Floors: include, policies, core, node + lab, app

| folder | what | may include | pure |
|---|---|---|---|
| `include/interneuron/` | vocabulary | std only | yes |
| `policies/` | policies | include | yes |
| `src/core/wire/` | bytes | include | yes |
| `src/core/flow/` | messages | include, core/wire | yes |
| `src/lab/emu/` | links | include, `<toml++/*>` | yes |
| `src/node/io/` | system | include, OS | no |
| `src/app/cli/` | program | include, core, node/io, `<CLI/*>` | no |
"""

# (file, line, rule or None): one file per line of code, None where nothing may be found.
CASES = [
    ("include/interneuron/a.h", "#include <vector>", None),
    ("include/interneuron/b.h", '#include "interneuron/a.h"', None),
    ("include/interneuron/c.h", '#include "core/wire/header.h"', "may not include src/core/wire"),
    ("include/interneuron/d.h", "#include <sys/socket.h>", "does not list it"),
    ("include/interneuron/e.h", "#include <thread>", "pure"),
    ("include/interneuron/f.h", "#include <functional>  // std::thread, system_clock::now() in a comment", None),
    ("src/core/wire/header.h", '#include "core/wire/other.h"', None),
    ("src/core/wire/other.h", "#include <interneuron/a.h>", None),
    ("src/core/wire/c.cc", '#include "lab/emu/profile.h"', "may not include src/lab/emu"),
    ("src/core/wire/d.cc", '#include "node/io/socket.h"', "may not include src/node/io"),
    ("src/core/wire/e.cc", "#include <boost/asio.hpp>", "does not list it"),
    ("src/core/wire/f.cc", "#include <toml++/toml.h>", "does not list it"),
    ("src/core/wire/g.cc", '/* a\n b */ #include "nowhere/x.h"', "lies in no folder"),
    ("src/core/wire/h.cc", "auto t = LocalClock::now();", "reads a clock"),
    ("src/core/wire/i.cc", "auto t = pacer.now() + guard->now(); auto s = now(3);", None),
    ("src/core/wire/j.cc", "timespec t; clock_gettime(CLOCK_MONOTONIC, &t);", "reads a clock"),
    ("src/core/wire/k.cc", "auto t = time(nullptr);", "reads a clock"),
    ("src/core/wire/l.cc", "auto t = rate.transmit_time(0) + link.time(0) + std::max(time, 0);", None),
    ("src/core/wire/m.cc", "::usleep(3);", "waits"),
    ("src/core/wire/n.cc", 'const char* s = "std::cout << system_clock::now()";', None),
    ("src/core/wire/o.cc", "std::lock_guard lock(m);", "locks"),
    ("src/core/wire/p.cc", 'std::printf("x");', "prints"),
    ("src/core/wire/q.cc", 'std::snprintf(out, 3, "x");', None),
    ("src/core/wire/aa.cc", "int s = ::socket(AF_INET, SOCK_DGRAM, 0);", "calls the system"),
    ("src/core/wire/ab.cc", 'std::system("ls");', "calls the system"),
    ("src/core/wire/ac.cc", 'std::ifstream in("x");', "calls the system"),
    ("src/core/wire/ad.cc", "reader.read(3); std::error_code system(int); writer->write(4); Sender::send(5);", None),
    ("src/core/wire/ae.cc", '#define HEADER "app/cli/main.h"\n#include HEADER', "cannot be checked"),
    ("src/core/wire/af.cc", '#include_next "app/cli/main.h"', "cannot be checked"),
    ("src/core/wire/ag.cc", '#include/* why */"app/cli/main.h"', "cannot be checked"),
    ("src/core/wire/ah.cc.in", '#include "app/cli/main.h"', "may not include src/app/cli"),
    ("src/core/wire/ai.cc", '#include "/etc/header.h"', "lies in no folder"),
    ("src/core/wire/r.cc", "std::random_device seed;", "hidden input"),
    ("src/core/wire/s.cc", "auto big = 1'000'000; auto t = std::chrono::steady_clock::now(); auto c = 'x';", "clock"),
    ("src/core/wire/t.cc", "#include <unistd.h>", "does not list it"),
    ("src/core/wire/u.cc", "#include <iostream>", "pure"),
    ("src/core/wire/v.cc", "#include <spdlog/spdlog.h>", "does not list it"),
    ("src/core/wire/w.cc", 'auto s = R"(std::time(nullptr); ")"; auto t = gettimeofday(&a, 0);', "reads a clock"),
    ("src/core/wire/y.cc", '// "quoted\n#include "node/io/socket.h"  // why\n', "may not include src/node/io"),
    ("src/core/wire/z.cc", 'const char* s = "\\"#include <thread>"; // \\\n#include <thread>', None),
    ("src/core/wire/x.cc", "// sleep(1)\nint a = 1; // time(0)\n/* ::now() */", None),
    ("src/lab/emu/profile.cc", "#include <toml++/toml.h>", None),
    ("policies/best.cc", '#include "core/wire/header.h"', "may not include src/core/wire"),
    ("src/node/io/socket.cc", "#include <sys/socket.h>\n#include <mutex>\nauto t = std::time(nullptr);", None),
    ("src/node/io/b.cc", '#include "app/cli/main.h"', "may not include src/app/cli"),
    ("src/app/cli/main.cc", '#include "node/io/socket.h"\n#include "core/flow/a.h"', None),
    ("src/app/cli/other.cc", "#include <opencv2/core.hpp>", "does not list it"),
    ("src/app/cli/emu.cc", '#include "lab/emu/link.h"', "may not include src/lab/emu"),
    ("src/core/flow/a.h", '#include "core/wire/other.h"', None),
    ("src/stray/a.cc", "int a;", "no row"),
]


def self_test():
    failures, problems = planted.run(lambda root: Checker(root).run().problems, {"ARCHITECTURE.md": TABLE}, CASES)
    if not any(problem.startswith("src/core/wire/g.cc:2:") for problem in problems):
        failures.append(f"wrong line number: {[p for p in problems if p.startswith('src/core/wire/g.cc:')]}")
    for text, rule in (
            (TABLE.replace("| include, OS |", "| include, nonsense |"), "no folder and no group of the table"),
            (TABLE.replace("| include, OS |", "| everything |"), "no folder and no group of the table"),
            (TABLE.replace("| include, OS |", "| app/cli |"), "of a later floor"),
            (TABLE.replace("| include, core/wire |", "| include, core |"), "its own group"),
            (TABLE.replace("| bytes | include |", "| bytes | core/flow |"), "not one-way"),
            (TABLE.replace("| bytes | include |", "| bytes | include, OS |"), "is pure and may include OS"),
            (TABLE.replace("| links | include,", "| links | include, node/io,"), "is pure and may include node/io, which is not"),
            (TABLE.replace("Floors: ", "Layers: "), "no line `Floors"),
            (TABLE.replace("node + lab", "lab"), "of no floor"),
            ("no table here", "no table")):
        problems = read_table(("ARCHITECTURE.md", text))[1]
        if not any(rule in problem for problem in problems):
            failures.append(f"table: expected {rule!r}, found {problems}")
    return planted.tell("layers", len(CASES) + 11, failures)


if __name__ == "__main__":
    sys.exit(self_test())
