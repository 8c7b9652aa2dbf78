// The door to the operating system: a Transport moves datagrams over one network card (NIC). The
// core never knows which kind it has. Also the one exception of the folders that make system calls.
//
// Set-up failures throw IoError; once a transport exists, sending and receiving never throw: what
// fails is counted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "interneuron/address.h"
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

struct Outgoing {
  Address to{};
  ByteView bytes;  // not empty; read until send() returns
};

struct Incoming {
  Address from{};
  ByteView bytes;
};

struct SendResult {
  // So many leading datagrams are done with: handed to the kernel, or dropped with an error and
  // counted.
  std::size_t taken = 0;
  // The rest did not fit into the socket's buffer: offer it again when the handle is writable.
  bool would_block = false;
  // The NIC is gone for good (errno, usually ENODEV), 0 = it is not. Whatever was offered is
  // dropped and counted.
  int gone = 0;
};

struct TransportCaps {
  bool segmentation_offload =
      false;  // equal-sized datagrams to one address leave in one call (UDP_SEGMENT)
  bool receive_offload = false;  // and arrive in one (UDP_GRO)
  std::size_t max_datagram_bytes = 0;
  std::size_t send_buffer_bytes = 0;     // as the kernel granted, without its own overhead
  std::size_t receive_buffer_bytes = 0;  // the same
};

// Since the transport exists.
struct TransportCounters {
  std::uint64_t sent_datagrams = 0;
  std::uint64_t send_calls = 0;   // system calls that sent something
  std::uint64_t send_errors = 0;  // datagrams dropped because the kernel refused them
  int last_send_error = 0;        // errno of the newest of these
  std::uint64_t offload_refused =
      0;  // batches that the kernel refused to segment; they were sent one by one
  std::uint64_t received_datagrams = 0;
  std::uint64_t receive_calls = 0;   // system calls that received something
  std::uint64_t receive_errors = 0;  // calls that failed, and datagrams larger than the buffers
  std::uint64_t receive_queue_drops =
      0;  // datagrams the kernel dropped because the receive buffer was full
};

// Thread-compatible. Owns its handle.
class Transport {
 public:
  virtual ~Transport() = default;
  // Never blocks, never throws. The order of datagrams to one address is kept.
  virtual SendResult send(std::span<const Outgoing> batch) = 0;
  // What has arrived, at most one internal batch of it; empty when nothing is there. The views are
  // valid until the next call. Never blocks, never throws.
  virtual std::span<const Incoming> receive() = 0;
  virtual TransportCaps capabilities() const = 0;
  virtual TransportCounters counters() const = 0;
  // Where this transport is bound; the address may be unspecified, the port never is.
  virtual Address local_address() const = 0;
  // To be polled for readability and writability; still owned by the transport.
  virtual int native_handle() const = 0;
};

}  // namespace interneuron
