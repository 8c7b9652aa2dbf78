"""Places in network namespaces and the processes in them, for tests/netns/insider_acceptance.py.

The script runs itself anew in a mount and a process namespace, in which it is process 1: when that ends, however it
ends, the kernel ends all that it has started and forgets its network namespaces.
"""

import contextlib
import ctypes
import csv
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time

SKIP = 77
# Where the threads of a program that is judged waited for a processor for more than this share of the time, per cent, others
# had it, and a figure out of its bounds may be theirs. Beside a dozen busy processes on two processors, one that computes for
# 15 ms of each 100 waits for 80 % of the time.
MOST_WAIT = 25
# The port of a roadside unit.
PORT = 47000
# How often a smoke form is run where the machine was too busy to tell.
ATTEMPTS = 3
# What check() has found, and what could not be judged.
RESULTS = []
INCONCLUSIVE = []
# Connects to the socket on which a program publishes what it measures, and prints each line that comes.
WATCHER = """
import socket, sys
s = socket.socket(socket.AF_UNIX)
s.connect("\\0interneuron.live." + sys.argv[1])
for line in s.makefile():
    print(line, end="", flush=True)
"""


def check(what, measured, bound, unit, at_least=False, waited=0):
    """`waited`: of the time that is judged, per cent for which those who are judged waited for a processor."""
    good = measured is not None and (measured >= bound if at_least else measured <= bound)
    if not good and waited > MOST_WAIT:
        inconclusive(f"{what}: {measured:.3f}, but {waited:.0f} % of the time was waited for a processor: this machine is too busy")
        return
    RESULTS.append({"what": what, "measured": measured, "bound": bound, "at_least": at_least, "unit": unit, "ok": good})
    sign = ">=" if at_least else "<="
    print(f"{'ok  ' if good else 'FAIL'} {what}: {measured:.3f} {sign} {bound:g} {unit}", flush=True)


def note(text):
    print(f"     {text}", flush=True)


def inconclusive(text):
    INCONCLUSIVE.append(text)
    print(f"?    {text}", flush=True)


def find_programs(parser, options):
    """The program, and the attacker beside which it was built."""
    options.program = os.path.abspath(options.program)
    if options.attacker is None:
        build = options.program
        while build != "/" and not os.path.exists(os.path.join(build, "CMakeCache.txt")):
            build = os.path.dirname(build)
        options.attacker = os.path.join(build, "tests/netns/attacker/attacker")
    options.attacker = os.path.abspath(options.attacker)
    for file in (options.program, options.attacker):
        if not os.access(file, os.X_OK):
            parser.error(f"'{file}' is no program: build it, or name it by --program or --attacker")


def finish(path, schema):
    """Tells what was found, writes it to the file if one is named, and returns the exit code."""
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"schema": schema, "figures": RESULTS}, file, indent=2)
    failed = sum(not figure["ok"] for figure in RESULTS)
    print(f"{len(RESULTS) - failed} of {len(RESULTS)} within bounds, {len(INCONCLUSIVE)} inconclusive")
    return 1 if failed else SKIP if INCONCLUSIVE else 0


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIP)


def is_confined():
    """Whether this is the script that confine() has started; then its places can be made."""
    if "--inner" not in sys.argv:
        return False
    sys.argv.remove("--inner")
    if os.getpid() != 1:
        raise SystemExit("--inner is not for people")
    subprocess.run(["mount", "-t", "tmpfs", "tmpfs", "/run"], check=True)
    return True


def confine():
    """Runs the script anew in namespaces of its own and ends with its code, or with 77. `unshare` lets nothing but a
    kill end it early, and then what it has started ends with it; so it is killed by a signal to us and by our end."""
    for tool in ("unshare", "ip", "tcpdump"):
        if shutil.which(tool) is None:
            skip(f"{tool} is missing: run scripts/setup.sh")
    user = ["--user", "--map-root-user"] if os.geteuid() != 0 else []
    command = ["unshare", *user, "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"]
    possible = subprocess.run(
        [*command, "sh", "-c", "mount -t tmpfs tmpfs /run && ip netns add a && ip -n a link add x type bridge && "
         "ip -n a link add y type veth peer name z && ip netns exec a true"],
        capture_output=True, text=True, check=False)
    if possible.returncode != 0:
        skip(f"no namespaces here: {possible.stderr.strip()}")
    end_with_parent = ctypes.CDLL(None).prctl
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda got, _: sys.exit(128 + got))
    with tempfile.TemporaryDirectory() as folder:
        inner = subprocess.Popen([*command, sys.executable, *sys.argv, "--inner"], env={**os.environ, "TMPDIR": folder},
                                 start_new_session=True, preexec_fn=lambda: end_with_parent(1, signal.SIGKILL))
        try:
            sys.exit(inner.wait())
        finally:
            inner.kill()
            inner.wait()


