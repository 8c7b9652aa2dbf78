// Handshakes that no honest host makes, to both roles: any bytes; packets of honest hosts that
// were changed, repeated and confused, with or without the codes that everybody who knows the
// public keys can make anew; and what an insider says whose key is trusted: any hello behind good
// codes.
//
// What must hold: nobody becomes a host whose key he does not have, both sides of what was agreed
// on have the same keys, times grow, every answer is smaller than what it answers and there is at
// most one for each, what waits is bounded, and what is refused changes nothing: the honest
// handshake at the end is made.
#include <algorithm>
#include <optional>
#include <vector>

#include "core/secure/cookie.h"
#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "lab/sim/trust.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron;
using namespace std::chrono_literals;
using crypto::Initiator;
using crypto::Responder;
using crypto::Trust;
using fuzz::require;

// Each step may multiply points.
constexpr std::size_t kMostSteps = 48;
constexpr std::size_t kMostKept = 32;
constexpr LinkId kNic{1};
constexpr int kVehicle = 1;
constexpr int kRoad = 2;
constexpr int kInsider = 3;
constexpr int kStranger = 4;

Address address_of(std::size_t host) {
  Address out{.size = 16};
  out.raw[4] = std::byte{10};
  out.raw[7] = static_cast<std::byte>(host);
  return out;
}

void put(Bytes& packet, ByteView at, const crypto::Mac& mac) {
  std::ranges::copy(mac, packet.begin() + (at.data() - packet.data()));
}

class Handshakes {
 public:
  explicit Handshakes(fuzz::Input input) : input_(input) {
    Security security{.peers = {{key(kVehicle).open, shared_}, {key(kInsider).open, {}}}};
    trust_.emplace(security);
    road_.emplace(key(kRoad), SessionId{200}, *trust_);
    vehicle_.begin(now_);
  }

  void run() {
    for (std::size_t i = 0; i < kMostSteps && !input_.empty(); ++i) {
      step();
      require(waiting_ <= Responder::kMaxWaiting, "too many answers wait");
    }
    finish();
  }

 private:
  static const crypto::KeyPair& key(int host) {
    static const std::array<crypto::KeyPair, 4> pairs{
        crypto::key_pair_of(sim::secret_key(kVehicle)), crypto::key_pair_of(sim::secret_key(kRoad)),
        crypto::key_pair_of(sim::secret_key(kInsider)),
        crypto::key_pair_of(sim::secret_key(kStranger))};
    return pairs[static_cast<std::size_t>(host - kVehicle)];
  }
  Initiator::Fresh fresh() { return {next_index_++, entropy_.draw_key(), ++clock_}; }

  void step() {
    switch (input_.below(8)) {
      case 0:
        now_ += Duration(1ms) * input_.take<std::uint16_t>();
        return;
      case 1:
        return ask();
      case 2:
        return hear(input_.flip() ? any_kept() : any_bytes());
      case 3:
        return to_road(changed(any_kept()));
      case 4:
        return hear(changed(any_kept()));
      case 5:
        return to_road(of_insider());
      case 6:
        return hear(input_.flip() ? response_of_road() : cookie_of_anybody());
      default:
        return input_.flip() ? to_road(any_bytes()) : answer();
    }
  }

  void keep(const Bytes& bytes) {
    if (kept_.size() < kMostKept) kept_.push_back(bytes);
  }
  Bytes any_kept() { return kept_.empty() ? Bytes{} : kept_[input_.below(kept_.size())]; }
  Bytes any_bytes() {
    const std::size_t sizes[] = {crypto::kInitiationBytes, crypto::kResponseBytes,
                                 crypto::kCookieBytes};
    const std::size_t which = input_.below(4);
    const ByteView in = input_.bytes(which < 3 ? sizes[which] : input_.take<std::uint8_t>());
    Bytes out(in.begin(), in.end());
    if (which < 3) out.resize(sizes[which]);
    return out;
  }

  // Some bytes are other ones; then perhaps what everybody can make anew.
  Bytes changed(Bytes packet) {
    for (std::size_t n = input_.below(4); n > 0 && !packet.empty(); --n) {
      packet[input_.take<std::uint8_t>() % packet.size()] ^= input_.take<std::byte>();
    }
    if (packet.size() == crypto::kInitiationBytes && input_.flip()) make_mac1(packet);
    return packet;
  }
  static void make_mac1(Bytes& packet) {
    const auto parts = crypto::parts_of_initiation(packet);
    put(packet, parts.mac1, crypto::mac_of(crypto::mac1_key(key(kRoad).open), parts.before_mac1));
  }

