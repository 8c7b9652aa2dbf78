#!/usr/bin/env python3
"""What one hostile vehicle, or a host beside the road, can do to the honest ones: real processes in namespaces.

    tests/netns/insider_acceptance.py --program build/release/interneuron [--attacker FILE] [--smoke | --lowest]
        [--insecure] [--data DIR] [--seconds S] [--seed N] [--json FILE] [ATTACK...]

A roadside unit serves two honest vehicles, one on a busy and one on an empty street, and in a third place somebody
attacks. ATTACK is one of those of `attacker insider`, or join_flood, amplification, reflectors, or mixed, in which nobody
attacks and the answers are compared with what the vehicles see; all of them by default. One line per figure with its
bound; exit code 1 if one is out of it, 77 where no namespaces can be made or the machine was too slow to tell.

All hosts have keys, and the attacker has one that the unit trusts: what it forges is sealed. Whoever floods knows no
more than the unit's public key, and asks for handshakes. --insecure: everything in the clear.

Each attack of an admitted vehicle (at most 1 Mbit/s) and each flood is paired with the same run without it. Bounds: no
vehicle misses 1 % of its rounds more; the unit's memory grows by 64 MiB at most (10 in a flood of joins), its loop
never stands still for more than 20 ms; the vehicle on the empty street is never told of a walker; the median level is
0.97 of what it is with a third honest vehicle. A new vehicle joins within 2 s during a flood. Nobody gets more than 3
times the bytes that were sent in its name, and two reflectors do not talk to each other.

--smoke: all in one run, of 2 s an attack, in which one missed round is 5 %, so that up to three are allowed; an attack is
compared with the calm seconds before and after it; the unit computes at its lowest level, so that it says nothing of levels;
a minute. What a busy machine did not let it tell is tried again, twice.

A figure out of its bound counts only where the programs did not wait long for a processor meanwhile (insider_lab.MOST_WAIT).
"""

import argparse
import concurrent.futures
import contextlib
import json
import os
import sys
import tempfile
import time

# The folder of the tests stays as it is.
sys.dont_write_bytecode = True

import insider_forged as forged
import insider_lab as lab_
from insider_lab import PORT, Lab, Road, Vehicle, check, note
from lab_keys import Keys, life_in, session_in
from streets import FRAME_WITHOUT_WALKERS, make_streets

INSIDER = ("progressive_bomb", "job_flood", "tiny_images", "contexts", "foreign_origin", "big_claims", "indicator",
           "last_numbers", "unknown_types")
OTHERS = ("mixed", "join_flood", "amplification", "reflectors")
# What an admitted attacker sends at most, kbit/s of IP packets.
KBIT = 1000
# Where honest vehicles miss more than this without any attacker, per cent, nothing can be said about 1 %.
MOST_MISSES_ALONE = 5
# What `attacker flood` sends from foreign addresses, packets per second.
FLOOD_PPS = 50_000
# For how long a new vehicle tries to join in a flood; the bound is 2 s.
JOIN_PATIENCE_S = 3
# Those that join in a flood, each with a key of its own.
NEW_VEHICLES = 20
# Whom the unit trusts.
TRUSTED = ("busy", "empty", "third", "insider", *(f"new{i}" for i in range(NEW_VEHICLES)))
ROAD = "10.78.0.1"
NEARBY = {"busy": "10.78.0.11", "empty": "10.78.0.12", "third": "10.78.0.13", "fourth": "10.78.0.14"}


