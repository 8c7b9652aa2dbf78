// What transports have in common that send and receive frames of one NIC themselves, beside the
// kernel's IP layer, sockets and packet filter (RingTransport, XdpTransport): the port, the NIC as
// it is now, where frames go, their headers, and the judgement of those that arrive. A derived
// class moves the frames.
//
// A UDP socket on the same address holds the port, so that others cannot have it and the kernel
// answers no datagram with "port unreachable"; a filter drops all that it would receive. Where
// frames go is said by NextHops: while the hardware address of a peer is being asked for, send()
// refuses (BatchResult::refused); nothing is queued. An unreachable peer, a datagram larger than
// the NIC's MTU or an address of the other family drops the datagram and is counted.
//
// What strangers can do: anybody may send frames. Nothing of the kernel stands between: nftables,
// NAT, reverse path filters do not apply, and warnings() says so. parse_frame() judges what comes.
// Datagrams to other addresses than the NIC's own (or the one that is bound), fragments, VLANs and
// multicast are refused; what parse_frame() refuses is counted by reason. The address of the sender
// can be forged, as with any datagram. UdpOptions::answer_from_receiver works as in UdpTransport.
//
// Owns its sockets. Thread-compatible. Errors: the constructor throws IoError; later on errors are
// counted.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "node/io/receiver_notes.h"
#include "node/io/udp_socket.h"
#include "node/ring/frame.h"
#include "node/ring/next_hops.h"

namespace interneuron::io {

class FrameTransport : public Transport {
 public:
  BatchResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
  TransportCaps capabilities() const override { return capabilities_; }
  TransportCounters counters() const override { return counters_; }
  Address local_address() const override { return holder_.local; }

  // One line each: that the kernel's packet filter is bypassed, and what could not be had as asked.
  const std::vector<std::string>& warnings() const { return warnings_; }
  // Frames for this port that were refused for this reason; they are among `receive_errors`.
  std::uint64_t refused(FrameProblem problem) const {
    return refused_[static_cast<std::size_t>(problem)];
  }

 protected:
  // What keeps a datagram from being sent: nothing (0), an errno, or `asking` for the hardware
  // address that it goes to.
  struct Obstacle {
    int error = 0;
    bool asking = false;
  };
  // A frame that has arrived, with what is known of it beside its bytes.
  struct Arrived {
    ByteView bytes;
    TimePoint at = TimePoint::min();
    // As in FrameContext.
    bool checksum_known = false;
    bool may_be_partial = false;
    // The TCI of a tag that the kernel or the NIC has taken off.
    std::optional<std::uint16_t> tag{};
    // The size of the datagrams that it stands for, of which the last may be shorter; 0: it is one.
    std::size_t segment_bytes = 0;
  };

  // `capabilities`: what the derived class can do. Throws IoError, also when the NIC has frames of
  // a kind that is not known.
  FrameTransport(const UdpOptions& options, const TransportCaps& capabilities);

  // Offers datagrams of `batch` to the kernel once, from the one behind `result.taken` on, and adds
  // to `result` those that it took. Returns the errno of what stands in the way of the first one
  // that it did not, or of some that it took earlier (BatchResult::refused); 0: nothing, go on.
  // Called with an empty batch too.
  virtual int offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) = 0;
  // Calls take() or refuse() with frames that have arrived; their bytes stay until the next call.
  virtual void collect(TimePoint now) = 0;
  // The NIC has other addresses, another MTU or hardware address now.
  virtual void follow_card() {}

  // The headers of a run of datagrams to one address that leaves as one frame, their checksum still
  // to be completed.
  Obstacle address(std::span<const Outgoing> run, TimePoint now, FrameHeader& header);
  // Whether the kernel's refusal to send has gone away with the NIC, or may pass.
  void judge_refusal(int error, BatchResult& result);
  // Adds the datagrams of a frame to what receive() returns, if it is for this transport.
  void take(const Arrived& frame);
  void refuse(FrameProblem problem);
  bool received_any() const { return !datagrams_.empty(); }

  const Nic& card() const { return card_; }
  // The name of the NIC as it is now; empty when it is gone.
  std::string card_name() const;
  // How many receive queues of the NIC are in use: as its driver says, else as many as there are.
  std::uint32_t receive_queues() const;
  // How many datagrams to the port the kernel has taken for itself and dropped since the last call:
  // derived classes to which each of them is handed instead have missed them.
  std::uint64_t take_missed();
  bool has_ethernet_headers() const;
  bool is_loopback_card() const;
  const Mac& mac() const { return device_.mac; }

  TransportCaps capabilities_;
  TransportCounters counters_;

 private:
  struct Device {
    // ARPHRD_ETHER, …
    std::uint16_t type = 0;
    Mac mac{};
  };

  std::optional<Device> read_device() const;
  Device known_device(const std::string& nic) const;
  void read_card();
  void follow_changes(TimePoint now);
  std::size_t drop(std::size_t count, int error);
  static bool others_wait_behind(std::span<const Outgoing> batch);
  bool is_ours(const Address& to) const;

  UdpSocket holder_;
  bool note_receivers_;
  // The NIC as it was found, and as it is now: index, MTU, addresses.
  Nic card_;
  Device device_;
  NextHops hops_;
  ReceiverNotes notes_;
  std::array<std::uint64_t, kFrameProblems> refused_{};
  bool gone_ = false;
  // What the socket that holds the port has dropped, modulo 2^32.
  std::uint32_t missed_ = 0;
  std::vector<std::string> warnings_;
  std::vector<Incoming> datagrams_;
};

}  // namespace interneuron::io
