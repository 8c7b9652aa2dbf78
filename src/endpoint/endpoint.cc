#include "interneuron/endpoint.h"

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <string>

#include "endpoint/dispatch.h"
#include "endpoint/origins.h"
#include "endpoint/peers.h"
#include "endpoint/stages.h"
#include "plan/budget.h"

namespace interneuron {
class Endpoint::Impl {
 public:
  Impl(const EndpointOptions& options, TimePoint now)
      : dispatch_(options.session, options.policies),
        origins_(options.session, options.pipelines),
        peers_({options.session, options.accept_peers, options.max_peers, options.repair, now}),
        raw_now_(now) {
    if (options.session.value == 0) {
      throw std::invalid_argument("endpoint: the session must not be 0; draw it at random");
    }
    for (const PipelineConfig& config : options.pipelines) {
      if (dispatch_.policy(wire::policy_id(config.policy)) == nullptr) {
        throw std::invalid_argument("pipeline " + std::to_string(config.id.value) + ": policy '" +
                                    config.policy + "' is not registered");
      }
    }
  }

  void add_link(TimePoint, LinkId link, const LinkInfo& info) { peers_.add_link(link, info); }

  void remove_link(TimePoint raw, LinkId link) {
    for (PathChanged& change : peers_.remove_link(tick(raw), link)) {
      events_.emplace_back(std::move(change));
    }
  }

  PeerId connect(TimePoint raw, std::span<const std::pair<LinkId, Address>> addresses) {
    return peers_.connect(tick(raw), addresses);
  }

  bool add_path(TimePoint raw, PeerId peer, LinkId link, const Address& address) {
    return peers_.add_path(tick(raw), peer, link, address);
  }

  bool request_train(TimePoint raw, PeerId peer, LinkId link) {
    return peers_.request_train(tick(raw), peer, link);
  }

  RoundRef begin_round(TimePoint raw, PipelineId pipeline) {
    const TimePoint now = advance(raw);
    RoundContext context = origins_.begin(now, pipeline);
    const RoundRef round = context.header.round;
    const Duration deadline = context.header.deadline();
    stages_.open(now, round, std::move(context), deadline);
    return round;
  }

  bool submit(TimePoint raw, const RoundRef& round, Variants variants, MessageClass message_class,
              std::optional<PeerId> to) {
    const TimePoint now = advance(raw);
    Dispatch::check(variants);
    RoundContext* found = stages_.context(round);
    if (found == nullptr) return false;
    RoundContext context = *found;
    end_computations(now, context);
    note_spent(now, context, found->stage);
    if (context.stage == context.header.stages) {
      stages_.close(round);
      return finish_at_origin(now, context, std::move(variants.front()));
    }
    stages_.close(round);
    Peer* peer = destination(context, to);
    if (peer == nullptr) return false;
    choose_mode(now, context, *peer, message_class, Dispatch::sizes_of(variants), {});
    const auto clock = clock_of(now, context.header, peers_.find(context.from));
    Planned planned = dispatch_.send(now, *peer, context, clock, variants, message_class,
                                     guidance(now, context, clock));
    const bool sent = !planned.plan.sends.empty();
    guard::Origin* origin = origins_.find(round);
    if (!planned.plan.refused.empty() && origin != nullptr) origin->stay_local(round.round);
    events_.emplace_back(std::move(planned));
    return sent;
  }

  Plan preview(TimePoint raw, const RoundRef& round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs,
               std::optional<PeerId> to) {
    const TimePoint now = advance(raw);
    RoundContext* found = stages_.context(round);
    if (found == nullptr || found->stage == found->header.stages) return {};
    Peer* peer = destination(*found, to);
    if (peer == nullptr) return {};
    choose_mode(now, *found, *peer, message_class, variant_bytes, costs);
    wire::RoundHeader header = found->header;
    header.stage = static_cast<std::uint8_t>(found->stage + 1);
    header.message_class = message_class;
    const auto clock = clock_of(now, header, peers_.find(found->from));
    found->previewed =
        Previewed{dispatch_.plan(peer->links(now), header, {qos_of(header), variant_bytes, costs},
                                 guidance(now, *found, clock)),
                  variant_bytes.size()};
    return found->previewed->plan;
  }

  std::size_t begin_computation(TimePoint raw, const RoundRef& round,
                                std::span<const LevelProfile> levels, std::size_t top) {
    const TimePoint now = advance(raw);
    RoundContext* context = stages_.context(round);
    if (context == nullptr || levels.empty()) return top;
    wire::RoundHeader& h = context->header;
    const guard::LevelChoice choice =
        observer_of(h, context->from.value_or(PeerId{}))
            .begin_computation(now, stage_end(h, context->stage), levels,
                               std::min(top, levels.size() - 1), context->verdict);
    context->began = now;
    h.level_used = static_cast<std::uint8_t>(std::min<std::size_t>(choice.level, 254));
    h.excess = static_cast<std::int16_t>(
        h.to_steps(choice.excess.value_or(Duration::zero()), INT16_MIN, INT16_MAX));
    return choice.level;
  }

