#!/usr/bin/env python3
"""Whether both back ends of the testbed give the delays that the model promises, over a long drive, in virtual time.

  tests/netns/acceptance.py --program PROGRAM [--out DIR] [--seconds S] [--backend NAME]...

Each back end gets a machine of its own (scripts/vm.sh --icount), both at once: a vehicle with a 4G and a 5G modem, pinged
100 times a second over each. Then, against `testbed schedule`, which prints the same links' delays without any packets:
  table        mean, min, max and std of the round-trip times are within 5 % of the published ones
  distribution netem, emulator and model differ pairwise by a Kolmogorov-Smirnov distance of at most 0.05
  course       their courses over time correlate by at least 0.9
DIR gets ping's output and the model's course. With --evaluate only what DIR holds is judged.

Exit codes: 0 all hold, 1 not, 2 usage, 77 not possible here.
"""
import argparse
import csv
import json
import math
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INTERVAL = 0.01  # s between pings, and between lines of the schedule
TABLE = {  # ms: mean, min, max, std of the round-trip time; Wu et al., 2022
    '4g': {'seed': 1287, 'mean': 173, 'min': 23, 'max': 994, 'std': 258},
    '5g': {'seed': 1154, 'mean': 26, 'min': 19, 'max': 96, 'std': 12},
}
TABLE_TOLERANCE = 0.05
MAX_DISTANCE = 0.05
MIN_CORRELATION = 0.9
MAX_LAG = 2.0  # s between the model's first instant and the first ping, at most
MAX_LOST = 0.001  # of the pings: those on the way at the end
SKIPPED = 77


def scenario():
    lines = ['schema = 1', 'seed = 1']
    for name, link in TABLE.items():
        lines += ['', '[[link]]', f'name = "{name}"', f'profile = "{name}"', f'seed = {link["seed"]}']
    # The table is of delays. A lost ping has none, and bad times lose more of them: without losses all times weigh alike.
    lines += ['', '[[event]]', 'at_s = 0', 'link = "*"', 'loss = 0']
    return '\n'.join(lines) + '\n'


# --- in the machine ---------------------------------------------------------------------------------------------------

def run_inside(program, backend, out, seconds):
    """Brings the testbed up and pings over every link at once. Ping writes to memory first: waiting for a file of the
    host would hold up virtual time."""
    testbed = [program, 'testbed']
    name = ['--name', 'acceptance']
    subprocess.run(testbed + ['up', *name, '--backend', backend, '--scenario', str(out / 'scenario.toml')], check=True)
    try:
        status = subprocess.run(testbed + ['status', *name, '--json'], check=True, stdout=subprocess.PIPE).stdout
        (out / f'{backend}.status.json').write_bytes(status)
        memory = Path('/tmp')
        pings = []
        for link in json.loads(status)['links']:
            with (memory / link['name']).open('wb') as to:
                # Where ping wakes late it may send up to three at once, or it would not keep up the rate.
                ping = ['ping', '-D', '-n', '-i', str(INTERVAL), '-l', '3', '-w', str(seconds), '-I', link['nic'],
                        link['road_address']]
                pings.append((link['name'], subprocess.Popen(
                    testbed + ['run', *name, '--in', 'vehicle', '--', *ping], stdout=to)))
        for link, ping in pings:
            code = ping.wait()
            if code not in (0, 1):  # 1: nothing came back, which the evaluation will say
                sys.exit(f'acceptance: ping over {link} ended with {code}')
            (out / f'{backend}.{link}.ping').write_bytes((memory / link).read_bytes())
    finally:
        subprocess.run(testbed + ['down', *name], check=False)
    return 0


# --- on the host ------------------------------------------------------------------------------------------------------

def run_machines(program, backends, out, seconds):
    """0, or an exit code with its reason said."""
    machines, logs, codes = {}, {}, {}
    began = time.monotonic()
    try:
        for backend in backends:
            logs[backend] = (out / f'{backend}.log').open('wb')
            machines[backend] = subprocess.Popen(
                ['bash', str(ROOT / 'scripts/vm.sh'), '--icount', '--timeout', str(600 + 2 * seconds),
                 '--share', str(out), '--', '/usr/bin/python3', str(Path(__file__).resolve()), '--program', str(program),
                 '--out', str(out), '--seconds', str(seconds), '--inside', backend],
                stdout=logs[backend], stderr=subprocess.STDOUT)
        while len(codes) < len(machines):
            time.sleep(0.2)
            for backend, machine in machines.items():
                if backend not in codes and machine.poll() is not None:
                    codes[backend] = machine.returncode
                    print(f'{backend}: {seconds} s of virtual time took {time.monotonic() - began:.0f} s', flush=True)
    finally:
        for machine in machines.values():
            if machine.poll() is None:
                machine.terminate()
                machine.wait()
        for log in logs.values():
            log.close()
    for backend, code in codes.items():
        if code != 0:
            print((out / f'{backend}.log').read_text(errors='replace'), file=sys.stderr, end='')
            print(f'acceptance: {backend}: exit code {code}', file=sys.stderr)
    if SKIPPED in codes.values():
        return SKIPPED
    return 1 if any(codes.values()) else 0


def has_scenarios(program):
    text = subprocess.run([program, 'testbed', 'up', '--help'], stdout=subprocess.PIPE, text=True, check=False).stdout
    return '--scenario' in text and '--backend' in text


# --- evaluation -------------------------------------------------------------------------------------------------------

def as_printed(ms):
    """A round-trip time with the digits that ping prints."""
    for limit, digits in ((0.9995, 3), (9.995, 2), (99.95, 1)):
        if ms < limit:
            return round(ms, digits)
    return float(round(ms))


