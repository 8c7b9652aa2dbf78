// How often one source is answered, for whatever answers anybody: a forged source address must not
// make this host send to its owner without bounds, nor one host take all the work that there is.
//
// A token bucket for each source, as one instant: when the bucket will be full again. A source is a
// host rather than a socket, because whoever forges can choose ports freely: an IPv4 address, the
// upper 64 bits of an IPv6 address (one customer owns them all), or a whole link-local one.
//
// The table is bounded. A source that finds it full takes the place of the one whose bucket is the
// fullest, which loses the least by being forgotten: it begins with a full bucket when it asks
// again. So a flood from forged sources locks nobody out, and a source that has used up its bucket
// is forgotten only after all others in the table have used up as much. What a flood of many
// sources gets in total is not bounded here: one answer per request, of the request's size.
//
// Fed by the reflectors of core/probe and by crypto::Responder with the senders of packets from
// anybody. The core looks inside an Address here and in
// src/core/peers/address_validation.cc alone. Pure; thread-compatible; never throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/time.h"

namespace interneuron {

// The port of a UDP sender, read from the bytes of its sockaddr; 0 for an address that is neither
// IPv4 nor IPv6.
std::uint16_t sender_port(const Address& from);

// Whether two addresses are of the same host, whatever their ports: a configuration names a relay
// by its address alone, since nobody knows the port that it will send from. Addresses that are
// neither IPv4 nor IPv6, as virtual networks make them up, have no port and must be equal.
bool is_same_host(Address a, Address b);

// The host or customer that an address is of: an IPv4 address, the upper 64 bits of an IPv6
// address, all of a link-local one.
using Source = std::array<std::byte, 16>;
Source source_of(const Address& from);

class SourceLimit {
 public:
  // Sources that are known at once. No measurement behind this value: it only has to be larger than
  // the number of hosts that ask at the same time. They take 6 KB.
  static constexpr std::size_t kMaxSources = 256;

  // One answer per `interval` for as long as a source likes, and `burst` at once after a pause.
  SourceLimit(Duration interval, int burst) : interval_(interval), burst_(burst) {}

  // Whether a request that came from there may be answered; takes a token if so.
  bool allow(TimePoint now, const Address& from);
  std::size_t sources() const { return buckets_.size(); }

 private:
  struct Bucket {
    Source source{};
    // When it will be full.
    TimePoint full_at{};
  };
  Bucket& bucket_of(TimePoint now, const Source& source);

  Duration interval_;
  int burst_;
  std::vector<Bucket> buckets_;
};

}  // namespace interneuron
