// One NIC's UDP socket as a Transport.
//
// Datagrams of equal size to one address leave as one segmented send (UDP_SEGMENT), many sends per
// call (sendmmsg), in the parts that they are given in, and arrive coalesced (UDP_GRO), many per
// call (recvmmsg): 26 times the rate of plain sends (docs/constants.md, "Datagrams and sockets"). A
// batch that the kernel refuses to segment is sent one by one. The errors of the network that a
// socket may report (a host that cannot be reached) drop the datagram they hit and are counted:
// ICMP is a hint that anybody can forge. What the kernel takes not just now (ENOBUFS, EPERM) is
// left to be offered again. The socket's error queue, which would make the handle readable for ever
// and takes room from what arrives, is emptied and counted. Datagrams that arrive bear the kernel's
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
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "node/io/receiver_notes.h"
#include "node/io/udp_socket.h"

namespace interneuron::io {

class UdpTransport final : public Transport {
 public:
  // Throws IoError.
  explicit UdpTransport(const UdpOptions& options);
  ~UdpTransport() override;

  BatchResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
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
  // Which of the NIC's addresses datagrams came to.
  ReceiverNotes notes_;
  std::unique_ptr<SendBuffers> out_;
  std::unique_ptr<ReceiveBuffers> in_;
};

}  // namespace interneuron::io
