#!/usr/bin/env python3
"""STAMP of RFC 8762, unauthenticated mode, written from the RFC alone: what our reflector and sender are checked against.

    stamp_rfc8762.py send HOST PORT COUNT {stateful|stateless}      exit code 0: every answer is as RFC 8762 §4.3 says
    stamp_rfc8762.py reflect PORT {stateful|stateless} DROP_EVERY   answers until it is ended, "ready" on stdout; loses
                                                                    each DROP_EVERY-th answer (0: none)
"""

import socket
import struct
import sys
import time

# RFC 8762 §4.2.1: Sequence Number, Timestamp, Error Estimate, MBZ (30 octets).
REQUEST = struct.Struct(">IIIH30s")
# RFC 8762 §4.3.1: Sequence Number, Timestamp, Error Estimate, MBZ, Receive Timestamp, Session-Sender Sequence Number,
# Session-Sender Timestamp, Session-Sender Error Estimate, MBZ, Ses-Sender TTL, MBZ (3 octets).
REPLY = struct.Struct(">IIIH2sIIIIIH2sB3s")
assert REQUEST.size == 44 and REPLY.size == 44
NTP_TO_UNIX = 2208988800


def ntp_now():
    now = time.time_ns()
    return now // 10**9 + NTP_TO_UNIX, ((now % 10**9) << 32) // 10**9


def seconds(whole, fraction):
    return whole - NTP_TO_UNIX + fraction / 2**32


def check(good, what, *values):
    if not good:
        print("expected:", what, *values)
        sys.exit(1)


def send(host, port, count, stateful):
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.settimeout(5)
    for number in range(count):
        # A number is left out, so that one who counts and one who repeats differ.
        sequence = number if number < count // 2 else number + 7
        beyond = bytes((number + i) % 256 for i in range(number % 3 * 20))
        whole, fraction = ntp_now()
        estimate = 0x8001 + number
        udp.sendto(REQUEST.pack(sequence, whole, fraction, estimate, bytes(30)) + beyond, (host, port))
        answer, peer = udp.recvfrom(65536)
        came = time.time()
        check(peer == (host, port), "the answer comes from where the request went", peer)
        check(len(answer) == 44 + len(beyond), "the answer has the request's size", len(answer))
        check(answer[44:] == beyond, "what is behind the base packet comes back as it was")
        (seq, whole3, fraction3, estimate3, mbz, whole2, fraction2, sender_seq, sender_whole, sender_fraction,
         sender_estimate, sender_mbz, ttl, mbz3) = REPLY.unpack(answer[:44])
        check(seq == (number if stateful else sequence), "the reflector's sequence number", seq)
        check(mbz == bytes(2) and sender_mbz == bytes(2) and mbz3 == bytes(3), "what must be zero is")
        check((sender_seq, sender_whole, sender_fraction, sender_estimate) == (sequence, whole, fraction, estimate),
              "the sender's fields come back as they were")
        check(estimate3 & 0xff != 0 and estimate3 & 0x4000 == 0, "an error estimate of an NTP clock", estimate3)
        check(ttl == 64, "the TTL that the request arrived with", ttl)
        sent, received, answered = seconds(whole, fraction), seconds(whole2, fraction2), seconds(whole3, fraction3)
        check(sent - 0.005 <= received <= answered <= came + 0.005, "t1 <= t2 <= t3 <= t4", sent, received, answered,
              came)
    # Too short, or without an error estimate (RFC 4656 §4.1.2): no answer.
    udp.settimeout(0.3)
    for wrong in (bytes(43), REQUEST.pack(0, 0, 0, 0x0100, bytes(30))):
        udp.sendto(wrong, (host, port))
        try:
            udp.recv(65536)
            check(False, "no answer to", wrong.hex())
        except socket.timeout:
            pass


def reflect(port, stateful, drop_every):
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", port))
    print("ready", udp.getsockname()[1], flush=True)
    sessions = {}
    answers = 0
    while True:
        request, peer = udp.recvfrom(65536)
        whole2, fraction2 = ntp_now()
        sequence, whole, fraction, estimate, mbz = REQUEST.unpack(request[:44])
        check(mbz == bytes(30) and estimate & 0xff != 0, "a test packet of RFC 8762 §4.2.1", request.hex())
        # A sender starts at zero (RFC 8762 §4.2.1).
        check(peer in sessions or sequence == 0, "the first sequence number", sequence)
        count = sessions[peer] = sessions.get(peer, -1) + 1
        whole3, fraction3 = ntp_now()
        answers += 1
        if drop_every and answers % drop_every == 0:
            continue
        udp.sendto(REPLY.pack(count if stateful else sequence, whole3, fraction3, 0x0101, bytes(2), whole2, fraction2,
                              sequence, whole, fraction, estimate, bytes(2), 64, bytes(3)) + request[44:], peer)


if __name__ == "__main__":
    if sys.argv[1] == "send":
        send(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5] == "stateful")
    else:
        reflect(int(sys.argv[2]), sys.argv[3] == "stateful", int(sys.argv[4]))