class Lab:
    """Places, each a network namespace, the cables between them, and the processes in them."""

    def __init__(self, folder):
        self.folder = folder
        self.processes = []
        self.places = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in list(reversed(self.processes)):
            self.stop(process)
        for place in self.places:
            subprocess.run(["ip", "netns", "del", place], check=False)

    @staticmethod
    def ip(*arguments):
        subprocess.run(["ip", *arguments], check=True)

    def place(self, name, forwards=False):
        self.places.append(name)
        self.ip("netns", "add", name)
        self.ip("-n", name, "link", "set", "lo", "up")
        for key, value in (("ip_forward", int(forwards)), ("conf/all/rp_filter", 0), ("conf/default/rp_filter", 0)):
            self.run(name, ["sh", "-c", f"echo {value} > /proc/sys/net/ipv4/{key}"])

    def cable(self, one, nic, address, other, other_nic, other_address=None):
        """A veth between two places; an end without an address is a port of the place's bridge `switch`."""
        self.ip("-n", one, "link", "add", nic, "type", "veth", "peer", "name", other_nic, "netns", other)
        for place, name, at in ((one, nic, address), (other, other_nic, other_address)):
            if at is None:
                self.ip("-n", place, "link", "set", name, "master", "switch")
            else:
                self.ip("-n", place, "address", "add", at, "dev", name)
            self.ip("-n", place, "link", "set", name, "up")

    @staticmethod
    def inside(place, command):
        return ["ip", "netns", "exec", place, *command]

    def run(self, place, command):
        return subprocess.run(self.inside(place, command), capture_output=True, text=True, check=False)

    def start(self, place, command, log=None, **options):
        """`ip netns exec` becomes the command, so that its process number is the one returned."""
        with contextlib.ExitStack() as stack:
            if log is not None:
                options["stderr"] = stack.enter_context(open(os.path.join(self.folder, log), "w", encoding="utf-8"))
            process = subprocess.Popen(self.inside(place, command), text=True, **options)
        self.processes.append(process)
        return process

    def stop(self, process, how=signal.SIGTERM, patience=15):
        if process.poll() is None:
            process.send_signal(how)
            try:
                process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if process.stdout:
            process.stdout.close()
        if process in self.processes:
            self.processes.remove(process)

    def log_of(self, name):
        with open(os.path.join(self.folder, name), encoding="utf-8", errors="replace") as file:
            return file.read()


def values_of(tree, key):
    """All numbers under this key, wherever they are."""
    if isinstance(tree, dict):
        for name, value in tree.items():
            if name == key and isinstance(value, (int, float)):
                yield value
            else:
                yield from values_of(value, key)
    elif isinstance(tree, list):
        for value in tree:
            yield from values_of(value, key)


class Counters:
    """What a program that publishes has counted, as it was told last."""

    # What the evidence has for each link. All that came is one of these.
    KINDS = ("received_packets", "duplicate_packets", "malformed_packets", "other_version_packets", "other_packets",
             "refused_packets", "unauthentic_packets", "handshake_packets")

    def __init__(self, lab, place, pid):
        self.newest = None
        watcher = lab.start(place, [sys.executable, "-c", WATCHER, str(pid)], stdout=subprocess.PIPE,
                            stderr=subprocess.DEVNULL)
        threading.Thread(target=self._read, args=(watcher.stdout,), daemon=True).start()

    def _read(self, lines):
        with contextlib.suppress(ValueError):
            for line in lines:
                self.newest = time.monotonic(), json.loads(line)

    def fresh(self, patience=5):
        """What is told from now on, first."""
        begin = time.monotonic()
        while time.monotonic() < begin + patience:
            if self.newest and self.newest[0] > begin:
                return self.newest[1]
            time.sleep(0.02)
        raise SystemExit("the program publishes nothing")

    @classmethod
    def of_links(cls, told):
        """For each NIC, over all peers; a NIC has a row for each peer."""
        return {link["name"]: {kind: link["evidence"][kind] for kind in cls.KINDS} for link in told["links"]}

    @staticmethod
    def paths(told):
        """Over which NIC which peer is reached, and how it is."""
        return sorted((link["name"], link["peer"]) for link in told["links"])


class Processor:
    """What a process has had of the processors, over time."""

    def __init__(self, pid):
        self.pid = pid
        # Seconds for which its threads have run, and could have run but waited.
        self.samples = []

    def look(self):
        run = wait = 0
        with contextlib.suppress(OSError, ValueError):
            for task in os.listdir(f"/proc/{self.pid}/task"):
                with open(f"/proc/{self.pid}/task/{task}/schedstat", encoding="ascii") as file:
                    ran, waited = (int(word) / 1e9 for word in file.read().split()[:2])
                run, wait = run + ran, wait + waited
            self.samples.append((time.monotonic(), run, wait))

    def share(self, begin, end):
        """Of the time between two instants, per cent for which it ran and for which it waited; above 100 where several
        threads did at once."""
        within = [sample for sample in self.samples if begin <= sample[0] <= end]
        if len(within) < 2:
            return 0, 0
        took = within[-1][0] - within[0][0]
        return tuple(max(100 * (within[-1][i] - within[0][i]) / took, 0) for i in (1, 2))


