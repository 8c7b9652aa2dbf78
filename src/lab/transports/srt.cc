// SRT with bonded links on both ends: a group of the kind that the mode names, messages in pieces.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <srt/srt.h>

#include <algorithm>
#include <array>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/pieces.h"
#include "lab/transports/sockets.h"
#include "lab/transports/timetable.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;

constexpr Duration kSrtPatience = 30s;
constexpr Duration kSrtLook = 10ms;
// How often a receiver looks whether a signal has come.
constexpr int kLookForSignalsMs = 100;

// The live mode, the only one with groups, takes at most 1456 bytes at once; 1316 are its default.
constexpr std::size_t kPayload = SRT_LIVE_DEF_PLSIZE;
// SRT delivers every packet at one latency after the way itself, by the clock of the link that was
// connected first. The more of the deadline that is, the more can be repaired; so much is left for
// what varies. A latency of 0 repairs nothing.
constexpr Duration kMargin = 10ms;
constexpr Duration kLeastLatency = 20ms;

[[noreturn]] void fail(const std::string& call) {
  throw Failure(kFailed, "SRT: " + call + ": " + srt_getlasterror_str());
}

int check(int result, const std::string& call) {
  if (result == SRT_ERROR) fail(call);
  return result;
}

sockaddr_in address_of(const std::string& address, std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(port);
  if (::inet_pton(AF_INET, address.c_str(), &out.sin_addr) != 1) {
    throw Failure(kFailed, "SRT: no address: " + address);
  }
  return out;
}

