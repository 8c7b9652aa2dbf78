#include "core/peers/address_validation.h"

#include <sodium.h>

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/wire/bytes.h"

namespace interneuron::peers {
namespace {

static_assert(crypto_shorthash_siphashx24_BYTES == wire::kTokenBytes);
static_assert(crypto_shorthash_siphashx24_KEYBYTES == sizeof(Secret));

// Where a sockaddr_in and a sockaddr_in6 have their address, and how long they are, in bytes. The
// ABI of Linux; other addresses are the simulation's.
constexpr std::size_t kIpv4Size = 16;
constexpr std::size_t kIpv4At = 4;
constexpr std::size_t kIpv4Bytes = 4;
constexpr std::size_t kIpv4NetworkBytes = 2;
constexpr std::size_t kIpv6Size = 28;
constexpr std::size_t kIpv6At = 8;
constexpr std::size_t kIpv6Bytes = 16;
constexpr std::size_t kIpv6NetworkBytes = 6;

std::int64_t epoch_of(TimePoint now) {
  return std::chrono::floor<Duration>(now.time_since_epoch()) / AddressValidation::kEpoch;
}

// The first bytes of an address, behind how many they are.
Network prefix_of(const Address& address, std::size_t ipv4_bytes, std::size_t ipv6_bytes) {
  Network network{};
  std::size_t at = 0;
  std::size_t bytes = address.size;
  if (address.size == kIpv4Size) {
    at = kIpv4At;
    bytes = ipv4_bytes;
  } else if (address.size == kIpv6Size) {
    at = kIpv6At;
    bytes = ipv6_bytes;
  }
  bytes = std::min(bytes, network.size() - 1);
  network.front() = static_cast<std::byte>(bytes);
  std::copy_n(address.raw.begin() + static_cast<std::ptrdiff_t>(at), bytes, network.begin() + 1);
  return network;
}

}  // namespace

Network network_of(const Address& address) {
  return prefix_of(address, kIpv4NetworkBytes, kIpv6NetworkBytes);
}

Network host_of(const Address& address) { return prefix_of(address, kIpv4Bytes, kIpv6Bytes); }

wire::Token AddressValidation::token_of(std::int64_t epoch, const wire::PacketHeader& header,
                                        const Datagram& datagram) const {
  std::array<std::byte, 64> told{};
  wire::Writer w(told);
  w.put(epoch);
  w.put(header.session.value);
  w.put(header.link.value);
  w.put(datagram.link.value);
  w.put(datagram.from.size);
  w.put_bytes(datagram.from.raw);
  assert(w.ok());
  wire::Token token{};
  crypto_shorthash_siphashx24(reinterpret_cast<unsigned char*>(token.data()),
                              reinterpret_cast<const unsigned char*>(told.data()), w.size(),
                              reinterpret_cast<const unsigned char*>(secret_.data()));
  return token;
}

bool AddressValidation::challenge(TimePoint now, const wire::PacketHeader& header,
                                  const Datagram& datagram) {
  if (refilled_at_ == TimePoint::min()) refilled_at_ = now;
  const double seconds = to_seconds(now - refilled_at_);
  credit_ = std::min(credit_ + seconds * kPerSecond, static_cast<double>(kMaxWaiting));
  refilled_at_ = now;
  if (credit_ < 1 || waiting_.size() >= kMaxWaiting) return false;
  credit_ -= 1;
  waiting_.push_back(
      {datagram.link, datagram.from, header, {header.session, token(now, header, datagram)}});
  return true;
}

wire::Token AddressValidation::token(TimePoint now, const wire::PacketHeader& header,
                                     const Datagram& datagram) const {
  return token_of(epoch_of(now), header, datagram);
}

bool AddressValidation::proves(TimePoint now, const wire::PacketHeader& header,
                               const Datagram& datagram, const wire::Token& token) const {
  const auto is_of = [&](std::int64_t epoch) {
    const wire::Token expected = token_of(epoch, header, datagram);
    return sodium_memcmp(expected.data(), token.data(), expected.size()) == 0;
  };
  const std::int64_t epoch = epoch_of(now);
  return is_of(epoch) || is_of(epoch - 1);
}

void AddressValidation::remove_link(LinkId nic) {
  for (std::size_t left = waiting_.size(); left > 0; --left) {
    const Waiting next = waiting_.front();
    waiting_.pop_front();
    if (next.nic != nic) waiting_.push_back(next);
  }
}

std::optional<AddressValidation::Leaving> AddressValidation::poll(std::span<std::byte> buffer) {
  if (waiting_.empty()) return std::nullopt;
  const Waiting& next = waiting_.front();
  const wire::PacketHeader header{wire::PacketType::kChallenge, next.header.link, wire::kClearEpoch,
                                  self_, next.header.number};
  const Leaving out{{next.nic, next.to, wire::write_challenge(buffer, header, next.challenge)},
                    next.header.session};
  waiting_.pop_front();
  return out;
}

}  // namespace interneuron::peers
