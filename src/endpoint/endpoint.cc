#include "interneuron/endpoint.h"

#include <algorithm>
#include <deque>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

#include "endpoint/peers.h"
#include "endpoint/stages.h"
#include "guard/origin.h"
#include "plan/plan_message.h"

namespace interneuron {
namespace {

std::array<std::uint8_t, 4> quantised(const Nature& needs) {
  const auto q = [](double w) {
    return static_cast<std::uint8_t>(std::clamp(w, 0.0, 1.0) * 255.0 + 0.5);
  };
  return {q(needs.delay), q(needs.bandwidth), q(needs.reliability), q(needs.security)};
}

std::uint32_t to_us(Duration d) {
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(d).count(), 1, UINT32_MAX));
}

}  // namespace

class Endpoint::Impl {
 public:
  Impl(EndpointOptions options, TimePoint now)
      : options_(std::move(options)),
        peers_({options_.session, options_.accept_peers, options_.max_peers, options_.repair, now}),
        raw_now_(now) {
    if (options_.session.value == 0) {
      throw std::invalid_argument("endpoint: the session must not be 0; draw it at random");
    }
    for (const auto& policy : options_.policies) {
      if (policy == nullptr) throw std::invalid_argument("endpoint: a policy is null");
      policies_[wire::policy_id(policy->name())] = policy.get();
    }
    if (policies_.empty()) throw std::invalid_argument("endpoint: no policy is registered");
    for (const PipelineConfig& config : options_.pipelines) {
      if (!policies_.contains(wire::policy_id(config.policy))) {
        throw std::invalid_argument("pipeline " + std::to_string(config.id.value) + ": policy '" +
                                    config.policy + "' is not registered");
      }
      if (!origins_.try_emplace(config.id, config, options_.session).second) {
        throw std::invalid_argument("pipeline " + std::to_string(config.id.value) +
                                    ": given twice");
      }
    }
  }

  void add_link(TimePoint, LinkId link, const LinkInfo& info) { peers_.add_link(link, info); }

  void remove_link(TimePoint raw, LinkId link) { peers_.remove_link(tick(raw), link); }

  PeerId connect(TimePoint raw, std::span<const std::pair<LinkId, Address>> addresses) {
    return peers_.connect(tick(raw), addresses);
  }

  RoundRef begin_round(TimePoint raw, PipelineId pipeline) {
    const TimePoint now = advance(raw);
    const auto it = origins_.find(pipeline);
    if (it == origins_.end()) {
      throw std::invalid_argument("begin_round: no pipeline " + std::to_string(pipeline.value));
    }
    const guard::Origin::Begun begun = it->second.begin(now);
    begun_[pipeline] = begun.ref.round.value + 1;
    const PipelineConfig& config = it->second.config();
    RoundContext context;
    wire::RoundHeader& h = context.header;
    h.round = begun.ref;
    h.stages = static_cast<std::uint8_t>(config.stages.size());
    h.communication = 0;
    for (std::size_t i = 0; i < config.stages.size(); ++i) {
      if (config.stages[i] == StageKind::kCommunication) {
        h.communication = static_cast<std::uint16_t>(h.communication | (1U << i));
      }
    }
    h.needs = quantised(config.needs);
    h.policy = wire::policy_id(config.policy);
    h.t0 = as_wire(now);
    h.x_permille = begun.sent.x_permille;
    h.deadline_us = to_us(config.deadline);
    h.period_us = to_us(config.period);
    h.indicator = it->second.indicator(begun.ref.round);
    // The timeout handler's order for the first transmission speaks the language of a verdict.
    context.verdict.late = begun.sent.degraded;
    stages_.open(now, begun.ref, std::move(context), config.deadline);
    return begun.ref;
  }

  bool submit(TimePoint raw, const RoundRef& round, Variants variants, MessageClass message_class,
              std::optional<PeerId> to) {
    const TimePoint now = advance(raw);
    check_variants(variants);
    RoundContext* found = stages_.context(round);
    if (found == nullptr) return false;
    RoundContext context = *found;
    end_computations(now, context);
    if (context.stage == context.header.stages) {
      stages_.close(round);
      return finish_at_origin(now, context, std::move(variants.front()));
    }
    stages_.close(round);
    Peer* peer = destination(context, to);
    if (peer == nullptr) return false;
    return transmit(now, *peer, context, std::move(variants), message_class);
  }

