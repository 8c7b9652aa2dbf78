#!/usr/bin/env python3
"""Makes pairs of modems out of measurements of others: rates of two networks at the same time, with round trips
and losses, as profiles of links for `demo` and `testbed` and as traces for `bench drives --in-step`.

    scripts/measured_pairs.py CHECKOUT OUT

CHECKOUT is https://github.com/NUWiNS/starlink-measurement at commit 4beb9fa, of which the folder
datasets/maine_starlink_trip is read: phones of AT&T, Verizon and Starlink in one car in rural Maine, May 2024.
The repository names no licence, so its data and what is made of them stay out of this tree:

    git clone --filter=blob:none --no-checkout https://github.com/NUWiNS/starlink-measurement build/nuwins
    git -C build/nuwins sparse-checkout set datasets/maine_starlink_trip
    git -C build/nuwins checkout 4beb9fa
    scripts/measured_pairs.py build/nuwins build/pairs

Each phone saturated its uplink and its downlink by UDP for two minutes each, told of every half second, and sent
pings for half a minute; the phones began up to two minutes apart. Of each kind the part that both phones of a pair
measured at the same time is kept, so that one instant of both modems' rates is one instant of the drive; up and
down were measured one after the other, and are laid over each other. Pings did not overlap: their round trips and
losses are those of each phone's nearest half minute.

Writes for each pair N the files N-1.toml and N-2.toml with their N-*.rtt, and index.txt with a line for each pair. Of
pairs with a slow uplink also the traces N-1.up and so on in Mahimahi's format, with at most 10 Mbit/s, and slow.txt
with their arguments for `bench drives --in-step`.
"""
import csv
import itertools
import pathlib
import re
import statistics
import sys
from datetime import datetime

DATA = "datasets/maine_starlink_trip"
SOURCE = "NUWiNS/starlink-measurement at 4beb9fa, Maine, May 2024"
OPERATORS = ("att", "verizon", "starlink")
# Seconds between two rows of a rate, and of round trips.
RATE_STEP_S = 0.5
RTT_STEP_S = 0.2
# A shorter time that two phones have in common is no drive. No measurement behind this value.
LEAST_S = 40
# How far apart the measurements of one phone may be: a phone's round of tests takes twelve minutes.
ROUND_S = 900
# A network that hardly carries anything is no modem. Mbit/s.
LEAST_MBIT = 0.1
# Traces are for slow networks and small files: only of pairs whose slower uplink has at most so many Mbit/s, and
# what is faster than the limit is written as the limit.
SLOW_MBIT = 5
LIMIT_MBIT = 10
# Mahimahi's unit.
OPPORTUNITY_BITS = 1500 * 8


def number(text):
    try:
        return float(text)
    except (TypeError, ValueError):
        return None


def instant(text):
    try:
        return datetime.fromisoformat(text).replace(tzinfo=None).timestamp()
    except (TypeError, ValueError):
        return None


def begun(file):
    """When a measurement began: .../YYYYMMDD/HHMMSSmmm/kind_HHMMSSmmm.csv."""
    clock = re.search(r"_(\d{9})\.csv$", file.name).group(1)
    return datetime.strptime(file.parts[-3] + clock[:6], "%Y%m%d%H%M%S").timestamp() + int(clock[6:]) / 1000


def rates(root, operator, kind):
    """Each measurement as (begin, one rate in Mbit/s for each half second)."""
    out = []
    for file in sorted((root / operator).glob(f"*/*/udp_{kind}_*.csv")):
        with file.open(encoding="utf-8") as lines:
            values = [number(row.get("throughput_mbps")) for row in csv.DictReader(lines)]
        values = [v for v in values if v is not None]
        if len(values) * RATE_STEP_S >= LEAST_S:
            out.append((begun(file), values))
    return out


def pings(root, operator):
    """Each measurement as (begin, round trips in ms by step or None, the share without an answer)."""
    out = []
    for file in sorted((root / operator).glob("*/*/ping_*.csv")):
        with file.open(encoding="utf-8") as lines:
            rows = [(instant(row["time"]), number(row["rtt_ms"])) for row in csv.DictReader(lines)]
        rows = [(t, v) for t, v in rows if t is not None and v is not None]
        if len(rows) < 20:
            continue
        steps = {}
        for t, v in rows:
            steps.setdefault(int((t - rows[0][0]) / RTT_STEP_S), v)
        summary = re.search(r"([\d.]+)% packet loss", file.with_suffix(".out").read_text(encoding="utf-8"))
        lost = float(summary.group(1)) / 100 if summary else 0.0
        out.append((begun(file), [steps.get(i) for i in range(max(steps) + 1)], lost))
    return out


def nearest(runs, at):
    best = min(runs, key=lambda run: abs(run[0] - at), default=None)
    return best if best and abs(best[0] - at) < ROUND_S else None


