#!/usr/bin/env python3
"""`interneuron probe` on emulated links against fping, iperf3 and the emulator's own counters.

    tests/netns/probe_acceptance.py --program build/release/interneuron [--quick | --smoke] [--json FILE]

One line per figure, exit code 1 if one is out of its bounds, 77 where no testbed can be made, a tool is missing, or the
machine was too slow for iperf3. --quick: fewer packets and wider bounds for what is chance then; --smoke: a few seconds.
Bounds: round trip p50 within max(0.5 ms, 2 %) of fping's; losses equal to the emulator's counters for the same packets
and within 0.5 points of nominal over 20,000 packets; rates within 15 % of what iperf3 carries over UDP.
"""

import argparse
import contextlib
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

SKIP = 77
ATTEMPTS = 4
FAILED = []
INCONCLUSIVE = []
RESULTS = []

PROFILE = """# Source: chosen, for the acceptance of the probe
schema = 1
name = "{name}"
description = "constant"
model = "constant"
rtt_ms = {rtt}
loss = 0
[up]
rate_mbit = {up}
loss = {loss_up}
[down]
rate_mbit = {down}
loss = {loss_down}
"""


def check(what, measured, reference, good, unit=""):
    RESULTS.append({"what": what, "measured": measured, "reference": reference, "unit": unit, "ok": good})
    print(f"{'ok  ' if good else 'FAIL'} {what}: {measured:.3f} against {reference:.3f} {unit}", flush=True)
    if not good:
        FAILED.append(what)


