// What the commands `links` and `top` show: a row per network card (NIC) and peer, and the newest
// changes. Values; pure; no errors.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/computing/jobs.h"
#include "interneuron/endpoint.h"
#include "interneuron/ledger.h"
#include "interneuron/link.h"
#include "node/io/nic.h"

namespace interneuron::watch {

// What the kernel says of a NIC.
struct NicFacts {
  io::Nic nic;
  NicState state{};
  // Why `state` changed the last time.
  std::string reason;
};

// What a node measured on a NIC towards one of its peers.
struct Measured {
  // The program that measured: "vehicle", "road" or "links".
  std::string program;
  std::uint32_t peer = 0;
  LinkState state;
  // Why `state.path` changed the last time; empty before the first change.
  std::string path_reason;
  // The NIC's, over all peers.
  LinkCounters counters;
};

struct LinkRow {
  NicFacts facts;
  std::optional<Measured> measured;
};

struct LinkEvent {
  TimePoint at{};
  std::string nic;
  // Names of a NicState or of a PathState.
  std::string from;
  std::string to;
  std::string reason;
  friend bool operator==(const LinkEvent&, const LinkEvent&) = default;
};

// What a program's endpoint keeps of one of its peers and, if the program computes for others, what
// it computes for that one.
struct LivePeer {
  std::uint32_t peer = 0;
  PeerLedger ledger;
  std::optional<computing::PeerWork> work = {};
};

// A program as a whole: its peers, and how long its own work has kept its loop at most.
struct LiveProgram {
  std::string program;
  std::int64_t pid = 0;
  Duration loop_stall{};
  std::vector<LivePeer> peers;
};

struct LinksSnapshot {
  TimePoint at{};
  // The same instant by the wall clock, for people.
  std::int64_t unix_ms = 0;
  // Where the measured part comes from, one line; empty: nothing is measured.
  std::string source;
  std::vector<LinkRow> rows;
  // The newest at the end.
  std::vector<LinkEvent> events;
  std::vector<LiveProgram> programs;
};

// What one program tells others of its links, without what the kernel says.
struct LiveLinks {
  struct Link {
    std::string nic;
    Measured measured;
  };
  std::string program;
  std::int64_t pid = 0;
  std::vector<Link> links;
  std::vector<LinkEvent> events;
  // As in LiveProgram.
  Duration loop_stall = {};
  std::vector<LivePeer> peers = {};
};

// The rows of all NICs, in the kernel's order: one for each peer towards which a NIC was measured,
// or one without measurements.
std::vector<LinkRow> join(const std::vector<NicFacts>& nics, const std::vector<LiveLinks>& live);

// Whether tables for people show the row: the loopback card only when something is measured on it.
bool is_of_interest(const LinkRow& row);

// Makes text of a peer or of the kernel safe for a terminal: control characters, which could move
// the cursor or change the terminal's settings, become '?'.
std::string printable(std::string text);

}  // namespace interneuron::watch
