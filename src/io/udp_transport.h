// One NIC's UDP socket as a Transport.
//
// Datagrams of equal size to one address leave as one segmented send (UDP_SEGMENT), many sends per
// call (sendmmsg), and arrive coalesced (UDP_GRO), many per call (recvmmsg): 26 times the rate of
// plain sends (transport.md 5). A batch that the kernel refuses to segment is sent one by one. The
// errors of the network that a socket may report (a host that cannot be reached, a firewall) drop
// the datagram they hit and are counted: ICMP is a hint that anybody can forge.
//
// All buffers are allocated by the constructor. Thread-compatible.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "io/udp_socket.h"

namespace interneuron::io {

class UdpTransport final : public Transport {
 public:
  // Throws IoError.
  explicit UdpTransport(const UdpOptions& options);
  ~UdpTransport() override;

  SendResult send(std::span<const Outgoing> batch) override;
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
  void read_control(std::size_t message);
  void split(std::size_t message);

  UdpSocket socket_;
  TransportCounters counters_;
  std::size_t refusals_ = 0;  // of segmented sends in a row
  std::uint32_t kernel_drops_ = 0;
  std::unique_ptr<SendBuffers> out_;
  std::unique_ptr<ReceiveBuffers> in_;
};

}  // namespace interneuron::io