class Bed:
    """A testbed with one link and a roadside unit that answers."""

    def __init__(self, program, folder, **link):
        self.program = os.path.abspath(program)
        self.folder = folder
        self.name = f"probe-acceptance-{os.getpid()}"
        self.link = {"name": "x", "rtt": 20, "up": 100, "down": 100, "loss_up": 0, "loss_down": 0, **link}
        self.env = {**os.environ, "XDG_RUNTIME_DIR": folder}
        self.road = None

    def __enter__(self):
        profile = os.path.join(self.folder, "link.toml")
        with open(profile, "w", encoding="utf-8") as file:
            file.write(PROFILE.format(**self.link))
        up = subprocess.run([self.program, "testbed", "up", "--name", self.name, "--profile", f"x={profile}",
                             "--backend", "emulator"], env=self.env, capture_output=True, text=True, check=False)
        if up.returncode != 0:
            print(up.stderr.strip())
            sys.exit(SKIP)
        self.road = self.start("road", [self.program, "road", "--insecure", "--nic", "ifx", "--ladder", "motion",
                                        "--calibration-runs", "1", "--stamp", "--video",
                                        os.path.join(os.path.dirname(__file__), "../../docs/latency.png")],
                               stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        for line in self.road.stdout:
            if line.startswith("ready"):
                return self
        raise SystemExit("the roadside unit ended")

    def __exit__(self, *_):
        self.road.terminate()
        self.road.wait()
        self.road.stdout.close()
        subprocess.run([self.program, "testbed", "down", "--name", self.name], env=self.env,
                       stdout=subprocess.DEVNULL, check=False)

    def inside(self, host, command):
        return [self.program, "testbed", "run", "--name", self.name, "--in", host, "--", *command]

    def start(self, host, command, **options):
        return subprocess.Popen(self.inside(host, command), env=self.env, **options)

    def run(self, host, command):
        return subprocess.run(self.inside(host, command), env=self.env, capture_output=True, text=True, check=False)

    def probe(self, *options):
        clear = [] if "--stamp" in options else ["--insecure"]
        ran = self.run("vehicle", [self.program, "probe", *clear, "--nic", "ifx=10.77.0.1", "--json", *options])
        if not ran.stdout:
            raise SystemExit(ran.stderr)
        return json.loads(ran.stdout)["nics"][0]

    def counters(self):
        ran = subprocess.run([self.program, "testbed", "status", "--name", self.name, "--json"], env=self.env,
                             capture_output=True, text=True, check=True)
        return json.loads(ran.stdout)["links"][0]


def round_trips(program, folder, quick):
    """The same link, at the same time, with packets of the same size."""
    for rtt in (5, 20, 80):
        with Bed(program, folder, rtt=rtt) as bed:
            count = 250 if quick else 1000
            fping = bed.start("vehicle", ["fping", "-c", str(count), "-p", "20", "-t", "1000", "-b", "100", "-I", "ifx",
                                          "10.77.0.1"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            found = bed.probe("--count", str(count), "--interval", "20ms", "--no-rate")
            theirs = [float(x) for x in re.findall(r"bytes, ([0-9.]+) ms", fping.communicate()[0])]
            reference = statistics.median(theirs)
            for format_ in ("echo", "stamp"):
                if format_ == "stamp":
                    found = bed.probe("--count", str(count // 2), "--interval", "20ms", "--no-rate", "--stamp")
                p50 = found["rtt"]["p50_ms"]
                check(f"rtt p50 of a {rtt} ms link ({format_})", p50, reference,
                      abs(p50 - reference) <= max(0.5, 0.02 * reference), "ms (fping)")


def losses(program, folder, quick):
    for loss_up, loss_down in ((0.01, 0), (0, 0.05), (0.01, 0.01), (0.05, 0.05)):
        with Bed(program, folder, loss_up=loss_up, loss_down=loss_down) as bed:
            bed.probe("--count", "5", "--no-rate")  # neighbours, routes
            before = bed.counters()
            count = 4000 if quick else 20000
            began = time.monotonic()
            found = bed.probe("--count", str(count), "--interval", "1ms", "--no-rate")
            took = time.monotonic() - began
            after = bed.counters()
            name = f"loss {100 * loss_up:g} % up, {100 * loss_down:g} % down"
            check(f"{name}: packets sent in {took:.1f} s", found["sent_packets"], count,
                  found["sent_packets"] == count and took < count / 1000 + 3)
            sum_of_fates = sum(found[key] for key in ("answered_packets", "late_packets", "lost_up_packets",
                                                      "lost_down_packets", "lost_packets"))
            check(f"{name}: fates", sum_of_fates, count, sum_of_fates == count)
            for way, nominal in (("up", loss_up), ("down", loss_down)):
                counted = after[way]["lost"] - before[way]["lost"]
                carried = after[way]["packets"] - before[way]["packets"]
                lost = found[f"lost_{way}_packets"]
                # The closing packets (at most 10) are not pings; they may be lost as well.
                beyond = carried - (count if way == "up" else count - found["lost_up_packets"])
                check(f"{name}: lost {way} (of {carried} packets that the emulator saw)", lost, counted,
                      0 <= counted - lost <= max(beyond, 0), "packets (emulator)")
                share = 100 * lost / count
                bound = 0.5 if not quick else 1.5
                of = nominal if way == "up" else nominal * (1 - loss_up)
                check(f"{name}: share lost {way}", share, 100 * of, abs(share - 100 * of) <= bound, "% (nominal)")


def iperf_rate(bed, offered, reverse):
    """Megabits of UDP payload that arrived per second, with what IP and UDP add."""
    server = bed.start("road", ["iperf3", "-s", "-1", "--forceflush"], stdout=subprocess.PIPE,
                       stderr=subprocess.DEVNULL, text=True)
    if not any(line.startswith("Server listening") for line in server.stdout):
        raise SystemExit("the iperf3 server ended")
    ran = bed.run("vehicle", ["iperf3", "-c", "10.77.0.1", "-u", "-b", f"{offered}M", "-l", "1372", "-t", "5", "-J",
                              *(["-R"] if reverse else [])])
    with contextlib.suppress(subprocess.TimeoutExpired):
        server.wait(5)
    server.terminate()
    server.stdout.close()
    end = json.loads(ran.stdout)["end"]["sum"]
    sent = end["bits_per_second"] / 1e6
    return sent * (1 - end["lost_percent"] / 100) * 1400 / 1372


def rates(program, folder, quick):
    for up, down in ((5, 20), (30, 100)) if quick else ((5, 20), (30, 100), (100, 300), (60, 10)):
        with Bed(program, folder, up=up, down=down) as bed:
            found = bed.probe("--count", "50")
            time.sleep(1)
            for way, nominal in (("up", up), ("down", down)):
                reference = max(iperf_rate(bed, 1.3 * nominal, way == "down") for _ in range(2))
                measured = found[f"rate_{way}_mbit"] or 0
                if reference < 0.85 * nominal:
                    # It offered more than the link takes: the machine was too slow for iperf3.
                    INCONCLUSIVE.append(f"rate {way} of {nominal} Mbit/s")
                    print(f"?    rate {way} of a {nominal} Mbit/s link: {measured:.3f}, but iperf3 itself carried only "
                          f"{reference:.3f} Mbit/s", flush=True)
                    continue
                check(f"rate {way} of a {nominal} Mbit/s link", measured, reference,
                      abs(measured - reference) <= 0.15 * reference, "Mbit/s (iperf3)")
            stamp = bed.probe("--count", "50", "--stamp")
            measured = stamp["rate_up_mbit"] or 0
            check(f"rate up of a {up} Mbit/s link, plain STAMP", measured, up, abs(measured - up) <= 0.15 * up,
                  "Mbit/s (nominal)")


def smoke(program, folder, _):
    """A few seconds of everything but rates."""
    with Bed(program, folder, rtt=20, loss_up=0.03, loss_down=0.05) as bed:
        bed.probe("--count", "5", "--no-rate")
        before = bed.counters()
        found = bed.probe("--count", "3000", "--interval", "1ms", "--no-rate")
        after = bed.counters()
        for way in ("up", "down"):
            counted = after[way]["lost"] - before[way]["lost"]
            lost = found[f"lost_{way}_packets"]
            check(f"lost {way}", lost, counted, 0 <= counted - lost <= 10, "packets (emulator)")
        # Both at once, since a busy machine wakes everybody late; and again, since it may keep only one of them waiting.
        for _ in range(ATTEMPTS):
            fping = bed.start("vehicle", ["fping", "-c", "100", "-p", "20", "-t", "1000", "-b", "100", "-I", "ifx",
                                          "10.77.0.1"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            p50 = bed.probe("--count", "100", "--interval", "20ms", "--no-rate")["rtt"]["p50_ms"]
            reference = statistics.median(float(x) for x in re.findall(r"bytes, ([0-9.]+) ms", fping.communicate()[0]))
            if good := abs(p50 - reference) <= max(0.5, 0.02 * reference):
                break
        check("rtt p50 of a 20 ms link", p50, reference, good, "ms (fping)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--smoke", action="store_true", help="half a minute of it")
    parser.add_argument("--only", choices=("rtt", "loss", "rate"))
    parser.add_argument("--json", help="also write the figures to this file")
    arguments = parser.parse_args()
    for tool in ("fping", "iperf3"):
        if shutil.which(tool) is None:
            print(f"{tool} is missing")
            return SKIP
    parts = (("smoke", smoke),) if arguments.smoke else (("rtt", round_trips), ("loss", losses), ("rate", rates))
    for name, part in parts:
        if arguments.only not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as folder:
            part(arguments.program, folder, arguments.quick)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"schema": "interneuron.probe_acceptance/1", "figures": RESULTS}, file, indent=2)
    print(f"{len(RESULTS) - len(FAILED)} of {len(RESULTS)} within bounds, {len(INCONCLUSIVE)} inconclusive")
    return 1 if FAILED else SKIP if INCONCLUSIVE else 0


if __name__ == "__main__":
    sys.exit(main())
