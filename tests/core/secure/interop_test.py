#!/usr/bin/env python3
"""Our handshake with an independent implementation as the other side: dissononce, which Debian ships.

    interop_test.py NOISE_PEER [--seed N]

NOISE_PEER is the program of noise_peer.cc. Every handshake is done both ways: ours asks and theirs is asked, and the
reverse. 77: python3-dissononce is missing.
"""

import argparse
import copy
import os
import random
import subprocess
import sys
import unittest

try:
    from dissononce.cipher.chachapoly import ChaChaPolyCipher
    from dissononce.dh.x25519.x25519 import PublicKey, X25519DH
    from dissononce.dh.x25519.private import PrivateKey
    from dissononce.exceptions.decrypt import DecryptFailedException
    from dissononce.hash.sha256 import SHA256Hash
    from dissononce.processing.handshakepatterns.interactive.IK import IKHandshakePattern
    from dissononce.processing.impl.cipherstate import CipherState
    from dissononce.processing.impl.handshakestate import HandshakeState
    from dissononce.processing.impl.symmetricstate import SymmetricState
    from dissononce.processing.modifiers.psk import PSKPatternModifier
except ImportError as missing:
    print(f"python3-dissononce is missing: {missing}")
    sys.exit(77)

KEY_BYTES = 32
NO_KEY = bytes(KEY_BYTES)
# None, one, what an initiation says, around a block of ChaCha20 (64 bytes) and of SHA-256, a whole packet.
PAYLOAD_BYTES = (0, 1, 16, 63, 64, 65, 1400)
# The first numbers, and ones that need more than 32 bits.
NUMBERS = (0, 1, 2**32, 2**40 + 7)

program = None
rng = None


class Keys:
    """What both sides of a handshake begin with."""

    def __init__(self, pattern, shared=NO_KEY):
        self.pattern = pattern
        self.prologue = rng.randbytes(rng.choice((0, 1, 40)))
        self.shared = shared
        self.initiator, self.responder = rng.randbytes(KEY_BYTES), rng.randbytes(KEY_BYTES)


def public_of(secret):
    return X25519DH().generate_keypair(PrivateKey(secret)).public.data