// The library, while it lives.
class Library {
 public:
  Library() {
    srt_startup();
    srt_setloglevel(LOG_CRIT);
  }
  ~Library() { srt_cleanup(); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
};

class Socket {
 public:
  Socket(SRTSOCKET socket, const std::string& call) : socket_(check(socket, call)) {}
  ~Socket() { srt_close(socket_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  SRTSOCKET get() const { return socket_; }

  void set(SRT_SOCKOPT option, int value, const std::string& name) {
    check(srt_setsockflag(socket_, option, &value, sizeof value), name);
  }

 private:
  SRTSOCKET socket_;
};

int latency_ms(const Order& order) {
  return static_cast<int>(
      to_ms(std::max(kLeastLatency, order.traffic.deadline - order.way - kMargin)));
}

// Connects a group over all modems, the first of which is preferred, and waits until each of them
// carries it.
void connect_all(const Socket& group, const Order& order) {
  std::vector<SRT_SOCKGROUPCONFIG> members;
  for (const Modem& modem : order.modems) {
    const sockaddr_in from = address_of(modem.vehicle_address, 0);
    const sockaddr_in to = address_of(modem.road_address, kLoadPort);
    members.push_back(srt_prepare_endpoint(reinterpret_cast<const sockaddr*>(&from),
                                           reinterpret_cast<const sockaddr*>(&to), sizeof to));
    members.back().weight = static_cast<std::uint16_t>(order.modems.size() - members.size());
  }
  check(srt_connect_group(group.get(), members.data(), static_cast<int>(members.size())),
        "srt_connect_group");
  const TimePoint patience = io::now() + kSrtPatience;
  for (;;) {
    std::vector<SRT_SOCKGROUPDATA> data(members.size());
    std::size_t count = data.size();
    check(srt_group_data(group.get(), data.data(), &count), "srt_group_data");
    const auto connected = std::ranges::count_if(
        data, [](const SRT_SOCKGROUPDATA& d) { return d.sockstate == SRTS_CONNECTED; });
    if (static_cast<std::size_t>(connected) == members.size()) return;
    if (io::now() > patience) throw Failure(kFailed, "SRT does not reach the roadside unit");
    SignalWatch::sleep(kSrtLook);
  }
}

void send_message(const Socket& group, const MessageHead& head) {
  Pieces pieces(head, kPayload);
  for (std::uint32_t place = 0; place < pieces.count(); ++place) {
    const ByteView piece = pieces.piece(place);
    // What its buffers do not take is lost: they hold more than a second of messages.
    srt_sendmsg(group.get(), reinterpret_cast<const char*>(piece.data()),
                static_cast<int>(piece.size()), -1, 1);
  }
}

// The group that a vehicle opens, or SRT_INVALID_SOCK when a signal came before.
SRTSOCKET accept_group(const Socket& listener) {
  while (SignalWatch::last() == 0) {
    const SRTSOCKET group = srt_accept(listener.get(), nullptr, nullptr);
    if (group != SRT_INVALID_SOCK) return group;
    if (srt_getlasterror(nullptr) != SRT_EASYNCRCV) fail("srt_accept");
    wait_for({}, io::now() + kSrtLook);
  }
  return SRT_INVALID_SOCK;
}

// Whether reading may go on after this failure.
bool only_waited() {
  const int error = srt_getlasterror(nullptr);
  return error == SRT_EASYNCRCV || error == SRT_ETIMEOUT;
}

}  // namespace

std::optional<std::string> lacks_srt() { return std::nullopt; }

VehiclesRecord send_srt(const Order& order, const Begin& ready) {
  const Traffic& traffic = order.traffic;
  const Library library;
  const SRT_GROUP_TYPE type =
      order.transport.mode == "broadcast" ? SRT_GTYPE_BROADCAST : SRT_GTYPE_BACKUP;
  Socket group(srt_create_group(type), "srt_create_group");
  group.set(SRTO_LATENCY, latency_ms(order), "SRTO_LATENCY");
  connect_all(group, order);
  // A full buffer must not hold up the messages that follow.
  group.set(SRTO_SNDSYN, 0, "SRTO_SNDSYN");
  const io::PreciseTimers precise;
  VehiclesRecord record;
  record.begun.resize(traffic.vehicles());
  const TimePoint begin = ready();
  for (const Due& due : timetable(traffic)) {
    SignalWatch::sleep(begin + due.at - io::now());
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    const MessageHead head{static_cast<std::uint32_t>(due.vehicle),
                           static_cast<std::uint32_t>(begun.size()),
                           static_cast<std::uint32_t>(traffic.variant_bytes.front())};
    begun.push_back(io::now());
    send_message(group, head);
  }
  SignalWatch::sleep(begin + traffic.length + traffic.deadline - io::now());
  return record;
}

void receive_srt(const Order& order, const Ready& ready, Reception& reception) {
  const Library library;
  Socket listener(srt_create_socket(), "srt_create_socket");
  listener.set(SRTO_GROUPCONNECT, 1, "SRTO_GROUPCONNECT");
  listener.set(SRTO_LATENCY, latency_ms(order), "SRTO_LATENCY");
  listener.set(SRTO_RCVSYN, 0, "SRTO_RCVSYN");
  const sockaddr_in any = address_of("0.0.0.0", kLoadPort);
  check(srt_bind(listener.get(), reinterpret_cast<const sockaddr*>(&any), sizeof any), "srt_bind");
  check(srt_listen(listener.get(), static_cast<int>(order.modems.size())), "srt_listen");
  ready();
  const SRTSOCKET accepted = accept_group(listener);
  if (accepted == SRT_INVALID_SOCK) return;
  Socket group(accepted, "srt_accept");
  group.set(SRTO_RCVSYN, 1, "SRTO_RCVSYN");
  group.set(SRTO_RCVTIMEO, kLookForSignalsMs, "SRTO_RCVTIMEO");
  Assembly assembly;
  std::array<char, SRT_LIVE_MAX_PLSIZE> packet{};
  while (SignalWatch::last() == 0) {
    const int size = srt_recvmsg(group.get(), packet.data(), static_cast<int>(packet.size()));
    // A vehicle that has ended leaves nothing to read, until the signal comes.
    if (size == SRT_ERROR && !only_waited()) wait_for({}, io::now() + kSrtLook);
    if (size <= 0) continue;
    const auto bytes = std::as_bytes(std::span(packet)).first(static_cast<std::size_t>(size));
    if (const auto whole = assembly.take(bytes)) reception.arrived(*whole, 0, io::now());
  }
}

}  // namespace interneuron::transports