  // The vehicle asks, over any path; what it sends reaches the road or is only overheard.
  void ask() {
    vehicle_.begin(now_);
    if (vehicle_.needs_message(now_)) {
      require(vehicle_.make_message(now_, fresh()), "no message can be made");
    }
    Bytes out(crypto::kInitiationBytes);
    vehicle_.write(LinkId{static_cast<std::uint16_t>(input_.below(12))}, out);
    keep(out);
    if (input_.flip()) to_road(out);
    if (input_.flip()) vehicle_.tried(now_);
  }

  // What a host with a key of its own says, trusted or not: any hello, with good codes.
  Bytes of_insider() {
    const int who = input_.below(4) == 0 ? kStranger : kInsider;
    auto noise =
        crypto::Noise::initiator(crypto::Noise::Pattern::kIkPsk2, crypto::prologue(), key(who),
                                 crypto::key_pair_of(entropy_.draw_key()), key(kRoad).open);
    const crypto::Hello hello = any_hello();
    std::array<std::byte, crypto::kHelloBytes> said{};
    crypto::put_hello(said, hello);
    Bytes out(crypto::kInitiationBytes);
    const std::uint32_t sessions[] = {hello.index, hello.index, 1};
    wire::write_header(
        out, {wire::PacketType::kInitiation, LinkId{static_cast<std::uint16_t>(input_.below(12))},
              wire::kClearEpoch, SessionId{std::max(1U, input_.one_of(sessions))},
              1U + input_.below(3), 0});
    const std::span<std::byte> message(out.data() + wire::kHeaderBytes,
                                       crypto::kFirstMessageBytes + crypto::kHelloBytes);
    require(noise.write_first(message, said), "no message can be made");
    const auto parts = crypto::parts_of_initiation(out);
    put(out, parts.proof, crypto::mac_of(crypto::initiation_proof_key(noise), parts.before_proof));
    make_mac1(out);
    keep(out);
    return out;
  }
  crypto::Hello any_hello() {
    const std::uint32_t numbers[] = {7, 7, 0};
    const std::int64_t times[] = {clock_ + 1, clock_, 0, -1, crypto::kLatestUnixNs, INT64_MAX};
    return {SessionId{input_.one_of(numbers)}, input_.one_of(numbers), input_.one_of(times)};
  }

  void to_road(const Bytes& bytes) {
    const std::size_t from = input_.below(4);
    const auto header = wire::peek(bytes);
    if (!header || header->type != wire::PacketType::kInitiation) return;
    const Datagram datagram{kNic, address_of(from), bytes};
    const auto verdict = road_->take(now_, *header, datagram, entropy_);
    if (verdict == Responder::Verdict::kAnswered) ++waiting_;
    if (verdict != Responder::Verdict::kNew) return;
    const auto accepted = road_->accept(now_, *header, datagram, fresh());
    if (!accepted) return;
    if (waiting_ < Responder::kMaxWaiting) ++waiting_;
    const bool is_vehicle = accepted->who == key(kVehicle).open;
    require(is_vehicle || accepted->who == key(kInsider).open, "a stranger is accepted");
    require(crypto::is_valid(accepted->theirs), "a hello is accepted that nobody may say");
    std::int64_t& newest = is_vehicle ? vehicle_said_ : insider_said_;
    require(accepted->theirs.unix_ns > newest, "an old time is accepted");
    newest = accepted->theirs.unix_ns;
    if (is_vehicle) {
      require(accepted->theirs.life == kLife, "somebody else speaks with the vehicle's key");
      agreed_.push_back({accepted->theirs.index, accepted->keys});
    }
  }

  // The next answer of the road is written; it reaches the vehicle or is only overheard.
  void answer() {
    const auto next = road_->next();
    require(next.has_value() == (waiting_ > 0), "another number of answers waits");
    if (!next) return;
    --waiting_;
    Bytes out(kMaxDatagramBytes);
    wire::Token token{};
    token.fill(static_cast<std::byte>(next->index));
    out.resize(road_->write(out, token));
    require(out.size() < crypto::kInitiationBytes, "an answer is larger than what it answers");
    keep(out);
    if (input_.flip()) hear(out);
  }

