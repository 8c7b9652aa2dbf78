"""Our handshake and our sealed packets (docs/wire_format.md) once more, for the tests that attack them: whoever asks and
whoever is asked. Written from that page with python3-cryptography alone, so that it shares no code with src/core/secure.

Neither side checks what a host should that is attacked: times, tries, numbers. Nothing here is fit for anything but tests.
"""

import base64
import hashlib
import hmac
import struct

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESGCM, ChaCha20Poly1305

__all__ = ["Asked", "Asking", "InvalidTag", "Keys", "cookie_reply", "fields", "packet", "public_of", "read_key"]

PROTOCOL = b"Noise_IKpsk2_25519_ChaChaPoly_SHA256"
PROLOGUE = b"interneuron 3"
VERSION = 3
FEEDBACK, INITIATION, CHALLENGE, TOKEN, RESPONSE, COOKIE = 2, 5, 7, 8, 9, 10
# Types that belong to no path's numbers, and the lane that they have.
UNNUMBERED = (4, INITIATION, CHALLENGE, RESPONSE, COOKIE)
NO_LANE = 0x010000
MAC = bytes(16)
HEADER = struct.Struct(">BBHIQI")
# Life, index, time, revocations, and what there is beside ChaCha20-Poly1305.
HELLO = struct.Struct(">IIQQB")
HAS_AES_GCM = 1


def public_of(secret):
    return X25519PrivateKey.from_private_bytes(secret).public_key().public_bytes(
        serialization.Encoding.Raw, serialization.PublicFormat.Raw)


def read_key(path):
    """A file of one line of base64."""
    with open(path, encoding="ascii") as file:
        return base64.b64decode(file.read())


def mac(key, data):
    return hashlib.blake2b(data, digest_size=16, key=key).digest()


def labelled(label, public):
    return hashlib.blake2b(label + public, digest_size=32).digest()


def mac1(responder, data):
    return mac(labelled(b"interneuron mac1", responder), data)


def hmac256(key, *parts):
    return hmac.new(key, b"".join(parts), hashlib.sha256).digest()


def nonce(number):
    return bytes(4) + struct.pack("<Q", number)


def packet(kind, path, session, number, epoch=0, stamp=0):
    """A header."""
    return HEADER.pack(VERSION << 4 | kind, epoch, path, session, number, stamp)


def fields(data):
    """Type, epoch, path, session, number and stamp of a header."""
    first, *others = HEADER.unpack(data[:HEADER.size])
    return (first & 15, *others)


class Noise:
    """One side of a handshake, "The Noise Protocol Framework" (revision 34)."""

    def __init__(self, secret, ephemeral, responder, shared):
        self.secret, self.ephemeral, self.shared = secret, ephemeral, shared
        self.hash = self.chaining = hashlib.sha256(PROTOCOL).digest()
        self.key, self.number = None, 0
        self.mix_hash(PROLOGUE)
        self.mix_hash(responder)

    def mix_hash(self, data):
        self.hash = hashlib.sha256(self.hash + data).digest()

    def derive(self, data):
        extracted = hmac256(self.chaining, data)
        first = hmac256(extracted, b"\1")
        second = hmac256(extracted, first, b"\2")
        return first, second, hmac256(extracted, second, b"\3")

    def mix_key(self, data):
        self.chaining, self.key, _ = self.derive(data)
        self.number = 0

    def mix_both(self, secret, public):
        key = X25519PrivateKey.from_private_bytes(secret)
        self.mix_key(key.exchange(X25519PublicKey.from_public_bytes(public)))

    def mix_ephemeral(self, public):
        self.mix_hash(public)
        self.mix_key(public)

    def mix_shared(self):
        self.chaining, hashed, self.key = self.derive(self.shared)
        self.number = 0
        self.mix_hash(hashed)

    def seal(self, plain):
        sealed = ChaCha20Poly1305(self.key).encrypt(nonce(self.number), plain, self.hash)
        self.number += 1
        self.mix_hash(sealed)
        return sealed

    def open(self, sealed):
        plain = ChaCha20Poly1305(self.key).decrypt(nonce(self.number), sealed, self.hash)
        self.number += 1
        self.mix_hash(sealed)
        return plain

    def code_key(self, label):
        return hmac256(self.chaining, label)

    def split(self):
        return self.derive(b"")[:2]


class Keys:
    """What two hosts have agreed on: seals what leaves and opens what comes."""

    def __init__(self, sending, receiving, index, life, ciphers=0):
        self.sending, self.receiving, self.is_aes = sending, receiving, bool(ciphers & HAS_AES_GCM)
        # By which the other side knows these keys, and its life.
        self.index, self.life = index, life

    def lane(self, direction, kind, path):
        lane = (NO_LANE if kind in UNNUMBERED else path).to_bytes(3, "big")
        if self.is_aes:
            return AESGCM(hmac256(direction, b"interneuron path aes256gcm", lane))
        return ChaCha20Poly1305(hmac256(direction, b"interneuron path", lane))

    def nonce(self, number):
        return bytes(4) + struct.pack(">Q", number) if self.is_aes else nonce(number)

    def seal(self, kind, path, number, stamp, body):
        header = packet(kind, path, self.index, number, epoch=1)[:16]
        return header + self.lane(self.sending, kind, path).encrypt(self.nonce(number), struct.pack(">I", stamp) + body, header)

    def open(self, data):
        """Type, path, number, stamp and body. Throws InvalidTag."""
        kind, _, path, _, number, _ = fields(data)
        plain = self.lane(self.receiving, kind, path).decrypt(self.nonce(number), data[16:], data[:16])
        return kind, path, number, struct.unpack(">I", plain[:4])[0], plain[4:]