  void local_result(TimePoint raw, const RoundRef& round, Bytes result) {
    advance(raw);
    if (guard::Origin* origin = origins_.find(round)) {
      origin->local_result(round.round, std::move(result));
    }
  }

  void handle_datagram(TimePoint raw, const Datagram& datagram) {
    const TimePoint now = tick(raw);
    // What was due before this instant happened before; what is due at it happens after (arrivals
    // first).
    run_timers(now - Duration{1});
    LinkCounters& counters = peers_.counters(datagram.link);
    const auto packet = wire::parse(datagram.bytes);
    if (!packet) {
      ++counters.malformed_packets;
      return;
    }
    if (packet->header.type == wire::PacketType::kEcho) {
      const bool answered = peers_.reflect(now, *packet, datagram);
      ++(answered ? counters.received_packets : counters.refused_packets);
      if (answered) counters.received_bytes += datagram.bytes.size();
      return;
    }
    const auto [peer, restarted] = peers_.whose(now, packet->header, datagram);
    if (peer == nullptr) {
      ++counters.refused_packets;
      return;
    }
    if (restarted) {
      stages_.forget_clock(peer->identity().id);
      events_.emplace_back(PeerRestarted{peer->identity().id});
    }
    const Peer::Input input = peer->handle(now, *packet, datagram.bytes.size());
    if (input.duplicate) {
      ++counters.duplicate_packets;
      return;
    }
    ++counters.received_packets;
    counters.received_bytes += datagram.bytes.size();
    react(now, *peer, input);
  }

  void handle_timeout(TimePoint raw) { advance(raw); }

  std::optional<Transmit> poll_transmit(TimePoint raw, std::span<std::byte> buffer) {
    return peers_.poll(tick(raw), buffer);
  }

  std::optional<Event> poll_event() {
    if (events_.empty()) return std::nullopt;
    Event event = std::move(events_.front());
    events_.pop_front();
    return event;
  }

  std::optional<TimePoint> next_timeout() const {
    std::optional<TimePoint> next = stages_.next_timeout();
    const auto consider = [&next](std::optional<TimePoint> t) {
      if (t && (!next || *t < *next)) next = t;
    };
    consider(origins_.next_timeout());
    const TimePoint now = raw_now_ + shift_;
    consider(peers_.next_timeout(now));
    // What is due already is due now: the peer's bytes may make an instant of any value.
    if (next) *next = std::max(*next, now) - shift_;
    return next;
  }

  std::vector<PeerId> peers() const { return peers_.ids(); }
  std::vector<LinkState> links(TimePoint now, PeerId peer) const {
    return peers_.links(now + shift_, peer);
  }
  LinkCounters link_counters(LinkId link) const { return peers_.totals(link); }
  EndpointCounters counters() const {
    EndpointCounters out = counters_;
    out.fragments_cancelled = peers_.cancelled();
    return out;
  }
  std::size_t reassembly_bytes() const { return peers_.reassembly_bytes(); }

 private:
  // --- time

  // The endpoint's own time: never goes back, whatever the host's does.
  TimePoint tick(TimePoint raw) {
    if (raw < raw_now_) shift_ += raw_now_ - raw;
    raw_now_ = raw;
    return raw + shift_;
  }

  TimePoint advance(TimePoint raw) {
    const TimePoint now = tick(raw);
    run_timers(now);
    return now;
  }

  // Everything due at or before `now`: held variants first, then the rounds' deadlines, then the
  // rest.
  void run_timers(TimePoint now) {
    for (Stages::Released& released : stages_.release(now)) release(std::move(released));
    for (RoundDone& done : origins_.expire(now)) {
      stages_.close(done.round);
      events_.emplace_back(std::move(done));
    }
    Peers::Expired expired = peers_.handle_timeout(now);
    counters_.messages_expired += expired.messages;
    for (PathChanged& change : expired.changes) events_.emplace_back(std::move(change));
    for (const PeerId id : expired.lost) events_.emplace_back(PeerLost{id});
  }

  void react(TimePoint now, Peer& peer, const Peer::Input& input) {
    const PeerId id = peer.identity().id;
    if (input.became_ready) events_.emplace_back(PeerReady{id});
    if (input.clock_stepped) stages_.forget_clock(id);
    if (input.refused) ++counters_.reassembly_refused;
    while (auto change = peer.poll_change()) events_.emplace_back(std::move(*change));
    if (input.message) complete(now, peer, *input.message);
  }

  // --- rounds

