// The honest partner of the endpoint in a World, and the packets between the two.
#include <array>

#include "tests/fuzz/endpoint_world.h"

namespace interneuron::fuzz {

using namespace std::chrono_literals;

namespace {

// Packets that are under way at most; further ones are lost.
constexpr std::size_t kMostFlights = 256;

}  // namespace

void World::launch(Flight flight) {
  if (flights_.size() < kMostFlights) flights_.push_back(std::move(flight));
}

void World::deliver(Fate fate, std::uint8_t damage) {
  if (flights_.empty()) return;
  Flight flight = std::move(flights_.front());
  flights_.pop_front();
  if (fate == Fate::kLost) return;
  if (fate == Fate::kDamaged) {
    flight.bytes[damage % flight.bytes.size()] ^= static_cast<std::byte>(1U + damage % 255U);
  }
  for (int copies = fate == Fate::kTwice ? 2 : 1; copies > 0; --copies) {
    if (flight.to_partner) {
      partner_.handle_datagram(
          now_, {LinkId{flight.link}, address_of(kPartner, flight.link), flight.bytes, flight.ecn});
      drain_partner();
    } else {
      feed(kPartner, flight.link, flight.bytes, flight.ecn);
    }
  }
}

void World::partner_sends(std::size_t bytes) {
  SendOptions options{.deadline = 500ms};
  const auto peers = partner_.peers();
  if (!peers.empty()) partner_.send(now_, peers.front(), {Bytes(bytes)}, options);
  if (side_ == Side::kRoad) {
    const RoundRef round = partner_.begin_round(now_, PipelineId{0});
    partner_.submit(now_, round, {Bytes(bytes), Bytes(bytes / 4 + 1)}, MessageClass::kData);
  }
  drain_partner();
}

// The partner is no subject of these tests: it works as long as it has wake-ups left.
void World::drain_partner() {
  std::array<std::byte, kMaxDatagramBytes> buffer;
  while (partner_wakes_left_ > 0) {
    partner_.handle_timeout(now_);
    while (auto event = partner_.poll_event()) {
      const auto* delivered = std::get_if<Delivered>(&*event);
      if (delivered == nullptr) continue;
      partner_.submit(now_, delivered->round, {Bytes(300)}, MessageClass::kResult);
    }
    while (const auto transmit = partner_.poll_transmit(now_, buffer)) {
      const auto bytes = ByteView(buffer).first(transmit->size);
      launch({false, transmit->link.value, {bytes.begin(), bytes.end()}, transmit->ecn});
    }
    const auto next = partner_.next_timeout();
    if (!next || *next > now_) return;
    --partner_wakes_left_;
  }
}

}  // namespace interneuron::fuzz
