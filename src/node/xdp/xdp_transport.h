// The AF_XDP sockets of one NIC as a Transport, one for each of its receive queues: datagrams leave
// and arrive as frames (FrameTransport), before the kernel has made packets of them.
//
// An XDP program on the NIC hands over the frames of this port (XdpProgram); they arrive in memory
// that the kernel shares (XdpSocket), with the time at which they came. Each datagram leaves as one
// frame, many per call, past the queueing discipline of the NIC, its checksum completed here: the
// kernel neither segments nor coalesces. A sender on this host may leave the checksum to the NIC,
// and nobody says so any more: a frame that holds the sum over the pseudo header alone is taken as
// well (FrameContext::may_be_partial). What does not fit into the kernel's queue waits in the
// memory for the next send() or receive(); send() says so (BatchResult::refused), since nobody else
// comes back to it. While no memory for frames is left, it takes nothing.
//
// Only NICs with Ethernet headers: not loopback, tun and modems in raw IP mode. One XDP program and
// one AF_XDP socket per queue at a time: the constructor says when somebody else has them.
//
// What strangers can do: as with every FrameTransport. Frames to this port are taken only where
// they are to an address of the NIC (or the one that is bound), so that what is for others on this
// host or behind it goes on to the kernel. Of a VLAN whose tag the NIC has taken off nobody can
// tell: such frames are taken for untagged ones.
//
// Receive queues are counted every second, since somebody may switch more of them on; frames of
// those that have no socket, because there are too many or one cannot be opened, go to the kernel,
// which drops them, and are counted (`receive_errors`), as is all else for this port that the
// program leaves to the kernel.
//
// Memory: XdpSocket's for each queue. receive()'s views are valid until the next call. Owns its
// sockets and the program. Needs CAP_NET_RAW, CAP_NET_ADMIN and CAP_BPF of the host, not of a user
// namespace. Thread-compatible. Errors: the constructor throws IoError; later on errors are
// counted.
#pragma once

#include <memory>
#include <vector>

#include "node/io/file_descriptor.h"
#include "node/ring/frame_transport.h"
#include "node/xdp/xdp_socket.h"

namespace interneuron::io {

class XdpTransport final : public FrameTransport {
 public:
  // The buffer sizes of UdpOptions are not used: the memory has its own. Throws IoError.
  explicit XdpTransport(const UdpOptions& options);
  ~XdpTransport() override;

  // Readable when one of the sockets is; never writable, which nobody need wait for.
  int native_handle() const override { return poll_all_.get(); }

 private:
  int offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) override;
  void collect(TimePoint now) override;
  void follow_card() override;
  // Opens the sockets of receive queues that have none, below so many.
  void open_sockets(const std::string& nic, std::uint32_t queues, bool may_wait);
  void follow_queues();
  // The sockets that something has arrived at give it to take(); false: there was nothing.
  bool take_arrived();
  Obstacle write(const Outgoing& datagram, const FrameHeader& header);

  XdpProgram program_;
  // By receive queue.
  std::vector<std::unique_ptr<XdpSocket>> sockets_;
  // Polls all of them, also those that come later.
  FileDescriptor poll_all_;
  TimePoint next_look_at_drops_ = TimePoint::min();
  TimePoint next_look_at_queues_ = TimePoint::min();
};

}  // namespace interneuron::io
