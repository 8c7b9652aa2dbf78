#!/usr/bin/env python3
"""tshark with scripts/interneuron.lua shows what docs/wire_format.md says of its own examples. 77: tshark is missing."""

import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

SOURCE = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../.."))
SCRIPT = os.path.join(SOURCE, "scripts", "interneuron.lua")
PORT = 47000
OTHER_PORT = 50123


def examples():
    """The code blocks of bytes, in the document's order: data, plain, repair symbol, feedback, probe, echo request, echo reply, window, challenge, token; then
    initiation, cookie, response, sealed data."""
    blocks, inside = [], False
    with open(os.path.join(SOURCE, "docs", "wire_format.md"), encoding="utf-8") as document:
        for line in document:
            match = re.fullmatch(r"    ((?:[0-9a-f]{2} )*[0-9a-f]{2})(?:    .*)?\n", line)
            if not match:
                inside = False
                continue
            if not inside:
                blocks.append(b"")
            inside = True
            blocks[-1] += bytes.fromhex(match.group(1))
    return blocks


def capture(payloads, port):
    """A pcap (LINKTYPE_RAW) with one UDP packet per payload."""
    out = struct.pack("<IHHiIII", 0xa1b2c3d4, 2, 4, 0, 0, 65535, 101)
    for i, payload in enumerate(payloads):
        udp = struct.pack(">HHHH", 50001, port, 8 + len(payload), 0) + payload
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), i, 0, 64, 17, 0, bytes([10, 0, 0, 1]),
                         bytes([10, 0, 0, 2]))
        out += struct.pack("<IIII", i, 0, len(ip + udp), len(ip + udp)) + ip + udp
    return out


def dissect(payloads, fields, port=PORT, options=()):
    """For each packet the values of `fields`, as text; "" where a field is not there."""
    with tempfile.NamedTemporaryFile(suffix=".pcap") as file:
        file.write(capture(payloads, port))
        file.flush()
        command = ["tshark", "-X", "lua_script:" + SCRIPT, "-r", file.name, "-T", "fields", "-E", "separator=|",
                   "-E", "occurrence=a", *options]
        for name in fields:
            command += ["-e", name]
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
        if ran.returncode != 0 or "Lua" in ran.stderr:
            raise AssertionError(ran.stderr)
        return [dict(zip(fields, line.split("|"))) for line in ran.stdout.splitlines()]


