#include "core/base/source_limit.h"

#include <algorithm>

namespace interneuron {
namespace {

// Where Linux has the fields of sockaddr_in (16 bytes) and sockaddr_in6 (28 bytes), and what the
// latter begin with for a link-local address (fe80::/10).
constexpr std::size_t kIpv4Bytes = 16;
constexpr std::size_t kIpv6Bytes = 28;
constexpr std::size_t kPortAt = 2;
constexpr std::size_t kPortBytes = 2;
constexpr std::size_t kIpv4At = 4;
constexpr std::size_t kIpv4Length = 4;
constexpr std::size_t kIpv6At = 8;
constexpr std::size_t kIpv6Length = 16;
constexpr std::size_t kPrefixLength = 8;

bool is_link_local_ipv6(const Address& from) {
  return from.raw[kIpv6At] == std::byte{0xfe} &&
         (from.raw[kIpv6At + 1] & std::byte{0xc0}) == std::byte{0x80};
}

}  // namespace

std::uint16_t sender_port(const Address& from) {
  if (from.size != kIpv4Bytes && from.size != kIpv6Bytes) return 0;
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(from.raw[kPortAt]) << 8 |
                                    std::to_integer<unsigned>(from.raw[kPortAt + 1]));
}

bool is_same_host(Address a, Address b) {
  if (a.size != b.size || a.size == 0) return false;
  if (a.size == kIpv4Bytes || a.size == kIpv6Bytes) {
    std::fill_n(a.raw.begin() + kPortAt, kPortBytes, std::byte{0});
    std::fill_n(b.raw.begin() + kPortAt, kPortBytes, std::byte{0});
  }
  return a == b;
}

Source source_of(const Address& from) {
  Source source{};
  std::size_t at = 0;
  std::size_t length = source.size();
  if (from.size == kIpv4Bytes) {
    at = kIpv4At;
    length = kIpv4Length;
  } else if (from.size == kIpv6Bytes) {
    at = kIpv6At;
    length = is_link_local_ipv6(from) ? kIpv6Length : kPrefixLength;
  }
  std::copy_n(from.raw.begin() + static_cast<std::ptrdiff_t>(at), length, source.begin());
  return source;
}

SourceLimit::Bucket& SourceLimit::bucket_of(TimePoint now, const Source& source) {
  const auto known = std::ranges::find(buckets_, source, &Bucket::source);
  if (known != buckets_.end()) return *known;
  if (buckets_.size() < kMaxSources) return buckets_.emplace_back(Bucket{source, now});
  Bucket& fullest = *std::ranges::min_element(buckets_, {}, &Bucket::full_at);
  fullest = {source, now};
  return fullest;
}

bool SourceLimit::allow(TimePoint now, const Address& from) {
  Bucket& bucket = bucket_of(now, source_of(from));
  const TimePoint full_at = std::max(bucket.full_at, now) + interval_;
  if (full_at - now > burst_ * interval_) return false;
  bucket.full_at = full_at;
  return true;
}

}  // namespace interneuron