def common(a, b):
    """The part of both that is of the same time."""
    begin = max(a[0], b[0])
    cut = [values[round((begin - start) / RATE_STEP_S):] for start, values in (a, b)]
    length = min(len(values) for values in cut)
    return [values[:length] for values in cut]


def opportunities(values):
    """Mahimahi's format; the last line is the length of the trace."""
    out = []
    bits = 0.0
    for ms in range(int(len(values) * RATE_STEP_S * 1000)):
        bits += min(values[int(ms / 1000 / RATE_STEP_S)], LIMIT_MBIT) * 1000
        while bits >= OPPORTUNITY_BITS:
            bits -= OPPORTUNITY_BITS
            out.append(ms + 1)
    end = int(len(values) * RATE_STEP_S * 1000)
    return out if out and out[-1] == end else out + [end]


def profile(name, about, ping, up, down):
    rtt = [v for v in ping[1] if v is not None]
    # Which way a request without an answer was lost nobody knows: as much of it each way.
    loss = 1 - (1 - ping[2]) ** 0.5
    text = (f"# Source: {SOURCE}, {about}\nschema = 1\nname = \"pair-{name}\"\ndescription = \"{about}\"\n"
            f"model = \"delay-trace\"\nrtt_trace = \"{name}.rtt\"\nloss = {round(loss, 4)}\n")
    for direction, values in (("up", up), ("down", down)):
        mean = statistics.fmean(values)
        steps = ", ".join(f"[{i * RATE_STEP_S}, {round(v, 3)}]" for i, v in enumerate(values))
        text += (f"\n[{direction}]\nrate_steps = [{steps}]\nrate_period_s = {len(values) * RATE_STEP_S}\n"
                 f"queue_kbyte = {max(20, round(mean * 1e3 * 0.3 / 8))}\n")
    trace, last = [], rtt[0]
    for value in ping[1]:
        last = last if value is None else value
        trace.append(last)
    return text, f"# Source: {SOURCE}, {about}\n# step_s = {RTT_STEP_S}\n" + "".join(f"{v}\n" for v in trace)


def main():
    if len(sys.argv) != 3 or sys.argv[1].startswith("-"):
        print(__doc__)
        return 2
    root, out = pathlib.Path(sys.argv[1]) / DATA, pathlib.Path(sys.argv[2])
    if not root.is_dir():
        print(f"measured_pairs: {root} is no folder; see the top of this file", file=sys.stderr)
        return 1
    out.mkdir(parents=True, exist_ok=True)
    runs = {o: {k: rates(root, o, k) for k in ("uplink", "downlink")} | {"ping": pings(root, o)} for o in OPERATORS}
    index, slow, count = [], [], 0
    for a, b in itertools.combinations(OPERATORS, 2):
        for one in runs[a]["uplink"]:
            kinds = []
            for kind in ("uplink", "downlink"):
                mine = nearest(runs[a][kind], one[0])
                theirs = mine and nearest(runs[b][kind], mine[0])
                kinds.append(common(mine, theirs) if theirs else [[], []])
            ping = [nearest(runs[o]["ping"], one[0]) for o in (a, b)]
            length = min(len(values) for kind in kinds for values in kind)
            if length * RATE_STEP_S < LEAST_S or None in ping:
                continue
            means = [statistics.fmean(values[:length]) for kind in kinds for values in kind]
            if min(means) < LEAST_MBIT:
                continue
            count += 1
            arguments = []
            for i, operator in enumerate((a, b)):
                name = f"{count}-{i + 1}"
                up, down = kinds[0][i][:length], kinds[1][i][:length]
                about = f"{operator}, {datetime.fromtimestamp(one[0]):%Y-%m-%d %H:%M}"
                toml, rtt = profile(name, about, ping[i], up, down)
                (out / f"{name}.toml").write_text(toml, encoding="utf-8")
                (out / f"{name}.rtt").write_text(rtt, encoding="utf-8")
                for end, values in (("up", up), ("down", down)) if min(means[:2]) <= SLOW_MBIT else ():
                    trace = "".join(f"{t}\n" for t in opportunities(values))
                    (out / f"{name}.{end}").write_text(trace, encoding="utf-8")
                median = statistics.median(v for v in ping[i][1] if v is not None)
                arguments.append(f"{out / name}.up,{out / name}.down,{median:g}")
            if min(means[:2]) <= SLOW_MBIT:
                slow.append(" ".join(arguments) + "\n")
            index.append(f"{count}: {a} + {b}, {length * RATE_STEP_S:g} s, Mbit/s up {means[0]:.1f} + {means[1]:.1f}, "
                         f"down {means[2]:.1f} + {means[3]:.1f}\n")
    (out / "index.txt").write_text("".join(index), encoding="utf-8")
    (out / "slow.txt").write_text("".join(slow), encoding="utf-8")
    print(f"{count} pairs written to {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