class Dissector(unittest.TestCase):
    maxDiff = None

    def expect(self, payload, expected, **more):
        expected = {"interneuron." + name: value for name, value in expected.items()}
        self.assertEqual(dissect([payload], list(expected), **more), [expected])

    def test_data_with_its_round_header(self):
        self.expect(examples()[0], {
            "version": "3", "type": "1", "link": "2", "epoch": "0", "session": "0x5eed0001", "number": "7",
            "stamp_us": "1234567890", "message": "9", "size": "103", "kind": "0",
            "index": "0", "count": "1", "chunk": "1347", "lifetime_us": "130000", "payload": "6672616d65",
            "round.version": "3", "round.degraded": "0", "round.class": "0", "round.pipeline": "1",
            "round.stage": "1", "round.stages": "3", "round.communication": "0x0005", "round.variant": "1",
            "round.best_planned": "0", "round.x": "123", "round.need.delay": "255", "round.need.bandwidth": "64",
            "round.need.reliability": "128", "round.need.security": "0", "round.origin": "0x5eed0001",
            "round.number": "42", "round.policy": "0xcd5bd4bf", "round.deadline_us": "130000",
            "round.period_us": "100000", "round.indicator": "0x00000064", "round.t0": "1234567890123",
            "round.alpha": "0", "round.guard": "1", "round.level_used": "2", "round.variant_used": "1",
            "round.local_quality": "35", "round.miss_price": "1000", "round.excess": "-1380",
            "round.computed": "5670", "malformed": ""})

    def test_a_later_piece_has_no_round_header(self):
        data = bytearray(examples()[0])
        data[24:32] = struct.pack(">IHH", 206, 103, 1)
        self.expect(bytes(data), {"index": "1", "count": "2", "round.number": "", "malformed": ""})

    def test_plain_message(self):
        self.expect(examples()[1], {
            "type": "1", "message": "10", "size": "25", "kind": "1", "plain.id": "5", "plain.deadline_us": "100000",
            "plain.t0": "1234567890123", "plain.channel": "7", "plain.importance": "200", "plain.variant": "1",
            "plain.newest_only": "1", "plain.awaits_better": "0", "payload": "68656c6c6f", "round.version": "", "malformed": ""})

    def test_plain_message_with_needs_and_order(self):
        data = bytearray(examples()[1])
        data[56] |= 0x60
        data[57:57] = bytes.fromhex("ff00400080") + struct.pack(">HI", 3, 40000)
        data[24:28] = struct.pack(">I", 36)
        self.expect(bytes(data), {
            "plain.variant": "1", "plain.needs": "ff00400080", "plain.back": "3", "plain.wait_us": "40000",
            "payload": "68656c6c6f", "malformed": ""})

    def test_repair_symbol(self):
        self.expect(examples()[2], {
            "type": "1", "index": "3", "count": "3", "repair.block": "0", "repair.row": "0",
            "repair.symbol": "00c786794c94aefb", "payload": "", "malformed": ""})

    def test_window_symbol(self):
        self.expect(examples()[7], {
            "type": "6", "number": "10", "window.row": "1", "window.messages": "2", "window.message": "10,11",
            "window.pieces": "0x01,0x06", "window.symbol": examples()[7][29:-16].hex(), "malformed": ""})

    def test_challenge_and_token(self):
        token = "00112233445566778899aabbccddeeff"
        self.expect(examples()[8], {
            "type": "7", "number": "300", "echo_session": "0x5eed0001", "token": token, "malformed": ""})
        self.expect(examples()[9], {"type": "8", "number": "303", "token": token, "malformed": ""})

    def test_types_that_are_not_used(self):
        probe = examples()[4]
        self.expect(b"\x35" + probe[1:], {"type": "5", "number": "301", "body": "00" * 8, "handshake.proof": "", "malformed": ""})
        self.expect(b"\x3f" + probe[1:], {"type": "15", "malformed": ""})

    def test_handshake(self):
        initiation, cookie, response = examples()[10:13]
        head = {"version": "3", "epoch": "0", "link": "2", "session": "0xa1a1a1a1", "number": "1", "stamp_us": "", "tag": "", "body": "",
                "malformed": ""}
        self.expect(initiation, {
            **head, "type": "5", "handshake.ephemeral": initiation[20:52].hex(), "handshake.static": initiation[52:100].hex(),
            "handshake.hello": initiation[100:141].hex(), "handshake.proof": initiation[141:157].hex(),
            "handshake.mac1": initiation[157:173].hex(), "handshake.mac2": "00" * 16, "handshake.has_cookie": "0"})
        self.expect(initiation[:-16] + b"\x01" * 16, {**head, "type": "5", "handshake.has_cookie": "1"})
        with_credential = initiation[:100] + bytes(170) + initiation[141:]
        self.expect(with_credential, {**head, "type": "5", "handshake.hello": "00" * 170, "handshake.proof": initiation[141:157].hex()})
        self.expect(cookie, {**head, "type": "10", "handshake.nonce": "06" * 24, "handshake.cookie": cookie[44:].hex()})
        self.expect(response, {
            **head, "type": "9", "handshake.ephemeral": response[20:52].hex(), "handshake.hello": response[52:93].hex(),
            "token": "00112233445566778899aabbccddeeff", "handshake.proof": response[109:].hex()})

    def test_sealed_packets_show_what_is_not_encrypted(self):
        sealed = examples()[13]
        expected = {
            "version": "3", "type": "1", "epoch": "1", "link": "2", "session": "0xb2b2b2b2", "number": "8",
            "sealed": sealed[16:-16].hex(), "sealed_bytes": "42", "tag": sealed[-16:].hex(), "stamp_us": "", "message": "", "malformed": ""}
        self.expect(sealed, expected)
        self.expect(sealed, expected, port=OTHER_PORT)
        # Of any type, and of any size that a packet may have.
        self.expect(bytes([0x39]) + sealed[1:], {**expected, "type": "9"})
        self.expect(sealed[:20] + sealed[-16:], {"type": "1", "sealed": sealed[16:20].hex(), "sealed_bytes": "0", "malformed": ""})
        self.expect(sealed + bytes(1400 - len(sealed)), {"type": "1", "malformed": ""})
        malformed = dissect([sealed + bytes(1401 - len(sealed))], ["interneuron.malformed"])
        self.assertNotEqual(malformed[0]["interneuron.malformed"], "")
        # On any port a number that nobody reaches is taken for somebody else's bytes.
        far = sealed[:8] + b"\xff" + sealed[9:]
        self.expect(far, {"type": "1"})
        self.expect(far, {"type": ""}, port=OTHER_PORT)

    def test_feedback_with_its_report(self):
        self.expect(examples()[3], {
            "type": "2", "link": "1", "number": "300", "u": "1234600000000", "echo_session": "0xcafe0002",
            "reports": "1", "report.link": "2", "report.has_exchange": "1", "report.train_packets": "31",
            "report.s": "987654321", "report.h": "5000000", "report.largest": "100", "report.missing": "1",
            "report.train_start": "69", "report.train_rate": "30000", "report.metered": "0", "report.has_delays": "1",
            "report.newest_delay_us": "5372842", "report.largest_delay_us": "5374218", "report.ect0": "1", "report.ect1": "90",
            "report.ce": "3", "report.received_bytes": "123456", "complete.message": "9,10",
            "complete.ago_us": "1500,200", "complete.dropped": "0,1", "refused.message": "8", "malformed": ""})

    def test_every_report_is_shown(self):
        feedback = examples()[3]
        report = feedback[37:37 + 107]
        second = b"\x01\x07" + report[2:]
        both = feedback[:34] + bytes([2, 0, 0]) + report + second + feedback[-16:]
        self.expect(both, {"reports": "2", "report.link": "2,263", "malformed": ""})

    def test_probe(self):
        self.expect(examples()[4], {"type": "3", "link": "1", "number": "301", "padding": "00" * 8, "malformed": ""})
        smallest = examples()[4][:20] + bytes(16)
        self.expect(smallest, {"type": "3", "padding": "", "malformed": ""})

    def test_no_packet_is_longer_than_the_largest_that_is_sent(self):
        probe = examples()[4]
        self.expect(probe + bytes(1400 - len(probe)), {"type": "3", "malformed": ""})
        malformed = dissect([probe + bytes(1401 - len(probe))], ["interneuron.malformed"])
        self.assertNotEqual(malformed[0]["interneuron.malformed"], "")

    def test_echo_request(self):
        self.expect(examples()[5], {
            "type": "4", "echo.reply": "0", "echo.hold": "1", "echo.delay": "0", "echo.train": "3", "echo.index": "4",
            "echo.count": "18", "stamp.sequence": "21", "stamp.timestamp": "3909091328.500000000",
            "stamp.error": "0x1601", "stamp.received": "", "malformed": ""})

    def test_echo_reply(self):
        self.expect(examples()[6], {
            "type": "4", "session": "0xcafe0002", "echo.reply": "1", "echo.hold": "1", "stamp.sequence": "20",
            "stamp.timestamp": "3909091328.503906250", "stamp.received": "3909091328.501953125",
            "stamp.request_sequence": "21", "stamp.request_timestamp": "3909091328.500000000",
            "stamp.request_error": "0x1601", "stamp.request_ttl": "0", "malformed": ""})

    def test_echo_with_a_delay(self):
        request = examples()[5]
        delayed = request[:20] + bytes([0, 240, 0, 0, 0, 0, 0, 0]) + request[28:]
        self.expect(delayed, {"type": "4", "echo.delay": "240", "echo.train": "0", "malformed": ""})

    def test_other_ports_by_their_looks_or_by_preference(self):
        self.expect(examples()[4], {"type": "3"}, port=OTHER_PORT)
        off = ("-o", "interneuron.heuristic:FALSE")
        self.expect(examples()[4], {"type": ""}, port=OTHER_PORT, options=off)
        self.expect(examples()[4], {"type": "3"}, port=OTHER_PORT,
                    options=(*off, "-o", f"interneuron.port:{OTHER_PORT}"))

    def test_what_is_not_ours_is_left_alone(self):
        probe = bytearray(examples()[4])
        for at, value in ((0, 0x03), (0, 0x30), (0, 0x23), (1, 2), (len(probe) - 1, 1)):
            other = bytearray(probe)
            other[at] = value
            self.expect(bytes(other), {"type": ""})
        self.expect(bytes(35), {"type": ""})
        for packet in examples()[10:13]:
            if packet[-16:] != bytes(16):
                self.expect(packet[:-1], {"type": ""})

    def test_malformed_bodies_are_marked(self):
        data, plain, repair, feedback, _, request, _, window = examples()[:8]
        for broken in (data[:24] + struct.pack(">I", 106) + data[28:],      # a byte too few
                       plain[:36] + b"\x02" + plain[37:],                   # no such kind
                       repair[:30] + struct.pack(">H", 58) + repair[32:],   # a row that no block has
                       feedback[:34] + b"\x02" + feedback[35:],             # one report too few
                       feedback[:28] + feedback[-16:],
                       window[:20] + b"\x37" + window[21:],                 # a row that no window has
                       window[:27] + b"\x00" + window[28:],                 # the same message twice
                       window[:36] + window[-16:],
                       request[:64] + request[-16:]):
            rows = dissect([broken], ["interneuron.type", "_ws.expert.message"])
            self.assertIn("docs/wire_format.md", rows[0]["_ws.expert.message"])

    def test_fields_can_be_filtered_by(self):
        rows = dissect(examples(), ["interneuron.number"],
                       options=("-Y", "interneuron.echo.reply == 1 or interneuron.report.largest > 99"))
        self.assertEqual([row["interneuron.number"] for row in rows], ["300", "21"])


if __name__ == "__main__":
    if shutil.which("tshark") is None:
        print("tshark is missing")
        sys.exit(77)
    unittest.main()