class Street:
    """The unit and two honest vehicles at one switch, with two more places at it, for as long as there are phases."""

    def __init__(self, options, folder, lowest=False):
        self.o = options
        self.road_options = ["--top-level", "0"] if lowest or options.lowest else []
        self.lab = Lab(folder)
        self.keys = Keys(folder, options.program, options.insecure)
        self.road = None
        self.vehicles = {}

    def __enter__(self):
        try:
            self._build()
        except BaseException:
            self.lab.__exit__()
            raise
        return self

    def _build(self):
        lab = self.lab
        lab.place("road")
        lab.place("switch")
        lab.ip("-n", "switch", "link", "add", "switch", "type", "bridge")
        lab.ip("-n", "switch", "link", "set", "switch", "up")
        lab.cable("road", "eth0", f"{ROAD}/16", "switch", "road")
        for place, address in NEARBY.items():
            lab.place(place)
            lab.cable(place, "eth0", f"{address}/16", "switch", place)
        # The networks in whose name the third place floods, of which it owns the first, and a sink.
        for net in ("10.98.0.0/16", "10.99.0.0/16"):
            lab.ip("-n", "road", "route", "add", net, "via", NEARBY["third"])
        lab.ip("-n", "third", "route", "add", "local", "10.98.0.0/16", "dev", "lo")
        lab.ip("-n", "third", "route", "add", "10.96.0.1", "via", ROAD)
        # With keys each new vehicle is a peer of its own, which stays for as long as nobody knows that it is gone.
        self.road = Road(lab, self.o.program, "road", ["eth0"],
                         ["--max-peers", str(2 * len(TRUSTED)), "--ladder", "motion", "--calibration-runs", "1", "--video",
                           self.o.streets["empty" if self.o.smoke else "busy"],
                          *self.keys.road(TRUSTED), *self.road_options, *self.o.road_option])
        self.asked = os.path.join(lab.folder, "initiations.pcap")
        watcher = lab.start("road", ["tcpdump", "-Z", "root", "-i", "eth0", "-U", "-w", self.asked,
                                     f"src host {NEARBY['busy']} and udp[8] = 0x35"],
                            stdout=lab_.subprocess.DEVNULL, stderr=lab_.subprocess.PIPE)
        watcher.stderr.readline()
        for place in ("busy", "empty"):
            self.vehicles[place] = self.vehicle(place, self.o.streets[place])
        for vehicle in self.vehicles.values():
            vehicle.wait_until_it_runs()
        time.sleep(1)
        lab.stop(watcher)
        watcher.stderr.close()

    def vehicle(self, place, video):
        truth = ["--truth", self.o.truth if self.o.truth and place == "busy" else "none"]
        return Vehicle(self.lab, self.o.program, place, "eth0", f"{ROAD}:{PORT}", video,
                       [*truth, *self.keys.vehicle(place)])

    def __exit__(self, *_):
        self.lab.__exit__()

    @contextlib.contextmanager
    def phase(self):
        """Yields [begin, end], of which the end is known afterwards."""
        span = [time.monotonic(), None]
        yield span
        span[1] = time.monotonic()

    def start_attacker(self, *command):
        # Another session each time: one that is known already would be the same peer that goes on.
        self.o.seed += 1
        return self.lab.start("third", [self.o.attacker, *command, "--seed", str(self.o.seed)], log="attacker.log",
                              stdout=lab_.subprocess.PIPE)

    def attack(self, *command):
        """Runs the attacker in the third place; (span, what it tells)."""
        with self.phase() as span:
            process = self.start_attacker(*command)
            told = process.stdout.read()
            self.lab.stop(process)
        if not told:
            raise SystemExit(f"the attacker ended: {self.lab.log_of('attacker.log')}")
        return span, json.loads(told)

    def insider(self, name, seconds):
        if self.keys.insecure:
            session = session_in(self.lab, "road", "eth0", NEARBY["busy"])
        else:
            session = life_in(self.asked, self.keys.secret("road"))
        return self.attack("insider", "--nic", "eth0", "--road", f"{ROAD}:{PORT}", "--attack", name, "--seconds",
                           str(seconds), "--kbit", str(0.98 * KBIT), "--victim-session", str(session),
                           *self.keys.attacker("insider"))

    def calm(self, seconds):
        with self.phase() as span:
            time.sleep(seconds)
        return span

    def waited(self, *span):
        return lab_.waited([self.road, *self.vehicles.values()], *span)

    def with_third(self, seconds):
        vehicle = self.vehicle("third", self.o.streets["busy"])
        vehicle.wait_until_it_runs()
        span = self.calm(seconds)
        vehicle.stop()
        return span

    def finish(self):
        """The vehicles' rounds are known from here on."""
        if not self.road.alive():
            check("the roadside unit still runs", 0, 1, "", at_least=True)
        for vehicle in self.vehicles.values():
            vehicle.stop()
        self.road.stop()


