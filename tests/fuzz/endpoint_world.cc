#include "tests/fuzz/endpoint_world.h"

#include <malloc.h>
#include <netinet/in.h>

#include <algorithm>
#include <cstring>

#include "core/wire/packet.h"
#include "tests/fuzz/finding.h"

// Where AddressSanitizer is linked, its allocator counts and malloc's own knows nothing.
extern "C" __attribute__((weak)) std::size_t __sanitizer_get_current_allocated_bytes();

namespace interneuron::fuzz {
namespace {

using namespace std::chrono_literals;

// Small, so that inputs reach them.
constexpr std::size_t kBudget = 1 << 20;
constexpr std::size_t kMostPeers = 4;
// What the endpoint and its partner may hold on the heap beside those budgets. No measurement
// behind this value: far above what four peers need, far below what a leak or an unbounded queue of
// a few hundred packets of claims takes.
constexpr std::int64_t kMostHeap = std::int64_t{4} * kBudget + (16 << 20);

// After so many turns of (due, drain) at one instant a loop spins. One is usual.
constexpr int kMostTurns = 8;
// Datagrams or events at one instant. More than a megabyte under way can make.
constexpr std::size_t kMostAtOnce = 20'000;
// Wake-ups in a row that bring nothing within kShort: a timer that hardly moves.
constexpr std::size_t kMostIdle = 100;
constexpr Duration kShort = 1ms;
// Wake-ups that a program may cause, so that its time is bounded; then time only jumps.
constexpr std::size_t kWakes = 400;
// Handshakes of hosts, which take more time than anything else.
constexpr std::size_t kHandshakes = 12;
constexpr std::uint64_t kMostAmplification = 3;

constexpr std::size_t kIpv6Hosts = 2;
bool is_ipv6_host(std::size_t host) { return host >= kPartner - kIpv6Hosts && host < kPartner; }

std::size_t ip_bytes(const Address& address, std::size_t udp_payload) {
  return udp_payload + (address.size == sizeof(sockaddr_in6) ? kIpv6UdpBytes : kIpv4UdpBytes);
}

std::size_t heap_bytes() {
  if (__sanitizer_get_current_allocated_bytes != nullptr) {
    return __sanitizer_get_current_allocated_bytes();
  }
  const auto info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

PipelineConfig pipeline(std::uint8_t id, std::vector<StageKind> stages, GuardKind guard) {
  return PipelineConfig{.id = PipelineId{id}, .stages = std::move(stages), .guard = guard};
}

EndpointOptions options(SessionId session, bool accept, std::shared_ptr<const Security> security) {
  EndpointOptions out;
  out.session = session;
  out.policies = builtin_policies();
  out.pipelines = {
      pipeline(0, offload_stages(), GuardKind::kBudget),
      pipeline(1, {StageKind::kCommunication, StageKind::kCommunication}, GuardKind::kPaper)};
  out.accept_peers = accept;
  out.max_peers = kMostPeers;
  out.secret = {1, 2};
  out.reassembly_budget_bytes = kBudget;
  out.send_budget_bytes = kBudget;
  out.security = std::move(security);
  return out;
}

constexpr std::uint8_t kChallenge = 7;
constexpr std::uint8_t kAnswer = 8;
std::uint8_t type_of(ByteView bytes) {
  return bytes.empty() ? 0 : std::to_integer<std::uint8_t>(bytes[0]) & 0xfU;
}

LinkId id_of(std::size_t link) { return LinkId{static_cast<std::uint16_t>(link)}; }

}  // namespace

Address address_of(std::size_t host, std::size_t link) {
  Address out;
  if (is_ipv6_host(host)) {
    sockaddr_in6 name{};
    name.sin6_family = AF_INET6;
    name.sin6_port = htons(47000);
    name.sin6_addr.s6_addr[0] = 0xfd;
    name.sin6_addr.s6_addr[14] = static_cast<std::uint8_t>(link);
    name.sin6_addr.s6_addr[15] = static_cast<std::uint8_t>(host);
    std::memcpy(out.raw.data(), &name, sizeof name);
    out.size = sizeof name;
    return out;
  }
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_port = htons(47000);
  name.sin_addr.s_addr = htonl(static_cast<std::uint32_t>(0x0a000000U + link * 256 + host));
  std::memcpy(out.raw.data(), &name, sizeof name);
  out.size = sizeof name;
  return out;
}

World::World(Side side, Protection protection)
    : side_(side),
      now_(1h),
      keys_(protection == Protection::kSealed ? std::optional<Keys>(kHosts) : std::nullopt),
      endpoint_(options(kOwnSession, side == Side::kRoad, keys_ ? keys_->of_endpoint() : nullptr),
                now_),
      partner_(
          options(kPartnerSession, side == Side::kVehicle, keys_ ? keys_->of_partner() : nullptr),
          now_),
      handshakes_left_(kHandshakes),
      wakes_left_(kWakes),
      partner_wakes_left_(kWakes),
      heap_before_(heap_bytes()) {
  for (const std::size_t link : {0U, 1U}) {
    partner_.add_link(now_, id_of(link), {"nic", 1500, {}});
    add_link(link, {"nic", 1500, {}});
  }
  const std::array<std::size_t, 2> both{0, 1};
  if (side == Side::kVehicle) {
    connect(kPartner, both);
  } else {
    // The partner does not care for the endpoint's address.
    const std::pair<LinkId, Address> to[] = {{id_of(0), address_of(kPartner, 0)},
                                             {id_of(1), address_of(kPartner, 1)}};
    partner_.connect(now_, to);
  }
  drain_partner();
}

void World::feed(std::size_t host, std::size_t link, ByteView bytes, std::uint8_t ecn) {
  const Address from = address_of(host, link);
  Seen& seen = seen_[from.raw];
  seen.in_bytes += ip_bytes(from, bytes.size());
  keys_ ? note_sealed_proof(host, seen, bytes) : note_proof(seen, bytes);
  endpoint_.handle_datagram(now_, {id_of(link), from, bytes, ecn});
  drain();
}

void World::note_proof(Seen& from, ByteView bytes) const {
  const auto packet = wire::parse(bytes);
  if (!packet) return;
  if (packet->header.type == wire::PacketType::kFeedback && packet->feedback.echo == kOwnSession) {
    from.echoed = true;
  }
  if (type_of(bytes) != kAnswer) return;
  const ByteView body = bytes.subspan(wire::kHeaderBytes);
  for (const auto& token : from.tokens) {
    if (std::search(body.begin(), body.end(), token.begin(), token.end()) != body.end()) {
      from.answered = true;
    }
  }
}

// A challenge is the asker's session and the token, behind the header.
void World::note_challenge(Seen& to, ByteView bytes) {
  constexpr std::size_t kAt = wire::kHeaderBytes + 4;
  if (type_of(bytes) != kChallenge || bytes.size() < kAt + 16 + wire::kTagBytes) return;
  challenges_ = true;
  std::ranges::copy(bytes.subspan(kAt, 16), to.token.emplace().begin());
  to.tokens.insert(*to.token);
}

void World::take(const Transmit& transmit, ByteView bytes) {
  require(bytes.size() >= wire::kPacketOverhead && bytes.size() <= kMaxDatagramBytes,
          "a datagram has a size that none may have");
  require(links_.contains(transmit.link.value), "a datagram leaves over a link that is not there");
  Seen& seen = seen_[transmit.to.raw];
  keys_ ? note_sealed(transmit, seen, bytes) : note_challenge(seen, bytes);
  seen.out_bytes += ip_bytes(transmit.to, bytes.size());
  const bool proved =
      seen.named || seen.answered || (seen.echoed && !challenges_ && !keys_.has_value());
  if (!proved && seen.out_bytes > kMostAmplification * seen.in_bytes) {
    finding("an address that has not proved to be there got " + std::to_string(seen.out_bytes) +
            " bytes for " + std::to_string(seen.in_bytes));
  }
  if (const auto header = wire::peek(bytes)) seen.last_number = header->number;
  seen.last.assign(bytes.begin(), bytes.end());
  const auto is_partner = [&](std::size_t link) {
    return transmit.to == address_of(kPartner, link);
  };
  if (is_partner(transmit.link.value)) {
    launch({true, transmit.link.value, seen.last, transmit.ecn});
  }
}

void World::take(const Event& event) {
  if (const auto* fate = std::get_if<MessageFate>(&event)) {
    require(without_fate_.erase(fate->id.value) == 1, "a message has a second fate, or is unknown");
  } else if (const auto* done = std::get_if<RoundDone>(&event)) {
    require(without_answer_.erase(done->round) == 1, "a round has a second answer, or is unknown");
    require(done->e2e >= Duration::zero(), "a round ended before it began");
  } else if (const auto* delivered = std::get_if<Delivered>(&event)) {
    require(delivered->payload.size() <= kMaxMessageBytes, "a message is too large");
    const std::vector<LevelProfile> levels{{5ms, 8ms, {0.2}}, {20ms, 30ms, {0.5}}};
    require(endpoint_.begin_computation(now_, delivered->round, levels, 1) < levels.size(),
            "a level is out of range");
    endpoint_.submit(now_, delivered->round, {Bytes(50)}, MessageClass::kResult);
  } else if (const auto* message = std::get_if<Message>(&event)) {
    require(message->bytes.size() <= kMaxMessageBytes, "a message is too large");
  }
}

bool World::drain_events() {
  bool any = false;
  for (std::size_t i = 0; i < kMostAtOnce; ++i) {
    const auto event = endpoint_.poll_event();
    if (!event) return any;
    any = true;
    take(*event);
  }
  finding("events do not end");
}

std::size_t World::drain_packets() {
  std::array<std::byte, kMaxDatagramBytes> buffer;
  for (std::size_t i = 0; i < kMostAtOnce; ++i) {
    const auto transmit = endpoint_.poll_transmit(now_, buffer);
    if (!transmit) return i;
    take(*transmit, ByteView(buffer).first(transmit->size));
  }
  finding("datagrams do not end");
}

void World::drain() {
  do {
    drain_packets();
    drain_answers();
  } while (drain_events());
}

void World::settle() {
  drain();
  for (int turn = 0; turn < kMostTurns; ++turn) {
    const auto next = endpoint_.next_timeout();
    if (!next || *next > now_) return;
    endpoint_.handle_timeout(now_);
    drain();
  }
  finding("the loop spins");
}

void World::pass(Duration by) {
  settle();
  const TimePoint end = now_ + by;
  std::size_t idle = 0;
  TimePoint idle_since = now_;
  while (wakes_left_ > 0) {
    const auto next = endpoint_.next_timeout();
    if (!next || *next > end) break;
    --wakes_left_;
    now_ = *next;
    endpoint_.handle_timeout(now_);
    const bool busy = drain_packets() > 0;
    if (drain_events() || busy) {
      idle = 0;
      idle_since = now_;
    }
    if (++idle > kMostIdle && now_ - idle_since < kShort) finding("the loop wakes for nothing");
    settle();
  }
  now_ = std::max(now_, end);
  endpoint_.handle_timeout(now_);
  settle();
  drain_partner();
}

void World::jump(Duration by) {
  now_ = std::max(now_ + by, TimePoint{1s});
  settle();
  drain_partner();
}

void World::finish() {
  // Beyond every deadline; then beyond what a fate is waited for after it.
  jump(kLongestDeadline + 1min);
  jump(1min);
  require(without_fate_.empty(), "a message has no fate");
  require(without_answer_.empty(), "a round has no answer");
}

void World::add_link(std::size_t link, const LinkInfo& info) {
  if (!links_.insert(link).second) return;
  endpoint_.add_link(now_, id_of(link), info);
  drain();
}

void World::remove_link(std::size_t link) {
  if (links_.erase(link) == 0) return;
  endpoint_.remove_link(now_, id_of(link));
  drain();
}

void World::connect(std::size_t host, std::span<const std::size_t> links) {
  // Whom it does not trust, or has connected to already, it cannot connect to.
  if (keys_ && (host == kStranger || connected_.contains(host))) return;
  std::vector<std::pair<LinkId, Address>> to;
  for (const std::size_t link : links) {
    if (!links_.contains(link)) continue;
    to.emplace_back(id_of(link), address_of(host, link));
    seen_[to.back().second.raw].named = true;
  }
  if (to.empty()) return;
  connected_.insert(host);
  endpoint_.connect(now_, to, keys_ ? std::optional(keys_->key_of(host)) : std::nullopt);
  drain();
}

void World::add_path(PeerId peer, std::size_t host, std::size_t link) {
  seen_[address_of(host, link).raw].named = true;
  endpoint_.add_path(now_, peer, id_of(link), address_of(host, link));
  drain();
}

void World::send(PeerId peer, Variants variants, const SendOptions& options) {
  const SendResult result = endpoint_.send(now_, peer, std::move(variants), options);
  if (result.accepted()) {
    require(without_fate_.insert(result.id.value).second, "two messages have one number");
    messages_.push_back(result.id);
  }
  require(!result.on_time || (*result.on_time >= 0 && *result.on_time <= 1),
          "a chance is out of bounds");
  drain();
}

void World::begin_round(PipelineId pipeline, Variants variants) {
  const RoundRef round = endpoint_.begin_round(now_, pipeline);
  require(without_answer_.insert(round).second, "two rounds have one number");
  rounds_.push_back(round);
  endpoint_.submit(now_, round, std::move(variants), MessageClass::kData);
  drain();
}

void World::local_result(std::size_t round, std::size_t bytes) {
  if (rounds_.empty()) return;
  endpoint_.local_result(now_, rounds_[round % rounds_.size()], Bytes(bytes));
  drain();
}

void World::cancel(std::size_t message) {
  if (messages_.empty()) return;
  endpoint_.cancel(now_, messages_[message % messages_.size()]);
  drain();
}

std::int64_t World::heap_growth() const {
  return static_cast<std::int64_t>(heap_bytes()) - static_cast<std::int64_t>(heap_before_);
}

void World::check() const {
  require(endpoint_.reassembly_bytes() <= kBudget, "reassembly is above its budget");
  require(endpoint_.sending_bytes() <= kBudget, "messages under way are above their budget");
  if (const std::int64_t growth = heap_growth(); growth > kMostHeap) {
    finding("the heap has grown by " + std::to_string(growth) + " bytes");
  }
  for (const PeerId peer : endpoint_.peers()) {
    for (const LinkState& state : endpoint_.links(now_, peer)) {
      const auto is_share = [](double value) { return value >= 0 && value <= 1; };
      require(is_share(state.loss) && is_share(state.loss_down) && is_share(state.outage) &&
                  is_share(state.confidence) && is_share(state.nature.delay) &&
                  is_share(state.nature.bandwidth) && is_share(state.nature.reliability) &&
                  is_share(state.nature.security),
              "an estimate is no share");
      require(state.rate >= DataRate{} && state.share >= DataRate{} &&
                  state.rtt_p50 >= Duration::zero() && state.queue_up >= Duration::zero(),
              "an estimate is negative");
    }
  }
}

}  // namespace interneuron::fuzz