  void complete(TimePoint now, Peer& peer, const Bytes& message) {
    const auto header = wire::parse_round_header(message);
    const bool mine = header && origins_.is_mine(header->round);
    if (!header || (mine && !origins_.has_begun(header->round)) ||
        (!mine && header->stage == header->stages)) {
      ++counters_.bad_messages;
      return;
    }
    ++counters_.messages_completed;
    Arrived arrived{*header, Bytes(message.begin() + wire::kRoundHeaderBytes, message.end()),
                    peer.identity().id};
    guard::StageGuard& observer = observer_of(*header, arrived.from);
    if (!mine) {
      observer.learn(now, header->round.round, header->indicator, recent_e2e(*header));
    }
    const auto clock = clock_of(now, *header, &peer);
    switch (stages_.arrive(now, arrived, dispatch_.policy(header->policy), clock, observer)) {
      case Stages::Action::kHold:
        return;
      case Stages::Action::kDrop:
        ++counters_.messages_superseded;
        return;
      case Stages::Action::kServe:
        if (header->stage == header->stages) {
          finish(now, *header, std::move(arrived.payload));
        } else {
          events_.emplace_back(stages_.serve(now, std::move(arrived), clock, observer));
        }
    }
  }

  void release(Stages::Released released) {
    const wire::RoundHeader header = released.arrived.header;
    if (header.stage == header.stages) {
      finish(released.hold.until, header, std::move(released.arrived.payload));
      return;
    }
    guard::StageGuard& observer = observer_of(header, released.arrived.from);
    events_.emplace_back(stages_.serve_held(std::move(released), observer));
  }

  // The last stage ends: a result for a round that began here.
  bool finish(TimePoint now, const wire::RoundHeader& header, Bytes result) {
    stages_.finish(header);
    auto done = origins_.find(header.round)
                    ->remote_result(now, header.round.round, std::move(result), header.degraded,
                                    spent_of(header));
    if (!done) {
      ++counters_.messages_late;
      return false;
    }
    stages_.close(header.round);
    events_.emplace_back(std::move(*done));
    return true;
  }

  bool finish_at_origin(TimePoint now, const RoundContext& context, Bytes result) {
    return origins_.is_mine(context.header.round) && finish(now, context.header, std::move(result));
  }

  guard::StageGuard& observer_of(const wire::RoundHeader& header, PeerId via) {
    if (guard::Origin* origin = origins_.find(header.round)) return origin->observer();
    return stages_.observer(header, via);
  }

  // The clock between the origin of a round and here: the hops so far plus the last one.
  std::optional<guard::ClockView> clock_of(TimePoint now, const wire::RoundHeader& header,
                                           Peer* peer) {
    if (origins_.is_mine(header.round) || peer == nullptr) return std::nullopt;
    auto view = peer->clock(now);
    if (view) view->alpha = wrapping_add(view->alpha, header.alpha_sum.count());
    return view;
  }

  Peer* destination(const RoundContext& context, std::optional<PeerId> to) {
    if (to) return peers_.find(to);
    if (context.from) return peers_.find(context.from);
    return peers_.only();
  }

  // submit() is the hand-over of the application's result: computations up to the next
  // communication end now.
  void end_computations(TimePoint now, RoundContext& context) {
    while (context.stage < context.header.stages &&
           !context.header.is_communication(context.stage + 1)) {
      ++context.stage;
      guard::StageGuard& observer = observer_of(context.header, context.from.value_or(PeerId{}));
      context.verdict =
          observer.end_stage(now, stage_end(context.header, context.stage),
                             clock_of(now, context.header, peers_.find(context.from)));
    }
  }

  // What the header is to say of computations that ended since stage `since`.
  static void note_spent(TimePoint now, RoundContext& context, std::size_t since) {
    if (context.stage == since) return;
    wire::RoundHeader& h = context.header;
    h.variant_used = h.variant;
    h.computed = static_cast<std::uint16_t>(
        h.to_steps(h.from_steps(h.computed) + (now - context.began), 0, UINT16_MAX));
  }

  static guard::Spent spent_of(const wire::RoundHeader& h) {
    guard::Spent spent;
    if (h.level_used != wire::kNoneUsed) spent.level = h.level_used;
    if (h.variant_used == wire::kNoneUsed) return spent;
    spent.variant = h.variant_used;
    spent.computed = h.from_steps(h.computed);
    if (spent.level) spent.excess = h.from_steps(h.excess);
    return spent;
  }