  void hear(const Bytes& bytes) {
    const auto header = wire::peek(bytes);
    if (!header) return;
    vehicle_.token_of(bytes);
    if (header->type == wire::PacketType::kCookie) vehicle_.take_cookie(now_, *header, bytes);
    const std::uint32_t index = vehicle_.index();
    const auto answer = vehicle_.take_response(bytes);
    if (!answer) return;
    const bool is_same = std::ranges::any_of(agreed_, [&](const Agreed& agreed) {
      return agreed.index == index && agreed.keys.from_initiator == answer->keys.from_initiator &&
             agreed.keys.from_responder == answer->keys.from_responder;
    });
    require(is_same, "the vehicle has agreed on keys with nobody");
    require(crypto::is_valid(answer->theirs), "a hello is taken that nobody may say");
    require(!vehicle_.is_trying() && vehicle_.token_of(bytes), "an answer ends nothing");
  }

  // A road whose key is right, and that says anything, to the newest message that was overheard.
  Bytes response_of_road() {
    const Bytes asked = any_kept();
    const auto header = wire::peek(asked);
    if (!header || asked.size() != crypto::kInitiationBytes) return {};
    auto noise = crypto::Noise::responder(crypto::Noise::Pattern::kIkPsk2, crypto::prologue(),
                                          key(kRoad), entropy_.draw_key());
    std::array<std::byte, crypto::kHelloBytes> said{};
    if (!noise.read_first(crypto::parts_of_initiation(asked).noise, said)) return {};
    noise.set_shared(input_.below(4) == 0 ? SecretKey{} : shared_);
    crypto::put_hello(said, any_hello());
    Bytes out(crypto::kResponseBytes);
    wire::write_header(out, {wire::PacketType::kResponse, header->link, wire::kClearEpoch,
                             header->session, header->number, 0});
    const std::span<std::byte> message(out.data() + wire::kHeaderBytes,
                                       crypto::kSecondMessageBytes + crypto::kHelloBytes);
    require(noise.write_second(message, said), "no message can be made");
    const auto parts = crypto::parts_of_response(out);
    put(out, parts.proof, crypto::mac_of(crypto::response_proof_key(noise), parts.before_proof));
    agreed_.push_back({header->session.value, noise.split()});
    return out;
  }
  // A cookie for what was overheard, which whoever knows the public key can make.
  Bytes cookie_of_anybody() {
    const Bytes asked = any_kept();
    const auto header = wire::peek(asked);
    if (!header || asked.size() != crypto::kInitiationBytes) return {};
    Bytes out(crypto::kCookieBytes);
    crypto::write_cookie(out, *header, crypto::parts_of_initiation(asked).mac1,
                         crypto::cookie_key(key(kRoad).open), entropy_.draw_key(),
                         entropy_.draw_key());
    return out;
  }

  // Whatever came before: an honest vehicle gets its session once there is no load.
  void finish() {
    while (road_->next()) {
      Bytes out(kMaxDatagramBytes);
      road_->write(out, {});
    }
    waiting_ = 0;
    now_ += 10s;
    vehicle_.stop();
    vehicle_.begin(now_);
    clock_ = std::max(clock_, vehicle_said_);
    require(vehicle_.make_message(now_, fresh()), "no message can be made");
    const std::uint32_t index = vehicle_.index();
    Bytes asked(crypto::kInitiationBytes);
    vehicle_.write(LinkId{0}, asked);
    to_road(asked);
    require(!agreed_.empty() && agreed_.back().index == index && road_->next(),
            "the honest vehicle is refused");
    Bytes out(kMaxDatagramBytes);
    out.resize(road_->write(out, {}));
    require(vehicle_.take_response(out).has_value(), "the honest road is refused");
  }

  static constexpr SessionId kLife{100};
  fuzz::Input input_;
  TimePoint now_{1h};
  SecretKey shared_ = sim::secret_key(5);
  Initiator vehicle_{key(kVehicle), {key(kRoad).open, shared_}, kLife};
  std::optional<Trust> trust_;
  std::optional<Responder> road_;
  crypto::Entropy entropy_{sim::secret_key(9)};
  std::uint32_t next_index_ = 1;
  std::int64_t clock_ = 1'000'000;
  std::int64_t vehicle_said_ = -1;
  std::int64_t insider_said_ = -1;
  std::size_t waiting_ = 0;
  std::vector<Bytes> kept_;
  // What the vehicle's messages have led to on the other side, by the vehicle's index.
  struct Agreed {
    std::uint32_t index = 0;
    crypto::Split keys;
  };
  std::vector<Agreed> agreed_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Handshakes(fuzz::Input({data, size})).run();
  return 0;
}
