#!/usr/bin/env python3
"""Checks every #include against the layer tables of ARCHITECTURE.md and of the groups, and that pure folders stay pure.

    scripts/check_layers.py [--root DIR]     check the tree; part of every build

scripts/check_layers_test.py checks the checker.

The tables stand in ARCHITECTURE.md and in the README.md of each group: that of src/core, and so on. A row reads `| folder | what lives there | may include | pure |`. "may include" lists folders by their path
below `src/` (`core/wire`, `include`), whole groups by their name (`core`: every folder `core/...`), header patterns in
angle brackets, `OS` for the headers of the system, or `std only`. The C++ standard library is open to all, except that a
pure folder includes nothing that reads a clock, waits, locks or prints. A pure row names pure folders only, and not `OS`.

In ARCHITECTURE.md a line `Floors: include, policies, netns + lab, ...` orders the groups, of which several may share a floor:
no row may name a folder of a later floor, and
no folders of one floor may include each other in a circle. Each violation is one line `file:line: rule`, and the exit
code is 1.
"""

import fnmatch
import os
import re
import sys

import checker_main

ROOTS = ("include", "policies", "src", "netns", "bench", "examples")
SUFFIXES = (".h", ".cc", ".in", ".inc", ".hpp")

STD = set("""
algorithm any array atomic barrier bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes climits
clocale cmath codecvt compare complex concepts condition_variable coroutine csetjmp csignal cstdarg cstddef cstdint
cstdio cstdlib cstring ctime cuchar cwchar cwctype deque exception execution filesystem format forward_list fstream
functional future initializer_list iomanip ios iosfwd iostream istream iterator latch limits list locale map memory
memory_resource mutex new numbers numeric optional ostream queue random ranges ratio regex scoped_allocator semaphore
set shared_mutex source_location span sstream stack stdexcept stop_token streambuf string string_view strstream
syncstream system_error thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant
vector version""".split())

STD_NOT_PURE = set("""
barrier condition_variable csignal ctime filesystem fstream future iostream latch mutex semaphore shared_mutex
stop_token syncstream thread""".split())

OS_PATTERNS = """
arpa/* asm/* linux/* net/* netinet/* netpacket/* sys/* dirent.h dlfcn.h endian.h err.h errno.h fcntl.h features.h fnmatch.h
getopt.h glob.h grp.h ifaddrs.h libgen.h limits.h mntent.h netdb.h poll.h pthread.h pty.h pwd.h sched.h semaphore.h
signal.h spawn.h stdint.h stdio.h stdlib.h string.h syscall.h syslog.h termios.h time.h ucontext.h unistd.h
wait.h malloc.h""".split()

# What a pure folder may not say, whatever it includes. Applied to code without comments and string contents; the words
# are a quick test, since nearly every file has none of them.
NOT_PURE = [(words.split(), re.compile(pattern), what) for words, pattern, what in (
    ("now", r"::\s*now\s*\(", "reads a clock"),
    ("_clock", r"\b(?:steady|system|high_resolution|utc|tai|gps|file)_clock\b", "names a clock of the system"),
    ("clock_ gettimeofday timerfd_ rdtsc",
     r"\b(?:clock_gettime|clock_nanosleep|gettimeofday|timerfd_\w+|__rdtsc)\b", "reads a clock"),
    ("time", r"(?<![\w.>:])(?:(?:std)?::\s*)?time\s*\(\s*(?:nullptr|NULL|0|&\s*\w+)\s*\)", "reads a clock"),
    ("time clock", r"(?<![\w.>:])(?:std)?::\s*(?:time|clock)\s*\(", "reads a clock"),
    ("clock", r"(?<![\w.>:])clock\s*\(\s*\)\s*[;)\-+*/]", "reads a clock"),
    ("sleep this_thread", r"(?<![\w.])(?:sleep|usleep|nanosleep|sleep_for|sleep_until|this_thread)\b", "waits"),
    ("thread async mutex lock condition_variable",
     r"\bstd\s*::\s*(?:jthread|thread|async|mutex|\w+_mutex|\w*_lock|lock_guard|condition_variable\w*)\b",
     "threads or locks"),
    ("cout cerr clog cin spdlog printf puts",
     r"\bstd\s*::\s*(?:cout|cerr|clog|cin)\b|\bspdlog\b|(?<![\w.>])f?printf\s*\(|(?<![\w.>])puts\s*\(", "prints"),
    ("system popen fopen fstream socket ioctl",
     r"(?<![\w.>])(?:std)?::\s*(?:system|popen|fopen|socket|ioctl|open|read|write|send\w*|recv\w*)\s*\(|"
     r"\bstd\s*::\s*[io]?fstream\b", "calls the system"),
    ("random_device rand getrandom getenv",
     r"\bstd\s*::\s*random_device\b|(?<![\w.>])s?rand\s*\(|\b(?:getrandom|getenv)\s*\(", "has a hidden input"),
)]

