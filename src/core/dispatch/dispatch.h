// How a message sets out, a plain one or one of a round: what a policy has planned becomes an
// itinerary of its variants, and dispatch() queues each of them at the peer with a header of its
// own. Both kinds of messages take this way; what differs is who plans and with which times. Pure;
// thread-compatible.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/flow/sender.h"
#include "core/peers/peer.h"
#include "core/wire/message_bytes.h"
#include "interneuron/few.h"
#include "interneuron/message.h"
#include "interneuron/policy.h"
#include "interneuron/send.h"

namespace interneuron::dispatch {

// The links that one variant of a message takes, by role. A plain value.
struct Carriers {
  std::uint8_t variant = 0;
  // The links that it sets out over: each carries all of it or, where it is divided, a share. A
  // variant without any stands by for the one before it.
  flow::PathList links{};
  // Whether it is divided, which links may carry repair symbols of it, and over which it, or what
  // is missing of it, goes when it seems late.
  flow::Protection protection{};
  // A receiver that has it keeps it for a better one as long as the deadline allows. Of plain
  // messages, where the sender says so; of rounds the receiver's policy decides.
  bool awaits_better = false;

  bool sets_out() const { return !links.empty(); }
};

// What leaves of a message: its variants, from the best to the smallest. The first one sets out.
// Made once for each message, and in place, so that it allocates nothing.
class Itinerary {
 public:
  Itinerary() = default;
  // Requires a plan that plan_message() has returned. Of what stands by, that is left out which has
  // no variant to stand by for.
  explicit Itinerary(const Plan& plan);

  bool empty() const { return size_ == 0; }
  const Carriers* begin() const { return variants_.data(); }
  const Carriers* end() const { return variants_.data() + size_; }
  const Carriers& front() const { return variants_.front(); }
  const Carriers& back() const { return variants_[size_ - 1]; }
  // Requires fewer than kMaxVariants so far.
  void push_back(const Carriers& carriers) { variants_[size_++] = carriers; }
  // Settles by the policy's merge() which variants await a better one. What stands by for one that
  // is given up awaits nothing.
  void settle_merge(const Policy& policy);

  // Bytes of its variants with headers of this kind; each counts once, over however many links.
  std::size_t bytes(std::span<const std::size_t> sizes, wire::MessageKind kind) const;

 private:
  std::array<Carriers, kMaxVariants> variants_{};
  std::size_t size_ = 0;
};

// The sizes of a message's variants in bytes.
using Sizes = Few<std::size_t, kMaxVariants>;
Sizes sizes_of(const Variants& variants);

// How a plain message ranks among others at the sender.
inline std::int16_t importance_of(const SendOptions& options) {
  return options.bulk ? flow::kBulkImportance : std::int16_t{options.importance};
}

// Needs as a header tells them, and back.
wire::PlainHeader::Needs on_wire(const Needs& needs);
Needs needs_of(const wire::PlainHeader& header);

// The links that the policy allows: lost pieces go over no other.
flow::PathSet allowed_of(const Policy& policy, std::span<const LinkState> links);

// The peer's paths are measured for more than they are known to bring where a plan withholds the
// best variant, or is under its floor.
void seek_rate(TimePoint now, peers::Peer& peer, const Plan& plan, const Itinerary& itinerary,
               const QoS& qos, std::size_t best_bytes);

// A variant that was queued, and how the peer and its sender name it.
struct Dispatched {
  std::uint8_t variant = 0;
  MessageId message{};
};
using AllDispatched = Few<Dispatched, kMaxVariants>;

// Queues the variants of an itinerary at the peer, and takes their bytes. `header` is that of the
// message; dispatch() writes into it what differs from variant to variant. `repairs`: the links
// that may carry again what is lost (allowed_of()).
template <class Header>
AllDispatched dispatch(TimePoint now, peers::Peer& peer, Header header, const Itinerary& itinerary,
                       const flow::Sender::Times& times, const flow::PathSet& repairs,
                       Variants& variants);

}  // namespace interneuron::dispatch
