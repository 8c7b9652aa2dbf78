#!/usr/bin/env python3
"""A vehicle that does no more than join a road, with the handshake of tests/netns/sealed.py.

    sealed_vehicle.py ADDRESS PORT KEY_FILE ROAD_KEY

Prints how often the road has answered, and whether it has sent feedback that names this life: {"answered": 1, "admitted": 1}.
"""

import base64
import json
import os
import socket
import struct
import sys
import time

# The folder of the tests stays as it is.
sys.dont_write_bytecode = True

import sealed

PATIENCE_S = 1.5
RETRY_S = 0.2
PATH = 3
# The head of feedback: u, the other side's life, features, and how many reports and messages follow (docs/wire_format.md).
FEEDBACK = struct.Struct(">qIHBBB")


def feedback(echo):
    return FEEDBACK.pack(time.monotonic_ns(), echo, 0, 0, 0, 0)


def join(road, secret, road_key):
    life = int.from_bytes(os.urandom(4), "big") | 1
    asks = sealed.Asking(secret, road_key, os.urandom(32), life, life ^ 2, time.time_ns())
    keys, token, number, tries, told = None, None, 0, 0, {"answered": 0, "admitted": 0}
    end = time.monotonic() + PATIENCE_S
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.connect(road)
        wire.settimeout(RETRY_S)
        while time.monotonic() < end and not told["admitted"]:
            if keys is None:
                tries += 1
                wire.send(asks.copy(PATH, tries))
            else:
                number += 2
                wire.send(keys.seal(sealed.TOKEN, PATH, number - 1, 0, token))
                wire.send(keys.seal(sealed.FEEDBACK, PATH, number, 0, feedback(keys.life)))
            try:
                data = wire.recv(2048)
            except TimeoutError:
                continue
            kind, epoch, *_ = sealed.fields(data)
            if epoch == 0:
                told["answered"] += 1
                if kind == sealed.COOKIE:
                    asks.take_cookie(data)
                elif kind == sealed.RESPONSE and keys is None:
                    keys, token = asks.take_response(data)
                continue
            kind, _, _, _, body = keys.open(data)
            if kind == sealed.CHALLENGE:
                token = body[4:20]
            elif kind == sealed.FEEDBACK:
                told["admitted"] += FEEDBACK.unpack(body[:FEEDBACK.size])[1] == life
    return told


def main():
    address, port, key_file, road_key = sys.argv[1:]
    print(json.dumps(join((address, int(port)), sealed.read_key(key_file), base64.b64decode(road_key))))


if __name__ == "__main__":
    main()