  void local_result(TimePoint raw, const RoundRef& round, Bytes result) {
    advance(raw);
    const auto it = origins_.find(round.pipeline);
    if (round.origin == options_.session && it != origins_.end()) {
      it->second.local_result(round.round, std::move(result));
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
    for (const auto& [id, origin] : origins_) consider(origin.next_timeout());
    consider(peers_.next_timeout());
    // What is due already is due now: the peer's bytes may make an instant of any value.
    if (next) *next = std::max(*next, raw_now_ + shift_) - shift_;
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
    for (auto& [id, origin] : origins_) {
      for (RoundDone& done : origin.expire(now)) {
        stages_.close(done.round);
        events_.emplace_back(std::move(done));
      }
    }
    const Peers::Expired expired = peers_.handle_timeout(now);
    counters_.messages_expired += expired.messages;
    for (const PeerId id : expired.lost) events_.emplace_back(PeerLost{id});
  }

  void react(TimePoint now, Peer& peer, const Peer::Input& input) {
    const PeerId id = peer.identity().id;
    if (input.became_ready) events_.emplace_back(PeerReady{id});
    if (input.clock_stepped) stages_.forget_clock(id);
    if (input.refused) ++counters_.reassembly_refused;
    if (input.message) complete(now, peer, *input.message);
  }

  // --- rounds

  void complete(TimePoint now, Peer& peer, const Bytes& message) {
    const auto header = wire::parse_round_header(message);
    const bool mine = header && header->round.origin == options_.session;
    // A round that has not begun yet would push those under way out of the books.
    if (!header || (mine && header->round.round.value >= rounds_begun(header->round.pipeline)) ||
        (!mine && header->stage == header->stages)) {
      ++counters_.bad_messages;
      return;
    }
    ++counters_.messages_completed;
    Arrived arrived{*header, Bytes(message.begin() + wire::kRoundHeaderBytes, message.end()),
                    peer.identity().id};
    guard::Observer& observer = observer_of(header->round, arrived.from);
    if (!mine) observer.learn(now, header->round.round, header->indicator);
    const auto clock = clock_of(now, *header, &peer);
    const auto policy = policies_.find(header->policy);
    switch (stages_.arrive(now, arrived, policy == policies_.end() ? nullptr : policy->second,
                           clock, observer)) {
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
    guard::Observer& observer = observer_of(header.round, released.arrived.from);
    events_.emplace_back(stages_.serve_held(std::move(released), observer));
  }

  // The last stage ends: a result for a round that began here.
  bool finish(TimePoint now, const wire::RoundHeader& header, Bytes result) {
    stages_.finish(header);
    const auto it = origins_.find(header.round.pipeline);
    auto done =
        it->second.remote_result(now, header.round.round, std::move(result), header.degraded);
    if (!done) {
      ++counters_.messages_late;
      return false;
    }
    stages_.close(header.round);
    events_.emplace_back(std::move(*done));
    return true;
  }

  std::uint32_t rounds_begun(PipelineId pipeline) const {
    const auto it = begun_.find(pipeline);
    return it == begun_.end() ? 0 : it->second;
  }

  bool finish_at_origin(TimePoint now, const RoundContext& context, Bytes result) {
    if (context.header.round.origin != options_.session) return false;
    return finish(now, context.header, std::move(result));
  }

  guard::Observer& observer_of(const RoundRef& round, PeerId via) {
    if (round.origin == options_.session) return origins_.at(round.pipeline).observer();
    return stages_.observer(round, via);
  }

  // The clock between the origin of a round and here: the hops so far plus the last one.
  std::optional<guard::ClockView> clock_of(TimePoint now, const wire::RoundHeader& header,
                                           Peer* peer) {
    if (header.round.origin == options_.session || peer == nullptr) return std::nullopt;
    auto view = peer->clock(now);
    if (view) view->alpha = wrapping_add(view->alpha, header.alpha_sum.count());
    return view;
  }

  Peer* destination(const RoundContext& context, std::optional<PeerId> to) {
    if (to) return peers_.find(to);
    if (context.from) return peers_.find(context.from);
    return peers_.only();
  }

  static void check_variants(const Variants& variants) {
    if (variants.empty() || variants.size() > kMaxVariants) {
      throw std::invalid_argument("submit: " + std::to_string(variants.size()) +
                                  " variants; give 1 to " + std::to_string(kMaxVariants));
    }
    for (const Bytes& bytes : variants) {
      if (bytes.size() > kMaxMessageBytes) {
        throw std::invalid_argument("submit: a variant of " + std::to_string(bytes.size()) +
                                    " bytes; at most " + std::to_string(kMaxMessageBytes));
      }
    }
  }

  // submit() is the hand-over of the application's result: computations up to the next
  // communication end now.
  void end_computations(TimePoint now, RoundContext& context) {
    while (context.stage < context.header.stages &&
           !context.header.is_communication(context.stage + 1)) {
      ++context.stage;
      guard::Observer& observer =
          observer_of(context.header.round, context.from.value_or(PeerId{}));
      context.verdict =
          observer.end_stage(now, stage_end(context.header, context.stage),
                             clock_of(now, context.header, peers_.find(context.from)));
    }
  }

  bool transmit(TimePoint now, Peer& peer, const RoundContext& context, Variants variants,
                MessageClass message_class) {
    wire::RoundHeader header = context.header;
    header.stage = static_cast<std::uint8_t>(context.stage + 1);
    header.message_class = message_class;
    header.degraded = context.verdict.late;
    const auto clock = clock_of(now, context.header, peers_.find(context.from));
    if (clock) header.alpha_sum = Duration{clock->alpha};
    // A round that passes its origin starts over: the origin's own clock has no offset.
    if (header.round.origin == options_.session) header.alpha_sum = Duration::zero();

    std::vector<std::size_t> sizes;
    for (const Bytes& v : variants) sizes.push_back(v.size());
    const QoS qos = qos_of(header);
    const auto policy = policies_.find(header.policy);
    // Without the policy that the origin names, any built-in rule serves; the first registered one
    // stands in.
    const Policy* rule = policy != policies_.end() ? policy->second : policies_.begin()->second;
    const Plan plan = plan_message(*rule, {qos, sizes}, peer.links(now), {header.degraded});
    events_.emplace_back(Planned{header.round, header.stage, plan});
    if (plan.sends.empty()) return false;

    header.best_planned = std::ranges::min(plan.sends, {}, &Assignment::variant).variant;
    const TimePoint deadline = deadline_of(now, header, clock);
    for (std::size_t v = 0; v < variants.size(); ++v) {
      std::vector<LinkId> paths;
      for (const Assignment& a : plan.sends) {
        if (a.variant == v) paths.push_back(a.link);
      }
      if (paths.empty()) continue;
      header.variant = static_cast<std::uint8_t>(v);
      std::array<std::byte, wire::kRoundHeaderBytes> opening;
      wire::write_round_header(opening, header);
      Bytes message;
      message.reserve(opening.size() + variants[v].size());
      message.insert(message.end(), opening.begin(), opening.end());
      message.insert(message.end(), variants[v].begin(), variants[v].end());
      peer.send(now, deadline, header.deadline(), std::move(message), paths);
    }
    return true;
  }

  // t0 + D_N on this host's clock; as late as possible while the origin's clock is not known.
  TimePoint deadline_of(TimePoint now, const wire::RoundHeader& header,
                        const std::optional<guard::ClockView>& clock) const {
    if (header.round.origin == options_.session) {
      return when_elapsed(header.t0, header.deadline());
    }
    if (!clock) return now + header.deadline();
    const TimePoint by_clock =
        when_elapsed(header.t0, Duration{wrapping_add(clock->alpha, header.deadline().count())});
    return std::min(by_clock, now + header.deadline());
  }

  EndpointOptions options_;
  std::map<std::uint32_t, const Policy*> policies_;  // by wire id
  std::map<PipelineId, guard::Origin> origins_;
  std::map<PipelineId, std::uint32_t> begun_;  // rounds so far
  Peers peers_;
  Stages stages_;
  std::deque<Event> events_;
  EndpointCounters counters_;
  TimePoint raw_now_;
  Duration shift_{};
};

Endpoint::Endpoint(EndpointOptions options, TimePoint now)
    : impl_(std::make_unique<Impl>(std::move(options), now)) {}
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
bool Endpoint::submit(TimePoint now, RoundRef round, Variants variants, MessageClass message_class,
                      std::optional<PeerId> to) {
  return impl_->submit(now, round, std::move(variants), message_class, to);
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
