"""What is sent in the name of others, for tests/netns/insider_acceptance.py. Both runs may go on at once: no place of the
one has the name of one of the other."""

import json
import os
import subprocess
import tempfile
import time

from insider_lab import PORT, Lab, Road, check
from lab_keys import Keys, ip_bytes_to

# The vehicles of whom the attacker has a key that the unit trusts.
VICTIMS = 12


def amplification(options):
    """The unit has 8 links to a router, where the attacker is; the victims are behind it."""
    links = range(8)
    with tempfile.TemporaryDirectory() as folder, Lab(folder) as lab:
        lab.place("road")
        lab.place("router", forwards=True)
        lab.place("victim")
        lab.cable("victim", "eth0", "10.97.0.254/16", "router", "victim", "10.97.255.254/16")
        lab.ip("-n", "victim", "route", "add", "default", "via", "10.97.255.254")
        victims = [f"10.97.0.{base + i}" for base in (1, 101) for i in range(8)]
        for address in victims:
            lab.ip("-n", "victim", "address", "add", f"{address}/32", "dev", "eth0")
        for i in links:
            lab.cable("road", f"eth{i}", f"10.78.{i}.1/24", "router", f"road{i}", f"10.78.{i}.2/24")
            lab.ip("-n", "road", "route", "add", "10.97.0.0/16", "via", f"10.78.{i}.2", "dev", f"eth{i}", "metric",
                   str(i + 1))
        keys = Keys(folder, options.program, options.insecure)
        names = [f"insider{i}" for i in range(VICTIMS)]
        Road(lab, options.program, "road", [f"eth{i}" for i in links], ["--ladder", "none", *keys.road(names)],
             watched=False)
        pcap = os.path.join(folder, "victim.pcap")
        tcpdump = lab.start("victim", ["tcpdump", "-Z", "root", "-i", "eth0", "-B", "8192", "-s", "64", "-w", pcap,
                                       "dst net 10.97.0.0/16 and not src net 10.97.0.0/16"],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(0.5)
        command = [options.attacker, "amplify", "--seconds", str(options.forging), "--seed", str(options.seed),
                   *keys.attacker(*names)]
        for i in links:
            command += ["--nic", f"road{i}", "--road", f"10.78.{i}.1:{PORT}"]
        ran = lab.run("router", command)
        if ran.returncode != 0:
            raise SystemExit(f"amplification: the attacker ended: {ran.stderr or 'not admitted'}")
        time.sleep(0.5)
        lab.stop(tcpdump)
        came = ip_bytes_to(pcap)
    for victim in json.loads(ran.stdout)["victims"]:
        bytes_, packets = came.get(victim["victim"], (0, 0))
        plural = "s" if victim["links"] > 1 else ""
        check(f"amplification: {victim['way']} over {victim['links']} link{plural} ({victim['sent_bytes']} bytes in the "
              f"victim's name, {packets} packets came)", bytes_ / max(victim["sent_bytes"], 1), 3, "times")


def reflectors(options):
    """Two reflectors on both sides of a router, which forges a request from each to the other."""
    with tempfile.TemporaryDirectory() as folder, Lab(folder) as lab:
        lab.place("middle", forwards=True)
        captures = []
        for i in (1, 2):
            lab.place(f"reflector{i}")
            lab.cable(f"reflector{i}", "eth0", f"10.79.{i}.1/24", "middle", f"r{i}", f"10.79.{i}.2/24")
            lab.ip("-n", f"reflector{i}", "route", "add", "default", "via", f"10.79.{i}.2")
            keys = Keys(os.path.join(folder, f"keys{i}"), options.program, options.insecure)
            Road(lab, options.program, f"reflector{i}", ["eth0"],
                 ["--ladder", "none", "--stamp", *keys.road(["nobody"])], watched=False)
            pcap = os.path.join(folder, f"{i}.pcap")
            captures.append((pcap, lab.start("middle", ["tcpdump", "-Z", "root", "-i", f"r{i}", "-Q", "in", "-c", "200000",
                                                        "-s", "64", "-w", pcap, "udp"],
                                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)))
        time.sleep(0.5)
        for one, other in ((1, 2), (2, 1)):
            ran = lab.run("middle", [options.attacker, "stamp", "--nic", f"r{other}", "--from", f"10.79.{one}.1:862",
                                     "--to", f"10.79.{other}.1:862"])
            if ran.returncode != 0:
                raise SystemExit(f"reflectors: the attacker ended: {ran.stderr}")
        time.sleep(options.reflecting)
        for _, process in captures:
            lab.stop(process)
        came = sum(packets for pcap, _ in captures for _, packets in ip_bytes_to(pcap).values())
    check(f"reflectors: packets in {options.reflecting:g} s after one forged request each way", came, 2, "packets")
