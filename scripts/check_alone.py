#!/usr/bin/env python3
"""Compiles each .cc file alone, and checks that the .cc files of a folder do not call each other in a circle.

    scripts/check_alone.py [--root DIR] [--build DIR] [--jobs N] [--all | --day N | FOLDER...]

scripts/check_alone_test.py checks the checker.

Builds that compile a folder as one unit hide a missing include, since the file before it in the unit had it. So each file is
compiled by itself, without optimisation and without a precompiled header, with the flags that a build tree (build/alone,
configured but not built) has for it. From the objects of a folder outside tests/ the circles are read: a file leads to another
of its folder if it leaves a symbol undefined that the other defines. What is inline or a template is defined in every object
that uses it and leads nowhere.

The folders are dealt out over DAYS days, so that each day has about the same number of files. Without arguments the folders of
today are checked (--day N: those of the Nth day of the year), with --all all of them. A file that the build tree has no flags
for, since a library or another compiler is wanted, is left out and named.

scripts/ceilings.txt lists the circles that are known: `circle FOLDER FILE...`. None may come or grow, and one that has gone or
shrunk must be struck or shortened there. `no-circle FOLDER...` names folders that may never have a row again. Each finding is
one line `file:line: what; remedy`, and the exit code is 1; 2 for a mistake in the arguments.
"""

import argparse
import collections
import concurrent.futures
import datetime
import json
import os
import re
import shlex
import shutil
import subprocess
import sys

import ceilings

# Days until every folder had its turn.
DAYS = 28
# The flags of a build tree do not say that it compiles through a cache.
CACHE = [path for path in [shutil.which("ccache")] if path]
ERROR = re.compile(r"^([^\s:]+):(\d+):(?:\d+:)? (?:fatal )?error: (.*)$", re.M)


def read_commands(root, build):
    """{path below root: (folder to run in, command without output)} of the sources in the tree, not of what a build makes."""
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as file:
        entries = json.load(file)
    commands = {}
    for entry in entries:
        path = os.path.relpath(os.path.join(entry["directory"], entry["file"]), root)
        if path.startswith(("..", os.path.relpath(build, root) + os.sep)):
            continue
        words = shlex.split(entry["command"])
        output = words.index("-o")
        commands.setdefault(path, (entry["directory"], words[:output] + words[output + 2:]))
    return commands


def by_folder(paths):
    folders = collections.defaultdict(list)
    for path in sorted(paths):
        folders[os.path.dirname(path)].append(path)
    return folders


def of_day(folders, day):
    """The folders of the Nth day of the year. The largest are dealt out first, each to the day that has the fewest files."""
    days = [[] for _ in range(DAYS)]
    for folder in sorted(folders, key=lambda name: (-len(folders[name]), name)):
        min(days, key=lambda names: sum(len(folders[name]) for name in names)).append(folder)
    return sorted(days[day % DAYS])


class Symbols:
    """What one object defines for others and what it needs of them, by mangled names."""
    def __init__(self, path):
        self.defined, self.needed = set(), set()
        for line in subprocess.run(["nm", "-g", "-P", path], check=True, capture_output=True, text=True).stdout.splitlines():
            name, kind = line.split()[:2]
            (self.needed if kind in "Uw" else self.defined).add(name)


def edges_of(symbols):
    """{file: {file it needs: one symbol}} of the objects of one folder, given as {file: Symbols}."""
    return {source: {target: min(shared) for target, other in sorted(symbols.items())
                     if target != source and (shared := own.needed & other.defined)}
            for source, own in sorted(symbols.items())}


def circles_of(edges):
    """The sets of files that all reach each other, largest first."""
    reached = {}
    for start in edges:
        seen, todo = set(), [start]
        while todo:
            for target in edges[todo.pop()]:
                if target not in seen:
                    seen.add(target)
                    todo.append(target)
        reached[start] = seen
    circles = {frozenset(other for other in reached[file] if file in reached[other]) for file in edges if file in reached[file]}
    return sorted(circles, key=lambda circle: (-len(circle), sorted(circle)))


def demangled(names):
    """{mangled name: name without parameters}"""
    told = subprocess.run(["c++filt", "-p"], input="\n".join(names), check=True, capture_output=True, text=True).stdout
    return dict(zip(names, (re.sub(r"\binterneuron::|\[abi:cxx11\]", "", name) for name in told.splitlines())))


def told(circle, edges):
    """The edges within a circle, `a.cc -> b.cc (symbol)`."""
    pairs = [(source, target) for source in sorted(circle) for target in edges[source] if target in circle]
    names = demangled(sorted({edges[source][target] for source, target in pairs}))
    return ", ".join(f"{source} -> {target} ({names[edges[source][target]]})" for source, target in pairs)