def judge_rounds(name, allowed, street, span, calm_street, calms):
    """Against the same vehicle in calm times, of which that after an attack must be as calm as that before it."""
    waited = max(street.waited(*span), *(calm_street.waited(*calm) for calm in calms))
    for place, vehicle in street.vehicles.items():
        attacked = vehicle.between(*span)
        shares = [lab_.misses(calm_street.vehicles[place].between(*calm)) for calm in calms]
        alone = sum(shares) / len(shares)
        extra = lab_.misses(attacked) - alone
        if len(shares) > 1:
            check(f"{name}: more misses of the vehicle on the {place} street after it than before", shares[-1] - shares[0],
                  2 * allowed, "% of rounds", waited=waited)
        if alone > MOST_MISSES_ALONE:
            lab_.inconclusive(f"{name}: {alone:.1f} % misses of the vehicle on the {place} street without it, {extra:.1f} % "
                              "more with it: this machine is too slow or too busy; try --lowest")
            continue
        check(f"{name}: more misses of the vehicle on the {place} street (of {len(attacked)} rounds; {alone:.1f} % "
              f"without; {waited:.0f} % waited)", extra, allowed, "% of rounds", waited=waited)


def judge_road(name, street, span, memory):
    check(f"{name}: growth of the unit's memory", street.road.growth(*span), memory, "MiB")
    stall = street.road.stall(*span)
    if stall is None:
        note(f"{name}: loop_stall_ms is not published; skipped")
    else:
        check(f"{name}: the unit's loop stood still", stall, 20, "ms", waited=street.waited(*span))


def judge_insider(options, name, street, attack, calm_street, calms, third_street, third):
    span, told = attack
    allowed = options.allowed
    if not told["joined"]:
        check(f"{name}: the attacker was admitted", 0, 1, "", at_least=True)
    # It sends while it waits to be admitted, too.
    rate = 8 * told["sent_bytes"] / max(told["seconds"] + told["join_s"], 1) / 1000
    check(f"{name}: what the attacker sent ({told['sent_packets']} packets, {told['results']} came back)", rate, KBIT,
          "kbit/s")
    judge_rounds(name, allowed, street, span, calm_street, calms)
    judge_road(name, street, span, 64)
    judge_mixed(name, street, span)
    if not options.lowest:
        judge_levels(name, street, span, third_street, third)


def judge_levels(name, street, span, third_street, third):
    for place, vehicle in street.vehicles.items():
        honest = lab_.median_level(third_street.vehicles[place].between(*third))
        check(f"{name}: median level on the {place} street ({honest:g} with a third vehicle)",
              lab_.median_level(vehicle.between(*span)), 0.97 * honest, "", at_least=True)


def judge_mixed(name, street, span):
    """An empty street has no walkers, whatever others see. Only the lowest level looks at nothing but what moves: at the
    others a result of another's may still be empty."""
    walkers = [int(row["boxes"]) > 0 for row in street.vehicles["empty"].between(*span) if row["outcome"] == "remote"]
    check(f"{name}: results with walkers for the empty street, of {len(walkers)}", sum(walkers), 0, "results")


def judge_accuracy(name, street, third_street):
    """Of all that the vehicle on the busy street was shown in its run."""
    ap, honest = (s.vehicles["busy"].summary["ap"] for s in (street, third_street))
    check(f"{name}: AP on the busy street ({honest:.3f} with a third vehicle)", ap, 0.97 * honest, "", at_least=True)


# --- the attacks of an admitted vehicle


