// One side of a handshake by crypto::Noise, for another implementation to be the other side
// (interop_test.py):
//
//   noise_peer ik|ikpsk2 initiator|responder PROLOGUE OWN EPHEMERAL SHARED REMOTE
//
// PROLOGUE is any bytes, the others are keys: our two private ones, the shared one, and of an
// initiator the responder's public one. All bytes are written in hex digits. Each line that is read
// asks for something and is answered by one line, bytes or "refused":
//
//   write PAYLOAD                   our message of the handshake
//   read MESSAGE                    the payload of the other side's
//   remote                          the other side's static public key
//   hash                            the hash of the handshake
//   seal NUMBER ASSOCIATED PLAIN    a transport message to the other side with its tag
//   open NUMBER ASSOCIATED SEALED   what a transport message of the other side says
//
// Exit codes: 0 the input has ended, 2 it is not as above.
#include <sodium.h>

#include <algorithm>
#include <exception>
#include <iostream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/secure/aead.h"
#include "core/secure/bytes.h"
#include "core/secure/noise.h"

namespace interneuron::crypto {
namespace {

constexpr int kUsage = 2;

Bytes unhex(const std::string& text) {
  // libsodium takes no null pointer, which is what a vector without bytes has.
  if (text.empty()) return {};
  Bytes out(text.size() / 2);
  std::size_t size = 0;
  if (sodium_hex2bin(target(out), out.size(), text.data(), text.size(), nullptr, &size, nullptr) !=
          0 ||
      2 * size != text.size()) {
    throw std::invalid_argument("not hex digits: " + text);
  }
  return out;
}

std::string hex(ByteView bytes) {
  if (bytes.empty()) return {};
  std::string out(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(out.data(), out.size(), raw(bytes), bytes.size());
  // The terminating zero.
  out.pop_back();
  return out;
}

PublicKey key_of(const std::string& text) {
  const Bytes bytes = unhex(text);
  if (bytes.size() != kKeyBytes) throw std::invalid_argument("not a key: " + text);
  PublicKey key{};
  std::ranges::copy(bytes, key.begin());
  return key;
}

class Peer {
 public:
  explicit Peer(const std::vector<std::string>& arguments)
      : is_initiator_(arguments.at(1) == "initiator"), noise_(noise_of(arguments)) {
    noise_.set_shared(SecretKey(key_of(arguments.at(5))));
  }

  // Nothing: it is refused.
  std::optional<Bytes> answer(const std::vector<std::string>& words) {
    const std::string& what = words.at(0);
    if (what == "write") return write(unhex(words.at(1)));
    if (what == "read") return read(unhex(words.at(1)));
    if (what == "remote") return Bytes(noise_.remote().begin(), noise_.remote().end());
    if (what == "hash") return Bytes(noise_.hash().begin(), noise_.hash().end());
    if (what != "seal" && what != "open") throw std::invalid_argument("unknown: " + what);
    const std::uint64_t number = std::stoull(words.at(1));
    const Bytes associated = unhex(words.at(2));
    const Bytes bytes = unhex(words.at(3));
    return what == "seal" ? seal(number, associated, bytes) : open(number, associated, bytes);
  }

 private:
  static Noise noise_of(const std::vector<std::string>& arguments) {
    const auto pattern =
        arguments.at(0) == "ikpsk2" ? Noise::Pattern::kIkPsk2 : Noise::Pattern::kIk;
    const Bytes prologue = unhex(arguments.at(2));
    const KeyPair own = key_pair_of(SecretKey(key_of(arguments.at(3))));
    const KeyPair ephemeral = key_pair_of(SecretKey(key_of(arguments.at(4))));
    if (arguments.at(1) != "initiator")
      return Noise::responder(pattern, prologue, own, ephemeral.secret);
    return Noise::initiator(pattern, prologue, own, ephemeral, key_of(arguments.at(6)));
  }

  std::optional<Bytes> write(const Bytes& payload) {
    Bytes out(payload.size() + (is_initiator_ ? kFirstMessageBytes : kSecondMessageBytes));
    const bool is_made =
        is_initiator_ ? noise_.write_first(out, payload) : noise_.write_second(out, payload);
    return is_made ? std::optional(out) : std::nullopt;
  }
  std::optional<Bytes> read(const Bytes& message) {
    const std::size_t overhead = is_initiator_ ? kSecondMessageBytes : kFirstMessageBytes;
    Bytes out(message.size() - std::min(message.size(), overhead));
    const bool is_theirs =
        is_initiator_ ? noise_.read_second(message, out) : noise_.read_first(message, out);
    return is_theirs ? std::optional(out) : std::nullopt;
  }
  std::optional<Bytes> seal(std::uint64_t number, ByteView associated, const Bytes& plain) const {
    const Split keys = noise_.split();
    Bytes out(plain.size() + kAeadTagBytes);
    aead_seal(is_initiator_ ? keys.from_initiator : keys.from_responder, number, associated, plain,
              std::span(out).first(plain.size()), std::span(out).last(kAeadTagBytes));
    return out;
  }
  std::optional<Bytes> open(std::uint64_t number, ByteView associated, const Bytes& bytes) const {
    if (bytes.size() < kAeadTagBytes) return std::nullopt;
    const Split keys = noise_.split();
    Bytes out(bytes.size() - kAeadTagBytes);
    const bool is_theirs =
        aead_open(is_initiator_ ? keys.from_responder : keys.from_initiator, number, associated,
                  ByteView(bytes).first(out.size()), ByteView(bytes).last(kAeadTagBytes), out);
    return is_theirs ? std::optional(out) : std::nullopt;
  }

  bool is_initiator_;
  Noise noise_;
};

// Words may be empty, as no bytes are in hex digits.
std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  std::istringstream in(line + ' ');
  for (std::string word; std::getline(in, word, ' ');) words.push_back(word);
  return words;
}

}  // namespace
}  // namespace interneuron::crypto

int main(int argc, char** argv) {
  using namespace interneuron;
  try {
    crypto::Peer peer(std::vector<std::string>(argv + 1, argv + argc));
    for (std::string line; std::getline(std::cin, line);) {
      const std::optional<Bytes> bytes = peer.answer(crypto::words_of(line));
      std::cout << (bytes ? crypto::hex(*bytes) : "refused") << std::endl;
    }
  } catch (const std::exception& e) {
    std::cerr << "noise_peer: " << e.what() << '\n';
    return crypto::kUsage;
  }
  return 0;
}
