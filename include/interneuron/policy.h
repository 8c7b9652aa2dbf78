// A communication policy: which variants of a message go over which links, and what the receiver
// hands to the application when (docs/paper.md, "Communication policies"). A policy knows neither
// devices nor applications. Write your own in one file: see policies/.
//
// Policies are pure and stateless: the same arguments give the same answer. They run for every
// message: those that come with Interneuron allocate nothing. The sender's endpoint
// calls plan(), the receiver's merge(); the message header names the policy, so both ends need it
// registered under the same name.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "interneuron/guard.h"
#include "interneuron/link.h"
#include "interneuron/message.h"

namespace interneuron {

// What the real-time guard asks of the next transmission, and what it knows of the rest.
struct Guidance {
  bool degraded = false;  // sacrifice quality for time
  // Until the end-to-end deadline, as the sender's node believes; max() = not known.
  Duration time_left = Duration::max();
  // The levels of the computation that follows, from the lowest to the highest; empty: not known.
  std::span<const LevelProfile> levels{};
  double local_quality = 0;  // FallbackQuality::local
};

// What a variant costs beside its bytes, when the application computes a part of the work itself
// (a cut point of a network): before it is sent, and after it has arrived.
struct VariantCost {
  Duration here{};
  Duration there{};
};

// A message about to be sent. variant_bytes: from the best variant to the smallest, at least one.
struct Offer {
  QoS qos;
  std::span<const std::size_t> variant_bytes;
  std::span<const VariantCost> costs{};     // as many, or none
  std::uint8_t earlier_communications = 0;  // of this round, before this one
};

struct Assignment {
  std::uint8_t variant = 0;  // index into the offer's variants
  LinkId link{};
  friend bool operator==(const Assignment&, const Assignment&) = default;
};

// What is beyond is not sent; chosen: two variants over each of kMaxLinks.
inline constexpr std::size_t kMaxSends = 2 * kMaxLinks;
using Assignments = Few<Assignment, kMaxSends>;

struct Plan {
  Assignments sends;
  bool under_floor =
      false;  // no link met the floor: the plan is best effort, and is reported as such
  // Why nothing is sent although a link is up, for people; refers to a literal. Empty: not refused.
  // A refused round is answered locally, as soon as its local result is there; that is no miss.
  std::string_view refused{};
};

// Reasons of the built-in policies; policies of your own may give others. The first is given where
// a policy gives none.
inline constexpr std::string_view kNothingPlanned =
    "nothing is sent: the policy plans nothing over the links there are";
inline constexpr std::string_view kLocalIsBetter =
    "nothing is sent: the local result is expected to be as good as any that is back in time";
inline constexpr std::string_view kNoTimeLeft =
    "nothing is sent: it could not be of use before the deadline";
inline constexpr std::string_view kInsecure =
    "nothing is sent: no link that is up meets the security floor; declare the network of a link "
    "trusted (see docs/links.md) or wait for one that is";

// One complete variant at the receiver. What is decided obeys the header (what the sender planned),
// never the receiver's own state.
struct Arrival {
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;  // the best variant the sender's plan holds
  bool degraded = false;
};

enum class Merge : std::uint8_t {
  kDeliver,  // hand it over now; later variants of this message are dropped
  kHold,     // keep it until the stage deadline in the hope of a better one
};

class Policy {
 public:
  virtual ~Policy() = default;
  // Unique; lower-case with underscores.
  virtual std::string_view name() const = 0;
  virtual Plan plan(const Offer& offer, std::span<const LinkState> links,
                    const Guidance& guidance) const = 0;
  virtual Merge merge(const Arrival& arrival) const = 0;
  // Whether a link may carry messages of this policy at all. Asked for small results too, which are
  // sent without plan(), and for what is sent again.
  virtual bool allows(const LinkState& /*link*/) const { return true; }
};

// The least rate of a link that carries a variant of this size: the rate at which it keeps up with
// the message's period (or, for sporadic messages, arrives by the deadline).
DataRate rate_floor(const QoS& qos, std::size_t bytes);

// Until a message of this size has arrived over an idle link: half the round trip (p95, which holds
// the queues) and its fragments at the link's rate. max() while either was not measured.
Duration arrival_time(const LinkState& link, std::size_t bytes);

using PolicySet = std::vector<std::shared_ptr<const Policy>>;

// best_link, duplicate, down_sampling, progressive, joint, placement, split, secure (down_sampling
// over trusted networks).
PolicySet builtin_policies();

// A policy over those links alone whose security score (docs/paper.md, "Nature") is at least
// `floor`, in (0, 1]; where none is up, nothing is sent, small results neither. Throws
// std::invalid_argument for a floor outside this range or no policy.
std::shared_ptr<const Policy> secure(std::shared_ptr<const Policy> inner, double floor,
                                     std::string_view name);

}  // namespace interneuron