def insiders(options, attacks):
    """Two runs for each attack, without it and with it, and one with a third honest vehicle."""
    def run(action):
        with tempfile.TemporaryDirectory() as folder, Street(options, folder) as street:
            result = action(street)
            street.finish()
            return street, result

    third_street, third = run(lambda street: street.with_third(options.seconds))
    for name in attacks:
        calm_street, calm = run(lambda street: street.calm(options.seconds))
        street, attack = run(lambda street, name=name: street.insider(name, options.seconds))
        judge_insider(options, name, street, attack, calm_street, [calm], third_street, third)
        if options.truth:
            judge_accuracy(name, street, third_street)


def smoke(options, attacks):
    """All in one run, so that what one attack leaves behind is there for the next. Calm seconds lie between them, so that load
    that comes and goes is not taken for an attack."""
    with tempfile.TemporaryDirectory() as folder, Street(options, folder, lowest=True) as street:
        third = street.with_third(options.seconds)
        calms = [street.calm(options.seconds / 2)]
        done = {}
        for name in INSIDER:
            if name in attacks:
                done[name] = street.insider(name, options.seconds)
                calms.append(street.calm(options.seconds / 2))
        flood = flood_phases(street, options) if "join_flood" in attacks else None
        street.finish()
        if "mixed" in attacks:
            judge_both_streets(street, [third[0], calms[0][1]])
        for (name, attack), *around in zip(done.items(), calms, calms[1:]):
            judge_insider(options, name, street, attack, street, around, street, third)
        if flood:
            judge_flood(options, street, street, *flood)


# --- the answers


def mixed(options):
    with tempfile.TemporaryDirectory() as folder, Street(options, folder, lowest=True) as street:
        span = street.calm(options.seconds)
        street.finish()
        judge_both_streets(street, span)


def judge_both_streets(street, span):
    judge_mixed("mixed", street, span)
    nobody = [int(row["boxes"]) == 0 for row in street.vehicles["busy"].between(*span)
              if row["outcome"] == "remote" and int(row["frame"]) != FRAME_WITHOUT_WALKERS]
    check(f"mixed: results without walkers for the busy street, of {len(nobody)}", sum(nobody), 0, "results")


# --- the flood of joins


def flood_command(street, to, seconds):
    return ["flood", "--nic", "eth0", "--road", to, "--seconds", str(seconds), *street.keys.attacker()]


def flood_phases(street, options):
    """The flood into a sink, then at the unit, while new vehicles join in the fourth place."""
    calm, _ = street.attack(*flood_command(street, f"10.96.0.1:{PORT}", options.flooding))
    with street.phase() as span:
        process = street.start_attacker(*flood_command(street, f"{ROAD}:{PORT}", options.flooding))
        joins = []
        time.sleep(0.5)
        while process.poll() is None and len(joins) < NEW_VEHICLES:
            ran = street.lab.run("fourth", [options.attacker, "join", "--nic", "eth0", "--road", f"{ROAD}:{PORT}",
                                            "--seconds", str(JOIN_PATIENCE_S), *street.keys.attacker(f"new{len(joins)}")])
            joins.append(json.loads(ran.stdout) if ran.stdout else {"joined": False, "join_s": JOIN_PATIENCE_S})
            time.sleep(options.flooding / NEW_VEHICLES)
        told = process.stdout.read()
        street.lab.stop(process)
    if not told:
        raise SystemExit(f"the flood ended: {street.lab.log_of('attacker.log')}")
    return calm, span, json.loads(told), joins


def judge_flood(options, street, calm_street, calm, span, told, joins):
    note(f"join_flood: {told['spoofed_pps']} packets/s from foreign and {told['owned_pps']} from own addresses; "
         f"{told['tokens']} challenges or cookies and {told['echoes']} feedbacks answered")
    note("join_flood: the unit ran {:.0f} % of the time and waited {:.0f} % for a processor".format(
        *street.road.processor.share(*span)))
    check("join_flood: handshakes without a key that were answered", told["others"], 0, "packets")
    if told["spoofed_pps"] < 0.8 * FLOOD_PPS:
        tell = note if options.smoke else lab_.inconclusive
        tell("join_flood: this machine is too slow for the whole flood; what follows is of what it sent")
    judge_rounds("join_flood", options.allowed, street, span, calm_street, [calm])
    check("join_flood: growth of the unit's memory", street.road.growth(*span), 10, "MiB")
    failed = sum(not join["joined"] for join in joins)
    waited = street.waited(*span)
    check(f"join_flood: new vehicles that did not join at all, of {len(joins)}", failed, 0, "vehicles", waited=waited)
    check("join_flood: a new vehicle joined within", max((join["join_s"] for join in joins), default=99), 2, "s", waited=waited)