class Ours:
    """A side that crypto::Noise plays, in a process of its own."""

    def __init__(self, keys, is_initiator):
        self.process = subprocess.Popen(
            [program, keys.pattern, "initiator" if is_initiator else "responder", keys.prologue.hex(),
             (keys.initiator if is_initiator else keys.responder).hex(), rng.randbytes(KEY_BYTES).hex(),
             keys.shared.hex(), public_of(keys.responder).hex()],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def close(self):
        """Fails where the program did not end well."""
        self.process.stdin.close()
        self.process.stdout.close()
        if self.process.wait(timeout=60) != 0:
            raise AssertionError(f"noise_peer ended with {self.process.returncode}")

    def ask(self, *words):
        """The bytes of the answer; None where it is refused."""
        self.process.stdin.write(" ".join(word.hex() if isinstance(word, bytes) else str(word) for word in words) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer.endswith("\n"):
            raise AssertionError("noise_peer has ended")
        return None if answer == "refused\n" else bytes.fromhex(answer)

    def write(self, payload):
        return self.ask("write", payload)

    def read(self, message):
        return self.ask("read", message)

    def remote(self):
        return self.ask("remote")

    def hash(self):
        return self.ask("hash")

    def seal(self, number, associated, plain):
        return self.ask("seal", number, associated, plain)

    def open(self, number, associated, sealed):
        return self.ask("open", number, associated, sealed)


class SeededDH(X25519DH):
    """Draws its ephemeral keys from our seed."""

    def generate_keypair(self, privatekey=None):
        return super().generate_keypair(privatekey or PrivateKey(rng.randbytes(KEY_BYTES)))


class Theirs:
    """The same side as dissononce plays it."""

    def __init__(self, keys, is_initiator):
        self.is_initiator = is_initiator
        self.dh = SeededDH()
        self.state = HandshakeState(SymmetricState(CipherState(ChaChaPolyCipher()), SHA256Hash()), self.dh)
        pattern = IKHandshakePattern()
        if keys.pattern == "ikpsk2":
            pattern = PSKPatternModifier(2).modify(pattern)
        own = self.dh.generate_keypair(PrivateKey(keys.initiator if is_initiator else keys.responder))
        self.state.initialize(pattern, is_initiator, keys.prologue, s=own,
                              rs=PublicKey(public_of(keys.responder)) if is_initiator else None,
                              psks=[keys.shared])
        self.split = None

    def close(self):
        pass

    def write(self, payload):
        out = bytearray()
        self.split = self.state.write_message(payload, out)
        return bytes(out)

    def read(self, message):
        out = bytearray()
        try:
            self.split = self.state.read_message(message, out)
        except DecryptFailedException:
            return None
        return bytes(out)

    def remote(self):
        return self.state.rs.data

    def hash(self):
        return self.state.symmetricstate.get_handshake_hash()

    def seal(self, number, associated, plain):
        cipher = self.split[0 if self.is_initiator else 1]
        cipher.set_nonce(number)
        return cipher.encrypt_with_ad(associated, plain)

    def open(self, number, associated, sealed):
        cipher = self.split[1 if self.is_initiator else 0]
        cipher.set_nonce(number)
        try:
            return cipher.decrypt_with_ad(associated, sealed)
        except DecryptFailedException:
            return None


def flip(message, byte):
    """The message with one bit of this byte changed."""
    return message[:byte] + bytes([message[byte] ^ 1 << rng.randrange(8)]) + message[byte + 1:]


class Interop(unittest.TestCase):
    def sides(self, keys, is_ours_first, responders=None):
        """The two sides; `responders`: what the responder begins with where that is not the same."""
        first, second = (Ours, Theirs) if is_ours_first else (Theirs, Ours)
        initiator = first(keys, True)
        self.addCleanup(initiator.close)
        responder = second(responders or keys, False)
        self.addCleanup(responder.close)
        return initiator, responder

    def for_each(self, check):
        """Every pattern, every way round, and without and with a shared key where there may be one."""
        for pattern, shares in (("ik", False), ("ikpsk2", False), ("ikpsk2", True)):
            for is_ours_first in (True, False):
                with self.subTest(pattern=pattern, shares=shares, is_ours_first=is_ours_first):
                    check(Keys(pattern, rng.randbytes(KEY_BYTES) if shares else NO_KEY), is_ours_first)
                self.doCleanups()

    def shake(self, initiator, responder, size):
        for writer, reader in ((initiator, responder), (responder, initiator)):
            payload = rng.randbytes(size)
            self.assertEqual(reader.read(writer.write(payload)), payload)

    def check_transport(self, writer, reader, size):
        for number in NUMBERS:
            associated, plain = rng.randbytes(16), rng.randbytes(size)
            sealed = writer.seal(number, associated, plain)
            self.assertEqual(reader.open(number, associated, sealed), plain)
            # Neither with another number, nor beside other bytes, nor changed, nor by who has sealed it.
            self.assertIsNone(reader.open(number + 1, associated, sealed))
            self.assertIsNone(reader.open(number, flip(associated, 3), sealed))
            self.assertIsNone(reader.open(number, associated, flip(sealed, rng.randrange(len(sealed)))))
            self.assertIsNone(writer.open(number, associated, sealed))

    def test_both_sides_agree(self):
        def check(keys, is_ours_first):
            for size in PAYLOAD_BYTES:
                initiator, responder = self.sides(keys, is_ours_first)
                self.shake(initiator, responder, size)
                self.assertEqual(initiator.hash(), responder.hash())
                self.assertEqual(responder.remote(), public_of(keys.initiator))
                self.assertEqual(initiator.remote(), public_of(keys.responder))
                self.check_transport(initiator, responder, size)
                self.check_transport(responder, initiator, size)
        self.for_each(check)

    def test_who_does_not_share_the_key_is_refused(self):
        for is_ours_first in (True, False):
            for other in (NO_KEY, rng.randbytes(KEY_BYTES)):
                with self.subTest(is_ours_first=is_ours_first, other=other.hex()):
                    keys = Keys("ikpsk2", rng.randbytes(KEY_BYTES))
                    others = copy.copy(keys)
                    others.shared = other
                    initiator, responder = self.sides(keys, is_ours_first, others)
                    self.assertEqual(responder.read(initiator.write(b"first")), b"first")
                    self.assertIsNone(initiator.read(responder.write(b"second")))

    def test_no_byte_of_the_first_message_may_change(self):
        def check(keys, is_ours_first):
            for byte in range(len(Theirs(keys, True).write(b"first"))):
                initiator, responder = self.sides(keys, is_ours_first)
                self.assertIsNone(responder.read(flip(initiator.write(b"first"), byte)), byte)
                self.doCleanups()
        self.for_each(check)

    def test_no_byte_of_the_second_message_may_change(self):
        def check(keys, is_ours_first):
            byte, end = 0, 1
            while byte < end:
                initiator, responder = self.sides(keys, is_ours_first)
                self.assertEqual(responder.read(initiator.write(b"first")), b"first")
                message = responder.write(b"second")
                self.assertIsNone(initiator.read(flip(message, byte)), byte)
                byte, end = byte + 1, len(message)
                self.doCleanups()
        self.for_each(check)

    def test_another_prologue_or_responder_is_refused(self):
        def check(keys, is_ours_first):
            for name, value in (("prologue", b"another"), ("responder", rng.randbytes(KEY_BYTES))):
                others = copy.copy(keys)
                setattr(others, name, value)
                initiator, responder = self.sides(keys, is_ours_first, others)
                self.assertIsNone(responder.read(initiator.write(b"first")), name)
        self.for_each(check)


def main():
    global program, rng
    parser = argparse.ArgumentParser()
    parser.add_argument("noise_peer")
    parser.add_argument("--seed", type=int, default=int.from_bytes(os.urandom(4), "big"))
    arguments, others = parser.parse_known_args()
    program, rng = arguments.noise_peer, random.Random(arguments.seed)
    print(f"seed {arguments.seed}", flush=True)
    unittest.main(argv=[sys.argv[0], *others])


if __name__ == "__main__":
    main()
