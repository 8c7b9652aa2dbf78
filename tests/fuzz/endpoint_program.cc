#include "tests/fuzz/endpoint_program.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <map>

#include "tests/fuzz/endpoint_packets.h"
#include "tests/fuzz/input.h"

namespace interneuron::fuzz {
namespace {

using namespace std::chrono_literals;

// Bytes of messages that a program may hand over, so that its time is bounded.
constexpr std::size_t kMostOwnBytes = 1'000'000;
// Peers that it may connect to, which never go away.
constexpr std::size_t kMostConnected = 3;

class Program {
 public:
  Program(World::Side side, World::Protection protection, Input input)
      : world_(side, protection), input_(input) {}

  ProgramResult run() {
    ProgramResult result;
    for (; result.steps < kMostSteps && !input_.empty(); ++result.steps) {
      step();
      world_.settle();
      if (result.steps % 16 == 0) world_.check();
    }
    world_.check();
    result.peers = world_.endpoint().peers().size();
    result.messages_completed = world_.endpoint().counters().messages_completed;
    world_.finish();
    world_.check();
    return result;
  }

 private:
  void step() {
    switch (input_.below(16)) {
      case 0:
      case 1:
        return world_.pass(any_pause());
      case 2:
        return world_.jump(input_.flip() ? any_pause() : -any_pause());
      case 3:
        return raw();
      case 4:
      case 5:
      case 6:
        return packet();
      case 7:
        return answer();
      case 8:
        return replay();
      case 9:
        return card();
      case 10:
        return own_message();
      case 11:
        return own_round();
      case 12:
        return command();
      case 13:
        return world_.partner_sends(any_size());
      default:
        return exchange();
    }
  }

  Duration any_pause() {
    constexpr std::array<Duration, 10> kPauses{1ns,   100us, 1ms, 5ms, 20ms,
                                               100ms, 500ms, 2s,  20s, 130s};
    return kPauses[input_.below(kPauses.size())];
  }
  std::size_t any_size() {
    constexpr std::array<std::size_t, 6> kSizes{1, 100, 1'300, 5'000, 30'000, 200'000};
    const std::size_t size = std::min(kSizes[input_.below(kSizes.size())], own_bytes_left_);
    own_bytes_left_ -= size;
    return size;
  }
  Variants any_variants() {
    Variants out;
    for (std::size_t n = 1 + input_.below(3); n > 0; --n) out.emplace_back(any_size());
    return out;
  }
  std::optional<PeerId> any_peer() {
    const auto peers = world_.endpoint().peers();
    if (peers.empty()) return std::nullopt;
    return peers[input_.below(peers.size())];
  }

  Sender sender(std::size_t host, std::size_t link) {
    Sender out;
    out.session =
        host == kPartner ? kPartnerSession : SessionId{static_cast<std::uint32_t>(100 + 10 * host)};
    out.link = LinkId{static_cast<std::uint16_t>(link)};
    out.next_number = numbers_[{host, link}] += 1;
    out.heard_number = world_.seen(host, link).last_number;
    out.now = world_.now();
    out.endpoint = kOwnSession;
    return out;
  }
  void feed(std::size_t host, std::size_t link, const Bytes& bytes) {
    if (sent_.size() < 64) sent_.push_back(bytes);
    world_.feed(host, link, bytes, static_cast<std::uint8_t>(input_.below(4)));
  }