TOKEN = re.compile(r"""
    (?P<comment> //(?:[^\\\n]|\\.|\\\n)* | /\*.*?\*/ )
  | (?P<raw> R"(?P<tag>[^()\\\s]{0,16})\(.*?\)(?P=tag)" )
  | (?P<string> "(?:[^"\\\n]|\\.)*" )
  | (?P<char> (?<![0-9A-Fa-f])'(?:[^'\\\n]|\\.)+' )
""", re.DOTALL | re.VERBOSE)
INCLUDE_BEGINS = re.compile(r"#[ \t]*include[ \t]*$")
# Includes that the rules could not be held against: of a macro, of the next file of that name.
ODD_INCLUDE = re.compile(r'^[ \t]*(?:#|%:)[ \t]*(?:include_next\b|import\b|include\b(?![ \t]*(?:"[^"\n]|<[^>\n])))', re.MULTILINE)
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(?:"([^"\n]+)"|<([^>\n]+)>)', re.MULTILINE)


class Folder:
    """A row of the table and what its folder may include. That of src/core/wire has the name core/wire and the group core."""
    def __init__(self, path, pure):
        self.path = path
        self.name = "include" if path.startswith("include") else path.removeprefix("src/")
        self.group = self.name.split("/")[0]
        self.pure = pure
        self.os = False
        self.folders = set()
        self.patterns = []


def read_rows(name, text, folders, problems):
    """Adds the rows of one document."""
    columns = None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.lstrip().startswith("|"):
            columns = None
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if columns is None:
            header = [cell.lower() for cell in cells]
            columns = {}
            if header[0] == "folder" and "may include" in header:
                columns = {title: index for index, title in enumerate(header)}
            continue
        if not columns or set("".join(cells)) <= set("-: "):
            continue
        where = f"{name}:{number}"
        if len(cells) != len(columns):
            problems.append(f"{where}: the row has {len(cells)} cells, the header {len(columns)}")
            continue
        path = cells[0].strip("`").rstrip("/")
        pure = "pure" in columns and cells[columns["pure"]].lower() == "yes"
        folder = Folder(path, pure)
        folder.line = where
        for word in filter(None, (w.strip().strip("`") for w in cells[columns["may include"]].split(","))):
            if word == "OS":
                folder.os = True
            elif word.startswith("<") and word.endswith(">"):
                folder.patterns.append(word[1:-1])
            elif word not in ("std only", "—", "-"):
                folder.folders.add(word)
        folders[path] = folder


def read_table(*documents):
    """Reads the tables whose header starts with `folder`, of documents (name, text), the first of which has the floors; returns
    their rows, as {path: Folder}, and [problem]."""
    folders, problems = {}, []
    for name, text in documents:
        read_rows(name, text, folders, problems)
    if not folders:
        problems.append(f"{documents[0][0]}:1: no table with the columns `folder` and `may include`")
    by_name = {folder.name: folder for folder in folders.values()}
    groups = {folder.group for folder in folders.values()}
    floors, line = read_floors(documents[0][1])
    if not floors:
        problems.append("ARCHITECTURE.md:1: no line `Floors: ...` with the groups in their order")
    for folder in folders.values():
        if floors and folder.group not in floors:
            problems.append(f"ARCHITECTURE.md:{line}: {folder.path} is of no floor")
        for word in sorted(folder.folders):
            where = f"{folder.line}: {folder.path} may include {word}"
            if word not in by_name and word not in groups:
                problems.append(f"{where}, which is no folder and no group of the table")
            elif floors.get(folder.group, len(floors)) < floors.get(word.split("/")[0], 0):
                problems.append(f"{where}, which is of a later floor")
            elif word in groups and word not in by_name:
                if word == folder.group:
                    problems.append(f"{where}, its own group: name the folders")
                folder.folders |= {name for name in by_name if name.startswith(word + "/")}
        folder.folders &= by_name.keys()
        if folder.pure:
            where = f"{folder.line}: {folder.path} is pure and may include"
            problems += [f"{where} {name}, which is not" for name in sorted(folder.folders) if not by_name[name].pure]
            problems += [f"{where} OS: system calls are for folders that are not"] if folder.os else []
    problems += find_cycles(folders)
    return folders, problems


