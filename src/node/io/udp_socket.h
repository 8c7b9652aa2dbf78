// A UDP socket that belongs to one NIC, set up for batched input and output, and the Transport on
// it.
#pragma once

#include <sys/socket.h>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "node/io/file_descriptor.h"
#include "node/io/nic.h"
#include "node/io/receiver_notes.h"

namespace interneuron::io {

// The receive buffer asked for: 4 MiB are 110 ms of data at 300 Mbit/s, more than a reader may be
// away (docs/constants.md, "Datagrams and sockets").
inline constexpr std::size_t kReceiveBufferBytes = 4 * 1024 * 1024;
// The send buffer asked for: 512 KiB are 42 ms of data at 100 Mbit/s and 140 ms at 30; in a larger
// buffer messages wait behind others that are too late already.
inline constexpr std::size_t kSendBufferBytes = 512 * 1024;

// How a NIC's socket is opened.
struct UdpOptions {
  std::string nic;
  // The same NIC, if the caller has it already; else the kernel is asked.
  std::optional<Nic> card{};
  // Where to bind. Its family is the socket's; an unspecified host stands for every address of the
  // NIC, port 0 for any free one.
  Address local{};
  // On an unspecified host: what is sent to an address that was received from leaves from the
  // address that it came to. A NAT drops an answer from another (docs/constants.md,
  // "NICs and the kernel").
  bool answer_from_receiver = false;
  // Whether to wait, half a second at most, for what the kernel has not taken down yet of a
  // transport that was closed (AF_XDP); not in an event loop.
  bool may_wait = true;
  // One of several sockets that serve one address (socket_group.h), which let others join; they
  // share the list of the addresses that datagrams came to.
  bool joins = false;
  std::shared_ptr<ReceiverNotes> notes = {};
  std::size_t receive_buffer_bytes = kReceiveBufferBytes;
  std::size_t send_buffer_bytes = kSendBufferBytes;
};

// The open socket.
struct UdpSocket {
  FileDescriptor fd;
  // As bound, with the port in use.
  Address local{};
  TransportCaps capabilities;
  // What could not be had as asked, one line each, with the remedy.
  std::vector<std::string> warnings;
};

// Opens a socket that never blocks, never fragments and is closed on exec. It is bound to the NIC
// before it is bound to an address, so that it receives nothing from other NICs at any time. Needs
// no privilege from Linux 5.7 on. Throws IoError.
UdpSocket open_udp_socket(const UdpOptions& options);

// Whether the NIC that a socket is bound to is gone for good. The error of a send does not tell
// (ENODEV, ENETUNREACH or EINVAL, depending on how the socket is bound), but a socket can no longer
// name a card that is gone.
bool nic_vanished(int fd);

// What a control message of recvmsg holds.
template <class Value>
Value control_value(cmsghdr* item) {
  Value value{};
  std::memcpy(&value, CMSG_DATA(item), sizeof value);
  return value;
}

// One NIC's UDP socket as a Transport.
//
// Datagrams of equal size to one address leave as one segmented send (UDP_SEGMENT), many sends per
// call (sendmmsg), in the parts that they are given in, and arrive coalesced (UDP_GRO), many per
// call (recvmmsg): 26 times the rate of plain sends (docs/constants.md, "Datagrams and sockets"). A
// batch that the kernel refuses to segment is sent one by one. The errors of the network that a
// socket may report (a host that cannot be reached) drop the datagram they hit and are counted:
// ICMP is a hint that anybody can forge. What the kernel takes not just now (ENOBUFS, EPERM) is
// left to be offered again. The socket's error queue, which would make the handle readable for ever
// and takes room from what arrives, is emptied and counted where the handle was readable and there
// is no datagram. Datagrams that arrive bear the kernel's
// stamps; those that it has coalesced have one.
//
// With UdpOptions::answer_from_receiver an Address that comes from receive() carries, in a byte
// that the system ignores, which of the NIC's own addresses it came to; send() takes it from there.
// Addresses made otherwise carry nothing and leave the choice to the kernel.
//
// What strangers can do: anybody may send to an open port. Datagrams are handed on as they are,
// with the sender's address as the kernel saw it, which can be forged; the endpoint parses and
// judges them. The note above is written here, never taken from a packet. A flood fills the
// socket's receive buffer (kReceiveBufferBytes); what does not fit is dropped by the kernel and
// counted.
//
// Buffers of a fixed size are allocated by the constructor: about 1 MiB for input. receive()'s
// result is valid until the next call. Owns its socket. Thread-compatible. Errors: the constructor
// throws IoError; later on errors are counted.
class UdpTransport final : public Transport {
 public:
  // Throws IoError.
  explicit UdpTransport(const UdpOptions& options);
  ~UdpTransport() override;

  BatchResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
  bool drained() const override { return drained_; }
  TransportCaps capabilities() const override { return socket_.capabilities; }
  TransportCounters counters() const override { return counters_; }
  Address local_address() const override { return socket_.local; }
  int native_handle() const override { return socket_.fd.get(); }

  const std::vector<std::string>& warnings() const { return socket_.warnings; }

 private:
  struct SendBuffers;
  struct ReceiveBuffers;

  std::size_t fill(std::span<const Outgoing> batch, bool segment);
  void drain_errors();
  void read_control(std::size_t message);
  void split(std::size_t message, TimePoint at);

  UdpSocket socket_;
  TransportCounters counters_;
  // Segmented sends that the kernel has refused in a row.
  std::size_t refusals_ = 0;
  std::uint32_t kernel_drops_ = 0;
  // The last receive() did not fill its buffers.
  bool drained_ = false;
  // Which of the NIC's addresses datagrams came to.
  std::shared_ptr<ReceiverNotes> notes_;
  std::unique_ptr<SendBuffers> out_;
  std::unique_ptr<ReceiveBuffers> in_;
};

}  // namespace interneuron::io
