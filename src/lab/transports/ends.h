// The two programs of a run, by transport: one plays all vehicles, the other the roadside unit.
//
// A sender connects, calls `ready`, which tells that it is, waits until messages begin and returns
// that instant; then it sends all of them and returns a deadline after the last may begin. A
// receiver calls `ready` once it listens and serves until a SignalWatch of the caller notes a
// signal (that of Interneuron: until SIGTERM or SIGINT). They take the calling thread. Errors:
// Failure (1) naming what could not be done, or IoError. What comes in is checked, although both
// ends are this program: a head that makes no sense is dropped or ends its connection.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lab/transports/message_head.h"
#include "lab/transports/order.h"

namespace interneuron::transports {

// What a roadside unit notes of the messages that arrive, and what its process costs meanwhile.
// Memory: some 24 bytes for each message of the run. Thread-compatible; no errors.
class Reception {
 public:
  // A message is there whole.
  void arrived(const MessageHead& head, std::uint32_t variant, TimePoint now);
  // Processor time of this process, user and system, over time, from the first arrival to the last.
  double cpu() const;
  const std::vector<Arrival>& arrivals() const { return arrivals_; }

 private:
  std::vector<Arrival> arrivals_;
  Duration cpu_at_first_{};
  Duration cpu_at_last_{};
};

using Begin = std::function<TimePoint()>;
using Ready = std::function<void()>;

// Interneuron: a Node for each vehicle, on a thread of its own, with Node::send() by the policy
// that the order names.
VehiclesRecord send_ours(const Order& order, const Begin& ready);
void receive_ours(const Order& order, const Ready& ready, Reception& reception);

// Each message at once in datagrams, a copy over every modem of the order; nothing is repaired or
// held back. A message is there when each of its datagrams has come by any modem.
VehiclesRecord send_udp(const Order& order, const Begin& ready);
void receive_udp(const Order& order, const Ready& ready, Reception& reception);

// The kernel's TCP or MPTCP, a connection for each vehicle over the first modem, to which MPTCP
// adds the others. The application is a careful one: it writes no further ahead than the window
// allows, of the messages that wait it keeps the newest, and drops one whose deadline has passed.
VehiclesRecord send_tcp(const Order& order, const Begin& ready);
void receive_tcp(const Order& order, const Ready& ready, Reception& reception);

// The following two need libraries that not every build has: why this one cannot, one line;
// nothing: it can. Without them the programs throw Failure (77) with that line.
std::optional<std::string> lacks_fastdds();
std::optional<std::string> lacks_srt();

// Fast DDS, a sample for each message over every modem of the order, best effort: with the defaults
// (mode "stock", datagrams of 64 KiB) or "tuned" (datagrams of 1400 bytes, large buffers).
VehiclesRecord send_fastdds(const Order& order, const Begin& ready);
void receive_fastdds(const Order& order, const Ready& ready, Reception& reception);

// SRT with a bonded group over all modems of the order, of the kind "broadcast" or "backup". Its
// latency is what the deadline leaves; messages are cut into its packets.
VehiclesRecord send_srt(const Order& order, const Begin& ready);
void receive_srt(const Order& order, const Ready& ready, Reception& reception);

// Cross traffic of the order: both serve until a SignalWatch of the caller notes a signal.
void send_cross(const Order& order);
void receive_cross(const Order& order, const Ready& ready, CrossRecord& record);

}  // namespace interneuron::transports