def read_ping(path):
    """The round-trip times in ms; their course, {slot: ms}, in slots of INTERVAL s since the first ping was sent; and the
    number of pings sent."""
    line = re.compile(r'\[(\d+\.\d+)\] .*icmp_seq=\d+ .*time=([\d.]+) ms$')
    times, course, first, sent = [], {}, None, 0
    with path.open() as lines:
        for text in lines:
            match = line.match(text)
            if match:
                ms = float(match[2])
                at = float(match[1]) - ms / 1e3
                first = at if first is None else first
                times.append(ms)
                course[round((at - first) / INTERVAL)] = ms
            elif 'packets transmitted' in text:
                sent = int(text.split()[0])
    return times, course, sent


def read_schedule(path):
    """{link: {slot: ms}}"""
    courses = {}
    with path.open(newline='') as lines:
        for row in csv.DictReader(lines):
            courses.setdefault(row['link'], {})[round(float(row['t_s']) / INTERVAL)] = as_printed(float(row['rtt_ms']))
    return courses


def statistics(values):
    mean = math.fsum(values) / len(values)
    std = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / len(values))
    return {'mean': mean, 'min': min(values), 'max': max(values), 'std': std}


def distance(a, b):
    """Kolmogorov-Smirnov: the largest difference of the two distribution functions."""
    a, b = sorted(a), sorted(b)
    i = j = 0
    largest = 0.0
    while i < len(a) and j < len(b):
        value = min(a[i], b[j])
        while i < len(a) and a[i] == value:
            i += 1
        while j < len(b) and b[j] == value:
            j += 1
        largest = max(largest, abs(i / len(a) - j / len(b)))
    return largest


def correlation(a, b, lag, step=1):
    """Pearson's, of a(t) and b(t + lag), over the slots that both have."""
    pairs = [(a[t], b[t + lag]) for t in list(a)[::step] if t + lag in b]
    if len(pairs) < 2:
        return 0.0
    mean_a = math.fsum(x for x, _ in pairs) / len(pairs)
    mean_b = math.fsum(y for _, y in pairs) / len(pairs)
    ab = math.fsum((x - mean_a) * (y - mean_b) for x, y in pairs)
    aa = math.fsum((x - mean_a) ** 2 for x, _ in pairs)
    bb = math.fsum((y - mean_b) ** 2 for _, y in pairs)
    return ab / math.sqrt(aa * bb) if aa > 0 and bb > 0 else 0.0


def best_correlation(a, b):
    """The highest within MAX_LAG, and its lag in slots: first coarsely, on a part, then exactly around the best."""
    most = round(MAX_LAG / INTERVAL)
    coarse = max(range(-most, most + 1, 10), key=lambda lag: correlation(a, b, lag, 20))
    fine = max(range(coarse - 9, coarse + 10, 3), key=lambda lag: correlation(a, b, lag, 5))
    return max((correlation(a, b, lag), lag) for lag in range(fine - 2, fine + 3))


class Verdict:
    def __init__(self):
        self.failed = 0

    def check(self, good, text):
        self.failed += not good
        print(('ok    ' if good else 'FAIL  ') + text, flush=True)


def evaluate(out, backends):
    verdict = Verdict()
    schedule = read_schedule(out / 'schedule.csv')
    for link, table in TABLE.items():
        model = schedule[link]
        courses, times = {'model': model}, {'model': list(model.values())}
        for backend in backends:
            found, course, sent = read_ping(out / f'{backend}.{link}.ping')
            if not found:
                verdict.check(False, f'{link} {backend}: no ping came back')
                continue
            courses[backend], times[backend] = course, found
            verdict.check(sent - len(found) <= MAX_LOST * sent, f'{link} {backend}: {len(found)} of {sent} pings came back')
        for who, values in times.items():
            for key, value in statistics(values).items():
                verdict.check(abs(value - table[key]) <= TABLE_TOLERANCE * table[key],
                              f'{link} {who}: {key} {value:.2f} ms, table {table[key]} ms')
        names = list(courses)
        for i, one in enumerate(names):
            for other in names[i + 1:]:
                d = distance(times[one], times[other])
                verdict.check(d <= MAX_DISTANCE, f'{link} {one}, {other}: distance of the distributions {d:.4f}')
                r, lag = best_correlation(courses[one], courses[other])
                verdict.check(r >= MIN_CORRELATION, f'{link} {one}, {other}: correlation {r:.4f} at a lag of '
                              f'{lag * INTERVAL:.2f} s')
    return verdict.failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--program', type=Path, required=True)
    parser.add_argument('--out', type=Path, default=ROOT / 'build/acceptance')
    parser.add_argument('--seconds', type=int, default=1800)
    parser.add_argument('--backend', action='append', choices=['netem', 'emulator'])
    parser.add_argument('--evaluate', action='store_true')
    parser.add_argument('--inside', help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        return run_inside(options.program, options.inside, options.out, options.seconds)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    backends = options.backend or ['netem', 'emulator']
    program, out = options.program.resolve(), options.out.resolve()
    if not options.evaluate:
        if not has_scenarios(program):
            print(f'acceptance: skipped: {program.name} testbed up knows no --backend and --scenario')
            return SKIPPED
        out.mkdir(parents=True, exist_ok=True)
        (out / 'scenario.toml').write_text(scenario())
        with (out / 'schedule.csv').open('wb') as to:
            subprocess.run([program, 'testbed', 'schedule', '--scenario', out / 'scenario.toml', '--seconds',
                            str(options.seconds)], stdout=to, check=True)
        code = run_machines(program, backends, out, options.seconds)
        if code != 0:
            return code
    failed = evaluate(out, backends)
    print(f'acceptance: {failed} of the conditions do not hold' if failed else 'acceptance: all conditions hold')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