class Checker:
    def __init__(self, root, build, jobs):
        self.root, self.build, self.jobs = root, build, jobs
        self.commands = read_commands(root, build)
        self.folders = by_folder(self.commands)
        self.problems = []

    def compile(self, path):
        """Compiles one file; returns its object, or the problem as (None, problem)."""
        directory, words = self.commands[path]
        target = os.path.join(self.build, "alone", path + ".o")
        os.makedirs(os.path.dirname(target), exist_ok=True)
        done = subprocess.run([*CACHE, *words, "-O0", "-o", target], cwd=directory, capture_output=True, text=True)
        if done.returncode == 0:
            return target, None
        error = ERROR.search(done.stderr)
        if not error:
            return None, f"{path}:1: does not compile alone: {(done.stderr.strip() or 'killed').splitlines()[-1]}"
        place = os.path.relpath(os.path.join(directory, error[1]), self.root)
        of = "" if place == path else f" as a part of {path}"
        return None, f"{place}:{error[2]}: does not compile alone{of}: {error[3]}; include what declares it"

    def run(self, folders):
        self.check_rows()
        paths = [path for folder in folders for path in self.folders[folder]]
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            results = dict(zip(paths, pool.map(self.compile, paths)))
        self.problems += sorted({problem for _, problem in results.values() if problem})
        for folder in folders:
            objects = {os.path.basename(path): results[path][0] for path in self.folders[folder]}
            if not folder.startswith("tests") and all(objects.values()):
                self.check_circles(folder, edges_of({name: Symbols(path) for name, path in objects.items()}))
        return self

    def check_rows(self):
        rows = ceilings.read(self.root, ("circle", "no-circle"))
        never = {folder for _, kind, words in rows if kind == "no-circle" for folder in words}
        self.known = collections.defaultdict(dict)
        for line, kind, words in rows:
            for folder in words[:1] if kind == "circle" else words:
                if not os.path.isdir(os.path.join(self.root, folder)):
                    self.problems.append(f"{ceilings.where(line)}: there is no folder {folder}; strike it or write its new name")
            for file in words[1:] if kind == "circle" else ():
                here = os.path.join(self.root, words[0])
                if os.path.isdir(here) and not os.path.isfile(os.path.join(here, file)):
                    self.problems.append(f"{ceilings.where(line)}: there is no {words[0]}/{file}; strike it")
            if kind == "circle":
                self.known[words[0]][frozenset(words[1:])] = line
                if words[0] in never:
                    self.problems.append(f"{ceilings.where(line)}: {words[0]} may have no circle; strike the row")

    def check_circles(self, folder, edges):
        known = dict(self.known[folder])
        for circle in circles_of(edges):
            names = " ".join(sorted(circle))
            if known.pop(circle, None):
                continue
            wider = next((other for other in known if circle < other), None)
            if wider:
                self.problems.append(f"{ceilings.where(known.pop(wider))}: the circle has become smaller; make the row "
                                     f"`circle {folder} {names}`")
            else:
                self.problems.append(f"{folder}/{sorted(circle)[0]}:1: {names} call each other in a circle; let one return "
                                     f"what the other acts on: {told(circle, edges)}")
        for circle, line in known.items():
            self.problems.append(f"{ceilings.where(line)}: {folder} has no circle of {' '.join(sorted(circle))} any more; strike the row")


def sources(root):
    """The .cc files of the project, tracked or new."""
    listed = subprocess.run(["git", "-c", f"safe.directory={root}", "ls-files", "--cached", "--others", "--exclude-standard", "*.cc"],
                            cwd=root, capture_output=True, text=True).stdout.splitlines()
    return {path for path in listed if os.path.exists(os.path.join(root, path))}


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--build", default=None)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--day", type=int, default=datetime.date.today().timetuple().tm_yday)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("folders", nargs="*", metavar="FOLDER")
    chosen = parser.parse_args(arguments)
    root = os.path.abspath(chosen.root)
    build = os.path.abspath(chosen.build or os.path.join(root, "build/alone"))
    try:
        checker = Checker(root, build, chosen.jobs)
    except OSError as error:
        print(f"alone: {error.filename}: {error.strerror}; configure it as scripts/check.sh does", file=sys.stderr)
        return 2
    folders = [folder.rstrip("/") for folder in chosen.folders] or list(checker.folders)
    unknown = [folder for folder in folders if folder not in checker.folders]
    if unknown:
        print(f"alone: no .cc file in {', '.join(unknown)}; name folders such as src/core/flow", file=sys.stderr)
        return 2
    if not chosen.all and not chosen.folders:
        folders = of_day(checker.folders, chosen.day)
    checker.run(folders)
    without = sorted(path for path in sources(root) - checker.commands.keys() if os.path.dirname(path) in folders)
    if without:
        print(f"alone: without flags in this build: {', '.join(without)}")
    for problem in checker.problems:
        print(problem)
    files = sum(len(checker.folders[folder]) for folder in folders)
    if checker.problems:
        print(f"alone: {len(checker.problems)} finding(s) in {files} files", file=sys.stderr)
        return 1
    print(f"alone: {files} of {len(checker.commands)} files, {len(folders)} of {len(checker.folders)} folders: each compiles, "
          "no circle but the known")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