class Asking:
    """Who has connected: one initiation, its copies, and what answers them."""

    def __init__(self, secret, responder, ephemeral, life, index, unix_ns, shared=bytes(32), ciphers=0):
        self.responder, self.index, self.cookies, self.ciphers = responder, index, {}, ciphers
        self.noise = noise = Noise(secret, ephemeral, responder, shared)
        public = public_of(ephemeral)
        noise.mix_ephemeral(public)
        noise.mix_both(ephemeral, responder)
        static = noise.seal(public_of(secret))
        noise.mix_both(secret, responder)
        self.message = public + static + noise.seal(HELLO.pack(life, index, unix_ns, 0, ciphers))
        self.proofs = [noise.code_key(b"interneuron initiation"), noise.code_key(b"interneuron response")]

    def copy(self, path, number):
        data = packet(INITIATION, path, self.index, number) + self.message
        data += mac(self.proofs[0], data)
        data += mac1(self.responder, data)
        cookie = self.cookies.get(path)
        return data + (mac(cookie + MAC, data) if cookie else MAC)

    def take_cookie(self, data):
        _, _, path, _, number, _ = fields(data)
        key = labelled(b"interneuron cookie", self.responder)
        subkey = hchacha20(key, data[20:36])
        self.cookies[path] = ChaCha20Poly1305(subkey).decrypt(bytes(4) + data[36:44], data[44:], self.copy(path, number)[-32:-16])

    def take_response(self, data):
        """The keys and the token. Throws InvalidTag."""
        if mac(self.proofs[1], data[:-16]) != data[-16:]:
            raise InvalidTag
        noise = self.noise
        noise.mix_ephemeral(data[20:52])
        noise.mix_both(noise.ephemeral, data[20:52])
        noise.mix_both(noise.secret, data[20:52])
        noise.mix_shared()
        life, index, _, _, ciphers = HELLO.unpack(noise.open(data[52:93]))
        sending, receiving = noise.split()
        return Keys(sending, receiving, index, life, self.ciphers & ciphers), data[93:109]


class Asked:
    """Who is connected to: reads one initiation and answers it. Throws InvalidTag."""

    def __init__(self, secret, initiation, shared=bytes(32)):
        self.initiation = initiation
        self.noise = noise = Noise(secret, None, public_of(secret), shared)
        self.remote_ephemeral = initiation[20:52]
        noise.mix_ephemeral(self.remote_ephemeral)
        noise.mix_both(secret, self.remote_ephemeral)
        self.who = noise.open(initiation[52:100])
        noise.mix_both(secret, self.who)
        hello = noise.open(initiation[100:-48])
        self.life, self.index, self.unix_ns, _, self.ciphers = HELLO.unpack(hello[:HELLO.size])
        self.proof = noise.code_key(b"interneuron response")
        if mac(noise.code_key(b"interneuron initiation"), initiation[:-48]) != initiation[-48:-32]:
            raise InvalidTag

    def answer(self, ephemeral, life, index, unix_ns, token, ciphers=0):
        """The response and the keys."""
        noise = self.noise
        _, _, path, _, number, _ = fields(self.initiation)
        public = public_of(ephemeral)
        noise.mix_ephemeral(public)
        noise.mix_both(ephemeral, self.remote_ephemeral)
        noise.mix_both(ephemeral, self.who)
        noise.mix_shared()
        data = packet(RESPONSE, path, self.index, number) + public + noise.seal(HELLO.pack(life, index, unix_ns, 0, ciphers)) + token
        receiving, sending = noise.split()
        return data + mac(self.proof, data), Keys(sending, receiving, self.index, self.life, self.ciphers & ciphers)


def cookie_reply(initiation, responder, random, cookie):
    """What answers an initiation under load; `random` has 24 bytes."""
    _, _, path, session, number, _ = fields(initiation)
    subkey = hchacha20(labelled(b"interneuron cookie", responder), random[:16])
    return packet(COOKIE, path, session, number) + random + ChaCha20Poly1305(subkey).encrypt(
        bytes(4) + random[16:], cookie, initiation[-32:-16])


def hchacha20(key, random):
    """The key of XChaCha20-Poly1305 for these first 16 bytes of a nonce (draft-irtf-cfrg-xchacha-03), which the package
    does not have."""
    state = list(struct.unpack("<4I8I4I", b"expand 32-byte k" + key + random))

    def turn(value, bits):
        return (value << bits | value >> (32 - bits)) & 0xffffffff

    def quarter(a, b, c, d):
        for x, y, z, bits in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
            state[x] = (state[x] + state[y]) & 0xffffffff
            state[z] = turn(state[z] ^ state[x], bits)

    for _ in range(10):
        for i in range(4):
            quarter(i, 4 + i, 8 + i, 12 + i)
        for i in range(4):
            quarter(i, 4 + (i + 1) % 4, 8 + (i + 2) % 4, 12 + (i + 3) % 4)
    return struct.pack("<8I", *state[:4], *state[12:])
