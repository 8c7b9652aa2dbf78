// The protocol without sockets, threads and clocks: two endpoints in one process, between which
// this program carries the datagrams by hand, each 10 ms, and says what time it is. A loop of one's
// own around an Endpoint does the same with real sockets. Needs interneuron::core alone.
#include <interneuron/endpoint.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <vector>

namespace in = interneuron;
using std::chrono::milliseconds;

namespace {

constexpr in::LinkId kLink{1};
constexpr in::Duration kDelay = milliseconds(10);

struct Host {
  in::Address address;
  in::Endpoint endpoint;
  const char* name;
};

// A datagram on its way.
struct Flight {
  in::TimePoint arrives;
  Host* to;
  in::Bytes bytes;
};

// The session and the secret have to be random in a program that has a network, and keys
// (EndpointOptions::security) are for all but networks of one's own.
in::EndpointOptions options(std::uint32_t session, bool accept_peers) {
  in::EndpointOptions o;
  o.session = {session};
  o.policies = in::builtin_policies();
  o.accept_peers = accept_peers;
  o.secret = {session, 1};
  return o;
}

// Takes out what may leave now.
void collect(in::TimePoint now, Host& from, Host& to, std::vector<Flight>& flights) {
  std::array<std::byte, in::kMaxDatagramBytes> buffer{};
  while (const auto out = from.endpoint.poll_transmit(now, buffer)) {
    const auto bytes = std::span(buffer).first(out->size);
    flights.push_back({now + kDelay, &to, {bytes.begin(), bytes.end()}});
  }
}

// Says what has happened; true when the fate of the message is known.
bool tell(in::TimePoint now, Host& host) {
  bool done = false;
  while (const auto event = host.endpoint.poll_event()) {
    if (const auto* ready = std::get_if<in::PeerReady>(&*event); ready && host.name[0] == 'v') {
      const auto hello = std::as_bytes(std::span("hello", 5));
      host.endpoint.send(now, ready->peer, {in::Bytes(hello.begin(), hello.end())},
                         {.deadline = milliseconds(100)});
    } else if (const auto* message = std::get_if<in::Message>(&*event)) {
      const char* text = reinterpret_cast<const char*>(message->bytes.data());
      std::printf("%s: %.*s\n", host.name, static_cast<int>(message->bytes.size()), text);
    } else if (const auto* fate = std::get_if<in::MessageFate>(&*event)) {
      std::printf("%s: %s after %.2f ms\n", host.name, to_string(fate->fate).data(),
                  in::to_ms(fate->age));
      done = true;
    }
  }
  return done;
}

}  // namespace

int main() {
  in::TimePoint now{};
  // An endpoint never looks into addresses; with sockets they are what the system calls sockaddr.
  Host road{{.raw = {std::byte{1}}, .size = 1}, in::Endpoint(options(1, true), now), "road"};
  Host vehicle{{.raw = {std::byte{2}}, .size = 1}, in::Endpoint(options(2, false), now), "vehicle"};
  road.endpoint.add_link(now, kLink, {.name = "road"});
  vehicle.endpoint.add_link(now, kLink, {.name = "vehicle"});
  const std::pair<in::LinkId, in::Address> path[] = {{kLink, road.address}};
  vehicle.endpoint.connect(now, path);

  std::vector<Flight> flights;
  while (now < in::TimePoint{} + std::chrono::seconds(1)) {
    collect(now, vehicle, road, flights);
    collect(now, road, vehicle, flights);
    const bool done = tell(now, vehicle);
    tell(now, road);
    if (done) return 0;
    // On to whatever comes first: a datagram that arrives, or a time-out.
    now = std::ranges::min({vehicle.endpoint.next_timeout().value_or(in::TimePoint::max()),
                            road.endpoint.next_timeout().value_or(in::TimePoint::max()),
                            flights.empty() ? in::TimePoint::max() : flights.front().arrives});
    while (!flights.empty() && flights.front().arrives <= now) {
      Host& to = *flights.front().to;
      const Host& from = &to == &road ? vehicle : road;
      to.endpoint.handle_datagram(now, {kLink, from.address, flights.front().bytes});
      flights.erase(flights.begin());
    }
    vehicle.endpoint.handle_timeout(now);
    road.endpoint.handle_timeout(now);
  }
  std::fputs("the message has no fate\n", stderr);
  return 1;
}
