// What the commands `links` and `top` show: a row per network card (NIC) and peer, and what
// changed. Values; pure.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/io/nic.h"
#include "interneuron/endpoint.h"
#include "interneuron/link.h"

namespace interneuron::cli {

// What the kernel says of a NIC.
struct NicFacts {
  io::Nic nic;
  NicState state{};
  std::string reason;  // of the newest change of `state`
};

// What a node measured on a NIC towards one of its peers.
struct Measured {
  std::string program;  // who measured: "vehicle", "road", "links"
  std::uint32_t peer = 0;
  LinkState state;
  std::string path_reason;  // of the newest change of `state.path`; empty: none yet
  LinkCounters counters;    // of the NIC, over all peers
};

struct LinkRow {
  NicFacts facts;
  std::optional<Measured> measured;
};

struct LinkEvent {
  TimePoint at{};
  std::string nic;
  std::string from;  // a NicState or PathState by name
  std::string to;
  std::string reason;
  friend bool operator==(const LinkEvent&, const LinkEvent&) = default;
};

struct LinksSnapshot {
  TimePoint at{};
  std::int64_t unix_ms = 0;  // the same instant on the wall, for people
  std::string source;        // where the measured part comes from, one line; empty: nowhere
  std::vector<LinkRow> rows;
  std::vector<LinkEvent> events;  // the newest at the end
};

// What one program tells of its links, without the kernel's part.
struct LiveLinks {
  struct Link {
    std::string nic;
    Measured measured;
  };
  std::string program;
  std::int64_t pid = 0;
  std::vector<Link> links;
  std::vector<LinkEvent> events;
};

// Every NIC, in the kernel's order: a row per peer that it was measured towards, or one without.
std::vector<LinkRow> join(const std::vector<NicFacts>& nics, const std::vector<LiveLinks>& live);

// Tables for people leave the loopback card out unless something is measured on it.
bool is_of_interest(const LinkRow& row);

// Text of a peer or the kernel on a terminal: control characters become '?'.
std::string printable(std::string text);

}  // namespace interneuron::cli
