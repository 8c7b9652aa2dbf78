// A communication policy: which variants of a message go over which links, and what the receiver
// hands to the application when (docs/paper.md, "Communication policies"). A policy knows neither
// devices nor applications. Write your own in one file: see policies/.
//
// The sender's endpoint calls plan() for every message. In a round, the receiver's calls merge()
// for every variant that is complete: the message's header names the policy, so both ends need it
// registered under the same name. For a plain message the sender's calls merge() for every variant
// that it sends, and tells the receiver what it answers.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "interneuron/guard.h"
#include "interneuron/link.h"
#include "interneuron/message.h"

namespace interneuron {

// What the real-time guard asks of the next transmission, and what it knows of the rest of the
// round.
struct Guidance {
  // Quality is to be given up for time.
  bool degraded = false;
  // The best variant to be sent, where the guard has weighed all of them (GuardKind::kBudget);
  // nothing where that is left to the policy. The last one when degraded.
  std::optional<std::uint8_t> variant{};
  // Until the end-to-end deadline, as the sender's node believes; Duration::max(): not known.
  Duration time_left = Duration::max();
  // The levels of the computation that follows, from the lowest to the highest; empty: not known.
  std::span<const LevelProfile> levels{};
  // What the round's own local result is worth (FallbackQuality::local); 0: not known.
  double local_quality = 0;
};

// What a variant costs beside its bytes, when the application computes a part of the work itself
// (a cut point of a neural network): run time before it is sent, and after it has arrived.
struct VariantCost {
  Duration here{};
  Duration there{};
};

// A message about to be sent.
struct Offer {
  QoS qos;
  // The size of each variant in bytes, from the best variant to the smallest; at least one.
  std::span<const std::size_t> variant_bytes;
  // The cost of each variant, or none.
  std::span<const VariantCost> costs{};
  // Messages that this round has sent before this one.
  std::uint8_t earlier_communications = 0;
};

// What a link does for a variant.
enum class SendRole : std::uint8_t {
  // It carries all of it.
  kWhole,
  // It carries a part of it: the links with this role divide the variant among them, so that the
  // last part is there as soon as possible. A link that would only delay it gets nothing.
  kShare,
  // It may carry repair symbols of the variant, which other links carry: as many as are worth their
  // bytes, for what could not be sent again in time if it was lost.
  kParity,
  // It stands by: once the message is likely to be late over the links that carry it, and this is
  // the last moment at which that helps, it carries what is missing of the variant, or all of a
  // variant that no other link carries.
  kShadow,
};
// "whole", "share", "parity", "shadow".
std::string_view to_string(SendRole role);

// One transmission: a variant over a link.
struct Assignment {
  // Index into the offer's variants.
  std::uint8_t variant = 0;
  LinkId link{};
  SendRole role = SendRole::kWhole;
  friend bool operator==(const Assignment&, const Assignment&) = default;
};

// Transmissions of a message: two over each of kMaxLinks, or four over each of the eight links that
// a peer has at most. Sends beyond this limit are dropped.
inline constexpr std::size_t kMaxSends = 2 * kMaxLinks;
using Assignments = Few<Assignment, kMaxSends>;

// What a policy decides for one message.
struct Plan {
  // Better variants leave first on a link, whatever their order here.
  Assignments sends;
  // No link meets the floor: the plan is best effort and is reported as such.
  bool under_floor = false;
  // Why nothing is sent although a link is up, one line for people that refers to a literal. Empty:
  // not refused. A refused round is answered locally as soon as its local result is there, and does
  // not count as missed.
  std::string_view refused{};
};

// Reasons of the built-in policies; policies of your own may give others. kNothingPlanned stands in
// when a policy plans nothing and gives no reason.
inline constexpr std::string_view kNothingPlanned =
    "nothing is sent: the policy plans nothing over the links there are";
inline constexpr std::string_view kLocalIsBetter =
    "nothing is sent: the local result is expected to be as good as any that is back in time";
inline constexpr std::string_view kNoTimeLeft =
    "nothing is sent: it could not be of use before the deadline";
inline constexpr std::string_view kInsecure =
    "nothing is sent: no link that is up meets the security floor; encrypt packets, declare the "
    "network of a link trusted (see docs/links.md) or wait for one that is";
inline constexpr std::string_view kUntrusted =
    "nothing is sent: no link that is up leads over a network that the operator trusts; declare "
    "the network of a link trusted (see docs/links.md) or wait for one that is";

// One complete variant at the receiver: what the sender planned, as the header tells it. merge()
// must decide by this alone and not by what the receiver would have planned.
struct Arrival {
  std::uint8_t variant = 0;
  // The best variant that the sender's plan holds.
  std::uint8_t best_planned = 0;
  bool degraded = false;
};

enum class Merge : std::uint8_t {
  // Hand it to the application now; later variants of this message are dropped.
  kDeliver,
  // Keep it until the stage's deadline, or that of a plain message, in the hope of a better one.
  kHold,
};

// A rule. Derived classes must be pure and stateless, because one instance serves every pipeline
// and may be shared between endpoints on different threads: the same arguments give the same
// answer, and nothing is kept. They run for every message, so they should not allocate; the
// built-in ones do not. A peer chooses the values in `arrival` and, through its reports, some of
// those in `links`, so a policy must be safe for any of them; whatever it answers is made safe to
// carry out (see policies/README.md).
class Policy {
 public:
  virtual ~Policy() = default;
  // Unique among the registered policies; lower-case with underscores. The view must stay valid as
  // long as the policy.
  virtual std::string_view name() const = 0;
  // Which variants of the offer go over which links. `links` are all links towards the peer, those
  // that are down included.
  virtual Plan plan(const Offer& offer, std::span<const LinkState> links,
                    const Guidance& guidance) const = 0;
  // What becomes of a complete variant at the receiver.
  virtual Merge merge(const Arrival& arrival) const = 0;
  // Whether a link may carry messages of this policy at all. Also asked for small results, which
  // are sent without plan(), and for fragments that are sent again.
  virtual bool allows(const LinkState& /*link*/) const { return true; }
};

// The least rate of a link that carries a variant of this size: the rate at which it keeps up with
// the message's period (or, for sporadic messages, arrives by the deadline).
DataRate rate_floor(const QoS& qos, std::size_t bytes);

// How long until a message of this size has arrived over an idle link: half the round trip (p95,
// which contains the queues) plus its fragments at the link's rate. Duration::max() while either is
// not measured.
Duration arrival_time(const LinkState& link, std::size_t bytes);

using PolicySet = std::vector<std::shared_ptr<const Policy>>;

// Those that come with Interneuron: best_link, duplicate, down_sampling, progressive, joint,
// placement, split, coded, stripe, shadow, failover, those of other systems for comparisons
// (min_rtt, lowest_latency, reinject), secure (down_sampling where packets are encrypted or the
// network is trusted) and trusted_only (down_sampling over trusted networks alone).
PolicySet builtin_policies();

// A policy over those links alone whose security score (docs/paper.md, "Nature") is at least
// `floor`, in (0, 1]; where none is up, nothing is sent (kInsecure), small results neither. Throws
// std::invalid_argument for a floor outside this range or no policy.
std::shared_ptr<const Policy> secure(std::shared_ptr<const Policy> inner, double floor,
                                     std::string_view name);

// A policy over the links of networks that the operator trusts alone (LinkTraits::trusted), whether
// packets are encrypted or not; where none is up, nothing is sent (kUntrusted), small results
// neither. Throws std::invalid_argument for no policy.
std::shared_ptr<const Policy> trusted_only(std::shared_ptr<const Policy> inner,
                                           std::string_view name);

}  // namespace interneuron
