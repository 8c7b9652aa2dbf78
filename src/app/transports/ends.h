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

#include "app/transports/order.h"
#include "app/transports/reception.h"

namespace interneuron::cli {

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

}  // namespace interneuron::cli
