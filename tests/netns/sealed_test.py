#!/usr/bin/env python3
"""tests/netns/sealed.py against the handshake of docs/wire_format.md, byte for byte. 77: python3-cryptography is missing."""

import os
import re
import sys
import unittest

# The folder of the tests stays as it is.
sys.dont_write_bytecode = True

try:
    import sealed
except ImportError as missing:
    print(f"python3-cryptography is missing: {missing}")
    sys.exit(77)

DOCUMENT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../docs/wire_format.md")
INITIATOR, RESPONDER, OWN_EPHEMERAL, THEIR_EPHEMERAL, SHARED = (bytes([i]) * 32 for i in range(1, 6))
TOKEN = bytes.fromhex("00112233445566778899aabbccddeeff")
LIVES, INDICES = (0x5eed0001, 0xcafe0002), (0xa1a1a1a1, 0xb2b2b2b2)
BEGAN = 1_700_000_000 * 10**9
PATH = 2


def examples():
    """The blocks of bytes of the page, in its order, without what is said beside them."""
    found, inside = [], False
    with open(DOCUMENT, encoding="utf-8") as file:
        for line in file:
            match = re.fullmatch(r"    ((?:[0-9a-f]{2} )*[0-9a-f]{2})(?:    .*)?", line.rstrip("\n"))
            if match and not inside:
                found.append(b"")
            if match:
                found[-1] += bytes.fromhex(match[1])
            inside = match is not None
    return found


def named(key):
    """The value of a row of a table of keys."""
    with open(DOCUMENT, encoding="utf-8") as file:
        return bytes.fromhex(re.search(rf"^\| {re.escape(key)} \| `([0-9a-f]+)` \|$", file.read(), re.MULTILINE)[1])


def asking():
    return sealed.Asking(INITIATOR, sealed.public_of(RESPONDER), OWN_EPHEMERAL, LIVES[0], INDICES[0], BEGAN, SHARED, sealed.HAS_AES_GCM)


class Sealed(unittest.TestCase):
    def setUp(self):
        *_, plain, self.initiation, self.cookie, self.response, self.message, self.message_by_aes = examples()
        # The one of packet 8 is the second on the page.
        self.plain = examples()[1]
        self.assertEqual(len(plain), 52)

    def shake(self):
        keys, token = asking().take_response(self.response)
        self.assertEqual(token, TOKEN)
        return keys

    def test_public_keys(self):
        self.assertEqual(sealed.public_of(INITIATOR), named("the initiator's public key"))
        self.assertEqual(sealed.public_of(RESPONDER), named("the responder's public key"))

    def test_initiation(self):
        self.assertEqual(asking().copy(PATH, 1), self.initiation)

    def test_cookie(self):
        self.assertEqual(sealed.cookie_reply(self.initiation, sealed.public_of(RESPONDER), b"\6" * 24, TOKEN), self.cookie)
        asks = asking()
        asks.take_cookie(self.cookie)
        self.assertEqual(asks.cookies, {PATH: TOKEN})
        again = asks.copy(PATH, 1)
        self.assertEqual(again[:-16], self.initiation[:-16])
        self.assertEqual(again[-16:], sealed.mac(TOKEN + bytes(16), again[:-16]))

    def test_response(self):
        asked = sealed.Asked(RESPONDER, self.initiation, SHARED)
        self.assertEqual((asked.who, asked.life, asked.index, asked.unix_ns),
                         (sealed.public_of(INITIATOR), LIVES[0], INDICES[0], BEGAN))
        response, theirs = asked.answer(THEIR_EPHEMERAL, LIVES[1], INDICES[1], BEGAN + 20_000_000, TOKEN)
        self.assertEqual(response, self.response)
        ours = self.shake()
        self.assertEqual((ours.index, ours.life, theirs.index, theirs.life),
                         (INDICES[1], LIVES[1], INDICES[0], LIVES[0]))
        for keys in ((ours.sending, ours.receiving), (theirs.receiving, theirs.sending)):
            self.assertEqual(keys, (named("from the initiator, after Split()"), named("from the responder, after Split()")))

    def test_sealed_packet(self):
        kind, _, path, _, number, stamp = sealed.fields(self.plain)
        keys = self.shake()
        body = self.plain[20:-16]
        there = sealed.Keys(keys.receiving, keys.sending, keys.index, keys.life)
        for keys.is_aes, message in ((False, self.message), (True, self.message_by_aes)):
            there.is_aes = keys.is_aes
            self.assertEqual(keys.seal(kind, path, number, stamp, body), message)
            self.assertEqual(there.open(message), (kind, path, number, stamp, body))

    def test_nothing_may_be_changed(self):
        keys = self.shake()
        keys.sending, keys.receiving = keys.receiving, keys.sending
        # The session is what tells the keys.
        for at in (*range(4), *range(8, len(self.message))):
            with self.assertRaises(sealed.InvalidTag):
                keys.open(self.message[:at] + bytes([self.message[at] ^ 1]) + self.message[at + 1:])
        for at in range(20, len(self.response)):
            with self.assertRaises(sealed.InvalidTag):
                asking().take_response(self.response[:at] + bytes([self.response[at] ^ 1]) + self.response[at + 1:])


if __name__ == "__main__":
    unittest.main()