class Road:
    """A roadside unit, with its memory and what it publishes over time."""

    def __init__(self, lab, program, place, nics, more=(), watched=True):
        self.lab = lab
        command = [program, "road", *(word for nic in nics for word in ("--nic", nic)), *more]
        self.log = f"{place}.log"
        self.process = lab.start(place, command, log=self.log, stdout=subprocess.PIPE)
        for line in self.process.stdout:
            if line.startswith("ready"):
                break
        else:
            raise SystemExit(f"the roadside unit ended: {lab.log_of(self.log)}")
        self.memory = []
        self.processor = Processor(self.process.pid)
        self.stalls = []
        self.ended = threading.Event()
        self.threads = [threading.Thread(target=self._sample, daemon=True)]
        if watched:
            watcher = lab.start(place, [sys.executable, "-c", WATCHER, str(self.process.pid)],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            self.threads.append(threading.Thread(target=self._read, args=(watcher.stdout,), daemon=True))
        for thread in self.threads:
            thread.start()

    def _sample(self):
        while not self.ended.wait(0.05):
            self.memory.append((time.monotonic(), self.rss()))
            self.processor.look()

    def _read(self, lines):
        with contextlib.suppress(ValueError):
            for line in lines:
                for value in values_of(json.loads(line), "loop_stall_ms"):
                    self.stalls.append((time.monotonic(), value))

    def rss(self):
        """MiB that are resident; 0 of a process that has gone."""
        with contextlib.suppress(OSError):
            with open(f"/proc/{self.process.pid}/status", encoding="utf-8") as file:
                for line in file:
                    if line.startswith("VmRSS:"):
                        return int(line.split()[1]) / 1024
        return 0.0

    def growth(self, begin, end):
        """Of its memory between two instants, MiB: the most there was above what there was at the first."""
        before = [mib for at, mib in self.memory if at <= begin][-1:]
        within = [mib for at, mib in self.memory if begin <= at <= end]
        return max(within) - (before[0] if before else within[0])

    def stall(self, begin, end):
        """The longest that was published meanwhile, ms; None where it publishes none. A value that is only repeated
        from before (the longest so far) is not of this time."""
        before = [value for at, value in self.stalls if at <= begin][-1:]
        within = [value for at, value in self.stalls if begin < at <= end]
        if not within:
            return None
        return max([value for value in within if [value] != before], default=0.0)

    def alive(self):
        return self.process.poll() is None

    def stop(self):
        self.ended.set()
        self.lab.stop(self.process)


class Vehicle:
    """An honest vehicle that runs until stop(), which reads its rounds."""

    def __init__(self, lab, program, place, nic, road, video, more=()):
        self.lab = lab
        self.place = place
        self.out = os.path.join(lab.folder, f"{place}-{time.monotonic_ns()}")
        self.log = f"{os.path.basename(self.out)}.log"
        self.rows = []
        self.summary = {}
        self.process = lab.start(place, [program, "vehicle", "--link", f"{nic}={road}", "--video", video, "--rounds",
                                         "1000000", "--ladder", "motion", "--quiet", "--out", self.out, *more],
                                 log=self.log, stdout=subprocess.DEVNULL)
        self.processor = Processor(self.process.pid)
        self.ended = threading.Event()
        threading.Thread(target=self._sample, daemon=True).start()

    def _sample(self):
        while not self.ended.wait(0.05):
            self.processor.look()

    def wait_until_it_runs(self, patience=20):
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if "for the computation" in self.lab.log_of(self.log):
                return
            if self.process.poll() is not None:
                break
            time.sleep(0.05)
        raise SystemExit(f"the vehicle in {self.place} did not begin: {self.lab.log_of(self.log)}")

    def stop(self):
        self.ended.set()
        self.lab.stop(self.process, signal.SIGINT)
        try:
            with open(os.path.join(self.out, "rounds.csv"), encoding="utf-8") as file:
                self.rows = list(csv.DictReader(file))
            with open(os.path.join(self.out, "summary.json"), encoding="utf-8") as file:
                self.summary = json.load(file)
        except OSError:
            raise SystemExit(f"the vehicle in {self.place} left no rounds: {self.lab.log_of(self.log)}") from None

    def between(self, begin, end):
        return [row for row in self.rows if begin <= int(row["t0_ns"]) / 1e9 < end]


def waited(judged, begin, end):
    """Of the time between two instants, per cent for which that of these programs waited for a processor which waited most."""
    return max(program.processor.share(begin, end)[1] for program in judged)


def misses(rows):
    """Per cent of the rounds that no remote result answered in time."""
    return 100 * sum(row["outcome"] != "remote" for row in rows) / max(len(rows), 1)


def median_level(rows):
    levels = [int(row["level"]) for row in rows if row["level"]]
    return statistics.median(levels) if levels else 0
