#include "core/dispatch/dispatch.h"

#include <algorithm>
#include <utility>

#include "core/plan/plan_message.h"

namespace interneuron::dispatch {
namespace {

wire::MessageBytes with(wire::PlainHeader header, const Carriers& c, Bytes payload) {
  std::array<std::byte, wire::kMostPlainHeaderBytes> bytes;
  header.variant = c.variant;
  header.awaits_better = c.awaits_better;
  wire::write_plain_header(bytes, header);
  return {std::span(bytes).first(header.bytes()), std::move(payload)};
}

wire::MessageBytes with(wire::RoundHeader header, const Carriers& c, Bytes payload) {
  std::array<std::byte, wire::kRoundHeaderBytes> bytes;
  header.variant = c.variant;
  // What stands by is sent once the better ones are given up, so the receiver need not wait for
  // these.
  header.degraded = header.degraded || !c.sets_out();
  wire::write_round_header(bytes, header);
  return {bytes, std::move(payload)};
}

constexpr wire::MessageKind kind_of(const wire::PlainHeader&) { return wire::MessageKind::kPlain; }
constexpr wire::MessageKind kind_of(const wire::RoundHeader&) { return wire::MessageKind::kRound; }

}  // namespace

wire::PlainHeader::Needs on_wire(const Needs& needs) {
  const Nature& w = needs.weights;
  return {{wire::share_of_255(w.delay), wire::share_of_255(w.bandwidth),
           wire::share_of_255(w.reliability), wire::share_of_255(w.security)},
          wire::share_of_255(needs.min_security)};
}

Needs needs_of(const wire::PlainHeader& header) {
  if (!header.needs) return {};
  const auto share = [](std::uint8_t of_255) { return of_255 / 255.0; };
  const auto& w = header.needs->weights;
  return {{share(w[0]), share(w[1]), share(w[2]), share(w[3])}, share(header.needs->min_security)};
}

Itinerary::Itinerary(const Plan& plan) {
  for (std::uint8_t v = 0; v < kMaxVariants; ++v) {
    Carriers c{.variant = v};
    for (const Assignment& send : plan.sends) {
      if (send.variant != v) continue;
      switch (send.role) {
        case SendRole::kShare:
          c.protection.divided = true;
          [[fallthrough]];
        case SendRole::kWhole:
          c.links.push_back(send.link);
          break;
        case SendRole::kParity:
          c.protection.symbols.add(send.link);
          break;
        case SendRole::kShadow:
          c.protection.rescue.add(send.link);
          break;
      }
    }
    if (c.sets_out() || (!empty() && !c.protection.rescue.empty())) push_back(c);
  }
}

void Itinerary::settle_merge(const Policy& policy) {
  const std::uint8_t best = front().variant;
  for (std::size_t i = 1; i < size_; ++i) {
    Carriers& c = variants_[i];
    const bool better_may_come = c.sets_out() || !c.protection.rescue.empty();
    c.awaits_better = better_may_come && policy.merge({c.variant, best, false}) == Merge::kHold;
  }
}

std::size_t Itinerary::bytes(std::span<const std::size_t> sizes, wire::MessageKind kind) const {
  std::size_t sum = 0;
  for (const Carriers& c : *this) sum += wire::header_bytes(kind) + sizes[c.variant];
  return sum;
}

Sizes sizes_of(const Variants& variants) {
  Sizes sizes;
  for (const Bytes& variant : variants) sizes.push_back(variant.size());
  return sizes;
}

flow::PathSet allowed_of(const Policy& policy, std::span<const LinkState> links) {
  flow::PathSet allowed;
  for (const LinkState& link : links) {
    if (policy.allows(link)) allowed.add(link.id);
  }
  return allowed;
}

void seek_rate(TimePoint now, peers::Peer& peer, const Plan& plan, const Itinerary& itinerary,
               const QoS& qos, std::size_t best_bytes) {
  if (!itinerary.empty() && itinerary.front().variant == 0 && !plan.under_floor) return;
  peer.want(now, plan::rate_wanted(qos, best_bytes));
}

template <class Header>
AllDispatched dispatch(TimePoint now, peers::Peer& peer, Header header, const Itinerary& itinerary,
                       const flow::Sender::Times& times, const flow::PathSet& repairs,
                       Variants& variants) {
  constexpr wire::MessageKind kKind = kind_of(Header{});
  AllDispatched out;
  std::optional<MessageId> better;
  for (const Carriers& c : itinerary) {
    wire::MessageBytes message = with(header, c, std::move(variants[c.variant]));
    if (!c.sets_out()) {
      out.push_back(
          {c.variant, peer.sender().add_alternative(now, out.back().message, std::move(message),
                                                    c.protection.rescue)});
      continue;
    }
    const MessageId id =
        peer.send(now, times, std::move(message), c.links, repairs, kKind, c.protection);
    out.push_back({c.variant, id});
    // Once a variant of a plain message is there, Messages cancels what is not better. Nobody does
    // that for a round, where the repairs of a small image that is not wanted any more delay the
    // next frame.
    if (kKind == wire::MessageKind::kRound && better) peer.sender().supersede(*better, id);
    better = id;
  }
  return out;
}

template AllDispatched dispatch(TimePoint, peers::Peer&, wire::PlainHeader, const Itinerary&,
                                const flow::Sender::Times&, const flow::PathSet&, Variants&);
template AllDispatched dispatch(TimePoint, peers::Peer&, wire::RoundHeader, const Itinerary&,
                                const flow::Sender::Times&, const flow::PathSet&, Variants&);

}  // namespace interneuron::dispatch