def join_flood(options):
    with tempfile.TemporaryDirectory() as folder, Street(options, folder) as street:
        phases = flood_phases(street, options)
        street.finish()
        judge_flood(options, street, street, *phases)


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--attacker", help="the generator of attacks (default: that of the program's build)")
    parser.add_argument("--smoke", action="store_true", help="a minute of it")
    parser.add_argument("--lowest", action="store_true", help="the unit computes at its lowest level, as in the smoke form: "
                        "for a busy machine")
    parser.add_argument("--insecure", action="store_true", help="everything in the clear")
    parser.add_argument("--seconds", type=float, default=None, help="of each attack (60; in the smoke form 2)")
    parser.add_argument("--seed", type=int, default=None, help="of what the attacker draws (default: another each time)")
    parser.add_argument("--road-option", action="append", default=[], help="one more word for the unit's command line")
    parser.add_argument("--data", help="a folder of scripts/fetch_data.sh: then the busy street is that of its video, and "
                        "the AP is judged too, but not in the smoke form")
    parser.add_argument("--json", help="also write the figures to this file")
    parser.add_argument("attacks", nargs="*", metavar="ATTACK", help=" ".join(INSIDER + OTHERS))
    options = parser.parse_args()
    for name in options.attacks:
        if name not in INSIDER + OTHERS:
            parser.error(f"'{name}' is no attack; give some of {' '.join(INSIDER + OTHERS)}")
    options.data = os.path.abspath(options.data) if options.data else None
    options.truth = os.path.join(options.data, "pets/gt.txt") if options.data else None
    if options.truth and not os.path.exists(options.truth):
        parser.error(f"'{options.truth}' is missing: run scripts/fetch_data.sh, or leave --data away")
    lab_.find_programs(parser, options)
    if options.seed is None:
        options.seed = int.from_bytes(os.urandom(3), "big")
    options.seconds = options.seconds or (2 if options.smoke else 60)
    # Per cent of the rounds; where there are few, three of them.
    options.allowed = max(1, 100 * 3.5 / (10 * options.seconds)) if options.smoke else 1
    options.lowest = options.lowest or options.smoke
    options.flooding = 4 if options.smoke else options.seconds
    options.forging = 5 if options.smoke else 120
    options.reflecting = 3 if options.smoke else 10
    return options


def main():
    confined = lab_.is_confined()
    options = parse()
    if not confined:
        lab_.confine()
    attacks = options.attacks or INSIDER + OTHERS
    print(f"seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        options.streets = dict(zip(("busy", "empty"), make_streets(folder)))
        if options.data:
            options.streets["busy"] = os.path.join(options.data, "pets/vtest.avi")
        if options.smoke:
            for attempt in range(lab_.ATTEMPTS):
                again = {*attacks} if attempt == 0 else {text.split(":")[0] for text in lab_.INCONCLUSIVE}
                lab_.INCONCLUSIVE.clear()
                if again & {*INSIDER, "mixed", "join_flood"}:
                    smoke(options, again)
        else:
            if set(attacks) & set(INSIDER):
                insiders(options, [name for name in attacks if name in INSIDER])
            for name, run in (("mixed", mixed), ("join_flood", join_flood)):
                if name in attacks:
                    run(options)
        with concurrent.futures.ThreadPoolExecutor() as pool:
            running = [pool.submit(run, options) for name, run in
                       (("amplification", forged.amplification), ("reflectors", forged.reflectors)) if name in attacks]
        for one in running:
            one.result()
    return lab_.finish(options.json, "interneuron.insider_acceptance/1")


if __name__ == "__main__":
    sys.exit(main())