  void raw() {
    const std::size_t host = input_.below(kHosts);
    const std::size_t link = input_.below(kLinks);
    const ByteView bytes = input_.bytes(input_.take<std::uint8_t>());
    feed(host, link, {bytes.begin(), bytes.end()});
  }
  // A packet, or a few of one kind that differ in their fields.
  void packet() {
    const std::size_t host = input_.below(kHosts);
    const std::size_t link = input_.below(kLinks);
    const Kind kind = static_cast<Kind>(input_.below(kKinds));
    const Bytes bytes = any_packet(input_, sender(host, link), kind);
    feed(host, link, world_.as_sent(host, link, bytes));
  }
  // Answers a challenge from the address that got it, or from another.
  void answer() {
    const std::size_t host = input_.below(kHosts);
    const std::size_t link = input_.below(kLinks);
    const auto token = world_.seen(host, link).token;
    const std::size_t from = input_.below(4) == 0 ? input_.below(kHosts) : host;
    Bytes bytes = answer_packet(input_, sender(host, link),
                                token.value_or(std::array<std::byte, 16>{}), input_.flip());
    feed(from, link, world_.as_sent(host, link, std::move(bytes)));
  }
  // Something that was sent before, or what the endpoint itself sent, from any address.
  void replay() {
    const std::size_t host = input_.below(kHosts);
    const std::size_t link = input_.below(kLinks);
    if (input_.flip()) {
      const Bytes reflected = world_.seen(input_.below(kHosts), input_.below(kLinks)).last;
      return world_.feed(host, link, reflected);
    }
    if (!sent_.empty()) world_.feed(host, link, Bytes(sent_[input_.below(sent_.size())]));
  }
  void card() {
    const std::size_t link = input_.below(kLinks);
    if (world_.has_link(link)) return world_.remove_link(link);
    LinkInfo info{"nic", 1500, {}};
    const std::size_t mtus[] = {1500, 1280, 576, 0};
    info.mtu = mtus[input_.below(std::size(mtus))];
    info.traits.metered = input_.flip();
    info.traits.role = static_cast<LinkRole>(input_.below(3));
    if (input_.flip()) info.traits.rate_cap = DataRate::mbit(1);
    world_.add_link(link, info);
  }
  void own_message() {
    const auto peer = any_peer();
    if (!peer) return;
    constexpr const char* kPolicies[] = {"down_sampling", "duplicate", "split",   "coded",
                                         "stripe",        "shadow",    "failover"};
    SendOptions options;
    options.policy = kPolicies[input_.below(std::size(kPolicies))];
    options.deadline = any_pause();
    options.channel = static_cast<std::uint16_t>(input_.below(3));
    options.importance = input_.take<std::uint8_t>();
    options.newest_only = input_.flip();
    world_.send(*peer, any_variants(), options);
  }
  void own_round() {
    if (input_.below(4) == 0) {
      return world_.local_result(input_.take<std::uint8_t>(), input_.below(200));
    }
    // A round without peers, or with several, is answered locally.
    world_.begin_round(PipelineId{static_cast<std::uint8_t>(input_.below(2))}, any_variants());
  }
  void command() {
    const std::size_t which = input_.below(4);
    const std::size_t host = input_.below(kHosts);
    const std::size_t link = input_.below(kLinks);
    const auto peer = any_peer();
    if (which == 0 && connected_ < kMostConnected) {
      ++connected_;
      const std::array<std::size_t, 2> links{link, (link + 1) % kLinks};
      world_.connect(host, links);
    } else if (which == 1 && peer) {
      world_.add_path(*peer, host, link);
    } else if (which == 2 && peer) {
      world_.endpoint().request_train(world_.now(), *peer,
                                      LinkId{static_cast<std::uint16_t>(link)});
    } else {
      world_.cancel(input_.take<std::uint8_t>());
    }
  }
  // Some packets between the endpoint and its partner, with time in between.
  void exchange() {
    const std::size_t packets = 1 + input_.below(64);
    const auto fates = input_.take<std::uint8_t>();
    const auto damage = input_.take<std::uint8_t>();
    const Duration pause = any_pause();
    for (std::size_t i = 0; i < packets; ++i) {
      const bool spoilt = fates != 0 && i % (1U + fates % 8U) == fates % 8U;
      world_.deliver(spoilt ? static_cast<World::Fate>(fates / 8 % 4) : World::Fate::kDelivered,
                     damage);
    }
    world_.pass(std::min<Duration>(pause, 100ms));
  }

  World world_;
  Input input_;
  std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> numbers_;
  std::vector<Bytes> sent_;
  std::size_t own_bytes_left_ = kMostOwnBytes;
  std::size_t connected_ = 0;
};

}  // namespace

ProgramResult run_program(std::span<const std::uint8_t> bytes, World::Protection protection) {
  Input input(bytes);
  const auto side = input.flip() ? World::Side::kVehicle : World::Side::kRoad;
  return Program(side, protection, input).run();
}

}  // namespace interneuron::fuzz
