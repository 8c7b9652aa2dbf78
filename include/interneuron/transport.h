// The door to the operating system: a Transport moves datagrams over one network card (NIC). Most
// applications never see one; NodeOptions::wrap_transport lets an application put its own in
// between. Also IoError, the one exception of the folders that make system calls.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "interneuron/address.h"
#include "interneuron/round.h"
#include "interneuron/units.h"

namespace interneuron {

// A system call failed while something was set up. what() is one line that names the call, the NIC
// and port where they matter, and the remedy.
class IoError : public std::runtime_error {
 public:
  // `code`: the errno, 0 when no system call was at fault.
  IoError(const std::string& what, int code) : std::runtime_error(what), code_(code) {}
  int code() const { return code_; }

 private:
  int code_;
};

// A datagram to send: three parts that follow each other on the wire, so that nobody has to join
// them. All are read until send() returns.
struct Outgoing {
  Address to{};
  // Not empty; the others may be.
  ByteView head;
  ByteView payload{};
  ByteView tail{};
  // The ECN bits of its IP header (RFC 3168 §5), 0 … 3.
  std::uint8_t ecn = 0;
  // As in Transmit: a transport that treats datagrams by their round cannot read them.
  std::optional<RoundRef> round{};

  std::size_t size() const { return head.size() + payload.size() + tail.size(); }
  // A copy of the parts in one piece, for transports that keep or change what they send.
  Bytes joined() const {
    Bytes out(head.begin(), head.end());
    out.insert(out.end(), payload.begin(), payload.end());
    out.insert(out.end(), tail.begin(), tail.end());
    return out;
  }
};

// A datagram that has arrived.
struct Incoming {
  Address from{};
  ByteView bytes;
  // When, by the clock of Node::now() and as the kernel says; TimePoint::min() where it does not.
  TimePoint at = TimePoint::min();
  // The ECN bits of its IP header; 0 where the kernel does not tell.
  std::uint8_t ecn = 0;
};

// What became of a batch of datagrams.
struct BatchResult {
  // Leading datagrams not to be offered again: they were handed to the kernel, or dropped with an
  // error and counted.
  std::size_t taken = 0;
  // The others did not fit into the socket's buffer: offer them again when the handle is writable.
  bool would_block = false;
  // The errno, usually ENODEV, when the NIC is gone for good; 0 otherwise. All that was offered is
  // then dropped and counted.
  int gone = 0;
  // The kernel has no room for the others just now, or forbids them, whatever the handle says:
  // offer them again a little later. Where none are left, the transport itself holds some of what
  // it has taken: call send() again a little later, with nothing if there is nothing else.
  bool refused = false;
};

// What a transport can do.
struct TransportCaps {
  // Equal-sized datagrams to one address leave in one call (UDP_SEGMENT).
  bool segmentation_offload = false;
  // Equal-sized datagrams from one address arrive in one call (UDP_GRO).
  bool receive_offload = false;
  std::size_t max_datagram_bytes = 0;
  // As the kernel granted them, without its own overhead.
  std::size_t send_buffer_bytes = 0;
  std::size_t receive_buffer_bytes = 0;
};

// What a transport has counted since it exists.
struct TransportCounters {
  std::uint64_t sent_datagrams = 0;
  // System calls that sent something.
  std::uint64_t send_calls = 0;
  // Datagrams that were dropped because the kernel refused them, and the errno of the newest one.
  std::uint64_t send_errors = 0;
  int last_send_error = 0;
  // How often the kernel took nothing for now (ENOBUFS: a queue behind the socket is full; EPERM: a
  // rule of the firewall or a full table of connections). What it refused so is no error.
  std::uint64_t send_refusals = 0;
  // Batches that the kernel refused to segment; they were sent one by one.
  std::uint64_t offload_refused = 0;
  std::uint64_t received_datagrams = 0;
  // System calls that received something.
  std::uint64_t receive_calls = 0;
  // Calls that failed, and datagrams that were larger than the buffers.
  std::uint64_t receive_errors = 0;
  // Datagrams that the kernel dropped because the receive buffer was full.
  std::uint64_t receive_queue_drops = 0;
  // What was read from the socket's error queue and thrown away: errors of the network, stamps of
  // what was sent, datagrams that a qdisc dropped. Nothing asks the kernel for them unless somebody
  // sets such an option on the handle.
  std::uint64_t error_reports = 0;
};

// One socket. Set-up failures throw IoError from the constructors of derived classes; once a
// transport exists, sending and receiving never throw, and what fails is counted. It owns its
// handle. Thread-compatible.
class Transport {
 public:
  virtual ~Transport() = default;
  // Hands datagrams to the kernel. Never blocks, never throws. The order of datagrams to one
  // address is kept.
  virtual BatchResult send(std::span<const Outgoing> batch) = 0;
  // Datagrams that have arrived, as many as fit into the transport's own buffers; empty when there
  // are none. The views are valid until the next call. Never blocks, never throws.
  virtual std::span<const Incoming> receive() = 0;
  // Whether the last receive() left nothing behind, so that it need not be called again until the
  // handle is readable. A transport that does not know, or that has more to do in receive() than to
  // receive, says false: it is called until there is nothing, and now and then besides.
  virtual bool drained() const { return false; }
  virtual TransportCaps capabilities() const = 0;
  virtual TransportCounters counters() const = 0;
  // Where this transport is bound: the address may be unspecified (0.0.0.0, ::), the port is not.
  virtual Address local_address() const = 0;
  // To be polled for readability and writability; still owned by the transport.
  virtual int native_handle() const = 0;
};

}  // namespace interneuron