def read_floors(text):
    """Returns {group: its floor, counted from the lowest}, and the number of the line that names them."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("Floors: "):
            floors = line.removeprefix("Floors: ").split(",")
            return {word.strip(" `."): floor for floor, words in enumerate(floors) for word in words.split("+")}, number
    return {}, 0


def find_cycles(folders):
    """Removes folders that include none of the rest until none is left; if some stay, they are on a cycle or above one."""
    rest = {f.name: set(f.folders) - {f.name} for f in folders.values()}
    while rest:
        free = [name for name, needs in rest.items() if not needs & rest.keys()]
        if not free:
            return [f"ARCHITECTURE.md:1: the table is not one-way: {', '.join(sorted(rest))} include each other"]
        for name in free:
            del rest[name]
    return []


def blank(match):
    text = match.group()
    if text.startswith(("//", "/*")):
        return " " + "\n" * text.count("\n")
    if text.startswith("'"):
        return "' '"
    line_start = match.string.rfind("\n", 0, match.start()) + 1
    if INCLUDE_BEGINS.search(match.string, line_start, match.start()):
        return text
    return '""' + "\n" * text.count("\n")


def bare_code(text):
    """The text without comments and the contents of strings, but with the names of headers; line numbers stay as they were."""
    return TOKEN.sub(blank, text)


def line_of(text, position):
    return text.count("\n", 0, position) + 1


class Checker:
    def __init__(self, root):
        self.root = root
        self.files = 0
        self.includes = 0
        self.problems = []
        self.existing = {}

    def documents(self):
        """ARCHITECTURE.md and the groups' pages, those that there are, as (name, text)."""
        source = os.path.join(self.root, "src")
        groups = sorted(os.listdir(source)) if os.path.isdir(source) else []
        pages = [f"src/{group}/README.md" for group in groups] + ["netns/README.md"]
        found = []
        for name in ["ARCHITECTURE.md"] + [page for page in pages if os.path.exists(os.path.join(self.root, page))]:
            with open(os.path.join(self.root, name), encoding="utf-8") as file:
                found.append((name, file.read()))
        return found

    def run(self):
        try:
            self.folders, self.problems = read_table(*self.documents())
        except OSError as error:
            self.problems = [f"ARCHITECTURE.md:1: cannot be read: {error.strerror}"]
            return self
        for top in ROOTS:
            for directory, names, files in os.walk(os.path.join(self.root, top)):
                names.sort()
                for name in sorted(files):
                    if name.endswith(SUFFIXES):
                        self.check_file(os.path.relpath(os.path.join(directory, name), self.root))
        return self

    def folder_of(self, path):
        # The folder of the root is the root.
        while path and path != os.path.dirname(path):
            path = os.path.dirname(path)
            if path in self.folders:
                return self.folders[path]
        return None

    def exists(self, path):
        if path not in self.existing:
            self.existing[path] = os.path.isfile(os.path.join(self.root, path))
        return self.existing[path]

    def resolve(self, source, header):
        """The path inside the project that the compiler would find for "header", or a guess where it is missing."""
        places = (os.path.dirname(source), "include", "src", "")
        paths = [os.path.normpath(os.path.join(place, header)) for place in places]
        for path in paths:
            if self.exists(path):
                return path
        for path in paths[1:]:
            if self.folder_of(path):
                return path
        return paths[0] if "/" not in header else None

    def check_file(self, path):
        folder = self.folder_of(path)
        try:
            with open(os.path.join(self.root, path), encoding="utf-8", errors="replace") as file:
                text = file.read()
        except FileNotFoundError:  # an editor's temporary file, gone since it was listed
            return
        self.files += 1
        if folder is None:
            self.problems.append(f"{path}:1: its folder has no row in the layer table of ARCHITECTURE.md")
            return
        code = bare_code(text)
        for match in INCLUDE.finditer(code):
            self.includes += 1
            quoted, angle = match.groups()
            rule = self.check_include(folder, path, quoted, angle)
            if rule:
                self.problems.append(f"{path}:{line_of(code, match.start())}: {rule}")
        for match in ODD_INCLUDE.finditer(code):
            self.problems.append(f"{path}:{line_of(code, match.start())}: `{match.group().strip()}` cannot be checked; "
                                 'write #include "..." or <...>')
        if not folder.pure:
            return
        code = INCLUDE.sub("", code)
        for words, pattern, what in NOT_PURE:
            if not any(word in code for word in words):
                continue
            for match in pattern.finditer(code):
                self.problems.append(f"{path}:{line_of(code, match.start())}: `{match.group().strip()}` {what}; "
                                     f"{folder.path} is pure, pass it in as an argument")

    def check_include(self, folder, path, quoted, angle):
        header = quoted or angle
        if quoted or header.startswith("interneuron/"):
            target = self.resolve(path, header)
            target_folder = self.folder_of(target) if target else None
            if target_folder is None:
                return f'"{header}" lies in no folder of the layer table; libraries are included with <>'
            if target_folder is folder or target_folder.name in folder.folders:
                return None
            allowed = ", ".join(sorted(folder.folders)) or "nothing of the project"
            return f'{folder.path} may not include {target_folder.path} ("{header}"); allowed: {allowed}'
        if any(fnmatch.fnmatchcase(header, pattern) for pattern in folder.patterns):
            return None
        if header in STD:
            if folder.pure and header in STD_NOT_PURE:
                return f"<{header}> in {folder.path}, which is pure: no clocks, threads, locks, files or printing"
            return None
        if folder.os and any(fnmatch.fnmatchcase(header, pattern) for pattern in OS_PATTERNS):
            return None
        return f"{folder.path} may not include <{header}>; its row in ARCHITECTURE.md does not list it"


def checked(root):
    checker = Checker(root).run()
    return checker.problems, f"{checker.files} files, {checker.includes} includes, all as ARCHITECTURE.md and the groups' tables allow"


if __name__ == "__main__":
    sys.exit(checker_main.main("layers", __doc__, checked))
