"""Keys of the hosts of tests/netns/insider_lab.py, and what captures of their packets tell."""

import base64
import contextlib
import os
import struct
import subprocess


class Keys:
    """The private keys of hosts in files, by the hosts' names, each made when it is asked for first. Without any the
    hosts talk in the clear."""

    def __init__(self, folder, program, insecure=False):
        self.folder, self.program, self.insecure = folder, program, insecure
        self.public = {}
        os.makedirs(folder, exist_ok=True)

    def of(self, name):
        """File and public key."""
        file = os.path.join(self.folder, f"{name}.key")
        if name not in self.public:
            made = subprocess.run([self.program, "keys", "gen", "--out", file], capture_output=True, text=True, check=False)
            if made.returncode != 0:
                raise SystemExit(f"no key: {made.stderr.strip()}")
            self.public[name] = made.stdout.strip()
        return file, self.public[name]

    def secret(self, name):
        with open(self.of(name)[0], encoding="ascii") as file:
            return base64.b64decode(file.read())

    def road(self, trusted):
        """Words for the command line of the unit."""
        if self.insecure:
            return ["--insecure"]
        return ["--key", self.of("road")[0], *(word for name in trusted for word in ("--trust", self.of(name)[1]))]

    def vehicle(self, name):
        if self.insecure:
            return ["--insecure"]
        return ["--key", self.of(name)[0], "--peer-key", self.of("road")[1]]

    def attacker(self, *names):
        """Of `attacker`, which may have several keys."""
        if self.insecure:
            return []
        return [*(word for name in names for word in ("--key", self.of(name)[0])), "--road-key", self.of("road")[1]]


def session_in(lab, place, nic, source):
    """The session that is named in the next packet from this address."""
    ran = subprocess.run(lab.inside(place, ["timeout", "5", "tcpdump", "-Z", "root", "-i", nic, "-c", "1", "-w", "-",
                                            f"udp and src host {source}"]), capture_output=True, check=False)
    # File header, record header, Ethernet, IP and UDP.
    at = 24 + 16 + 14 + 20 + 8 + 4
    if len(ran.stdout) < at + 4:
        raise SystemExit(f"nothing came from {source}")
    return struct.unpack(">I", ran.stdout[at:at + 4])[0]


def ip_bytes_to(pcap):
    """IP bytes and packets for each destination in a capture of Ethernet frames."""
    with open(pcap, "rb") as file:
        data = file.read()
    found = {}
    at = 24
    while at + 16 <= len(data):
        size = struct.unpack("=I", data[at + 8:at + 12])[0]
        frame = data[at + 16:at + 16 + size]
        at += 16 + size
        if len(frame) < 34 or frame[12:14] != b"\x08\x00":
            continue
        to = ".".join(str(byte) for byte in frame[30:34])
        bytes_, packets = found.get(to, (0, 0))
        found[to] = (bytes_ + struct.unpack(">H", frame[16:18])[0], packets + 1)
    return found


def life_in(pcap, secret):
    """The life that the newest initiation in a capture of Ethernet frames tells to the host with this key. Whoever has
    not got that key cannot know it; the test gives it away."""
    # Only where there are keys is what it needs.
    import sealed
    with open(pcap, "rb") as file:
        data = file.read()
    life, at = None, 24
    while at + 16 <= len(data):
        size = struct.unpack("=I", data[at + 8:at + 12])[0]
        with contextlib.suppress(sealed.InvalidTag):
            life = sealed.Asked(secret, data[at + 16:at + 16 + size][42:]).life
        at += 16 + size
    if life is None:
        raise SystemExit("nobody asked for a handshake")
    return life
