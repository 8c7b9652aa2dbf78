// What an endpoint tells the application. Every event is a value; Delivered and RoundDone, which
// concern rounds, are in round.h; Message, MessageFate and CanSend in send.h.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/ledger.h"
#include "interneuron/link.h"
#include "interneuron/policy.h"
#include "interneuron/round.h"
#include "interneuron/security.h"
#include "interneuron/send.h"
#include "interneuron/units.h"

namespace interneuron {

// A peer was heard and has heard us: messages can be exchanged.
struct PeerReady {
  PeerId peer{};
};

// A known peer began a new life, with another session: all that was learnt of its clock and stages
// is dropped.
struct PeerRestarted {
  PeerId peer{};
};

// A peer that we did not connect to is forgotten: it was silent for kPeerSilence, or has made room
// for another one (src/core/peers/peers.h). Told of every peer that any event was about, also of
// one that was never ready.
struct PeerLost {
  PeerId peer{};
};

// What a policy decided for a message that was submitted here: which variants go over which links,
// whether no link met its floor, or why nothing is sent.
struct Planned {
  RoundRef round;
  // The communication that begins, counted from 1.
  std::uint8_t stage = 0;
  Plan plan;
};

// A link towards a peer has changed its state, as its traffic shows it.
struct PathChanged {
  PeerId peer{};
  LinkId link{};
  PathState from{};
  PathState to{};
  // A few words with the figures, for people.
  std::string reason;
};

// Somebody sends packets of another version of the protocol here: it is not served before both
// sides run the same one. Told at most once in ten seconds; LinkCounters counts all.
struct OtherVersion {
  LinkId link{};
  Address from{};
  std::uint8_t version = 0;
};

// A newer list of revocations has come from a peer, and an authority that we trust has signed it:
// keep it for the next start (Security::revocations). Peers whose keys it names are forgotten.
struct RevocationsChanged {
  std::vector<std::byte> list;
};

// A limit has struck this peer: its own oldest has gone, or what it has sent was dropped. Told at
// most once a second for each peer; its ledger (Endpoint::ledger()) counts all.
struct PeerLimited {
  PeerId peer{};
  PeerLimit limit{};
};

// Two hosts use the same private key, and each takes the other one's place: a host that has begun
// a new life here was followed by its old one. Told at most once a minute. Give one of them a key
// of its own.
struct KeyShared {
  PublicKey key{};
};

using Event = std::variant<Delivered, RoundDone, PeerReady, PeerRestarted, PeerLost, Planned,
                           PathChanged, OtherVersion, PeerLimited, RevocationsChanged, KeyShared,
                           Message, MessageFate, CanSend>;

}  // namespace interneuron