  // What the guard tells the policy of a round's next transmission.
  Guidance guidance(TimePoint now, const RoundContext& context,
                    const std::optional<guard::ClockView>& clock) {
    const wire::RoundHeader& h = context.header;
    Guidance out{.degraded = context.verdict.late};
    if (guard::Origin* origin = origins_.find(h.round)) {
      out.time_left = h.deadline() - elapsed_across(h.t0, now);
      out.local_quality = origin->config().fallback.local;
      if (!context.from) out.levels = origin->config().levels;
    } else {
      out.local_quality = h.local_quality / 255.0;
      if (clock) {
        const Duration theta = elapsed_across(h.t0, now);
        out.time_left =
            Duration{wrapping_sub(wrapping_add(h.deadline().count(), clock->alpha), theta.count())};
      }
    }
    return out;
  }

  // The first transmission of a round that began here, under a guard that weighs its modes.
  void choose_mode(TimePoint now, RoundContext& context, const Peer& peer,
                   MessageClass message_class, std::span<const std::size_t> variant_bytes,
                   std::span<const VariantCost> costs) {
    guard::Origin* origin = origins_.find(context.header.round);
    if (context.mode_chosen || context.from || origin == nullptr || !origin->weighs()) return;
    wire::RoundHeader header = context.header;
    header.message_class = message_class;
    const Offer offer{qos_of(header), variant_bytes, costs};
    const Links links = peer.links(now);
    Guidance ask = guidance(now, context, std::nullopt);
    const auto forecast = [&](bool degraded) {
      ask.degraded = degraded;
      return forecast_answers(dispatch_.plan(links, header, offer, ask), offer, links);
    };
    const guard::Forecast normal = forecast(false);
    context.verdict.late = origin->choose_degraded(now, header.round.round, normal, forecast(true));
    context.mode_chosen = true;
  }

  Dispatch dispatch_;
  Origins origins_;
  Peers peers_;
  Stages stages_;
  std::deque<Event> events_;
  EndpointCounters counters_;
  TimePoint raw_now_;
  Duration shift_{};
};

Endpoint::Endpoint(EndpointOptions options, TimePoint now)
    : impl_(std::make_unique<Impl>(options, now)) {}
Endpoint::~Endpoint() = default;
Endpoint::Endpoint(Endpoint&&) noexcept = default;
Endpoint& Endpoint::operator=(Endpoint&&) noexcept = default;

void Endpoint::add_link(TimePoint now, LinkId link, const LinkInfo& info) {
  impl_->add_link(now, link, info);
}
void Endpoint::remove_link(TimePoint now, LinkId link) { impl_->remove_link(now, link); }
PeerId Endpoint::connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses) {
  return impl_->connect(now, addresses);
}
RoundRef Endpoint::begin_round(TimePoint now, PipelineId pipeline) {
  return impl_->begin_round(now, pipeline);
}
bool Endpoint::add_path(TimePoint now, PeerId peer, LinkId link, const Address& address) {
  return impl_->add_path(now, peer, link, address);
}
bool Endpoint::request_train(TimePoint now, PeerId peer, LinkId link) {
  return impl_->request_train(now, peer, link);
}
bool Endpoint::submit(TimePoint now, RoundRef round, Variants variants, MessageClass message_class,
                      std::optional<PeerId> to) {
  return impl_->submit(now, round, std::move(variants), message_class, to);
}
Plan Endpoint::preview(TimePoint now, RoundRef round, std::span<const std::size_t> variant_bytes,
                       MessageClass message_class, std::span<const VariantCost> costs,
                       std::optional<PeerId> to) {
  return impl_->preview(now, round, variant_bytes, message_class, costs, to);
}
std::size_t Endpoint::begin_computation(TimePoint now, RoundRef round,
                                        std::span<const LevelProfile> levels, std::size_t top) {
  return impl_->begin_computation(now, round, levels, top);
}
void Endpoint::local_result(TimePoint now, RoundRef round, Bytes result) {
  impl_->local_result(now, round, std::move(result));
}
void Endpoint::handle_datagram(TimePoint now, const Datagram& datagram) {
  impl_->handle_datagram(now, datagram);
}
void Endpoint::handle_timeout(TimePoint now) { impl_->handle_timeout(now); }
std::optional<Transmit> Endpoint::poll_transmit(TimePoint now, std::span<std::byte> buffer) {
  return impl_->poll_transmit(now, buffer);
}
std::optional<Event> Endpoint::poll_event() { return impl_->poll_event(); }
std::optional<TimePoint> Endpoint::next_timeout() const { return impl_->next_timeout(); }
std::vector<PeerId> Endpoint::peers() const { return impl_->peers(); }
std::vector<LinkState> Endpoint::links(TimePoint now, PeerId peer) const {
  return impl_->links(now, peer);
}
LinkCounters Endpoint::link_counters(LinkId link) const { return impl_->link_counters(link); }
EndpointCounters Endpoint::counters() const { return impl_->counters(); }
std::size_t Endpoint::reassembly_bytes() const { return impl_->reassembly_bytes(); }

}  // namespace interneuron
