#include "host/io/ring_transport.h"

#include <linux/if_arp.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "host/io/address.h"
#include "host/io/ring_filter.h"
#include "host/io/segment_run.h"
#include "host/io/steady_clock.h"

namespace interneuron::io {

namespace {

// The next three as in udp_transport.cc: frames per sendmmsg, parts of datagrams per sendmmsg, and
// refusals in a row after which segmentation stays off.
constexpr std::size_t kSendMessages = 32;
constexpr std::size_t kSendVectors = 2048;
constexpr std::size_t kRefusalsToGiveUp = 8;
constexpr std::size_t kMostParts = 3;
// Datagrams per frame that is received: UDP_MAX_SEGMENTS of Linux >= 6.9.
constexpr std::size_t kMaxCoalesced = 128;
// The buffers of the socket that only holds the port: the kernel grants its least.
constexpr std::size_t kHolderBufferBytes = 1024;
// Sizes of IP and UDP headers, bytes: what counts against the MTU.
constexpr std::size_t kHeaders4 = 20 + 8;
constexpr std::size_t kHeaders6 = 40 + 8;
// Where the checksum stands in a UDP header.
constexpr std::uint16_t kUdpCheckAt = 6;
constexpr std::uint16_t kVlanMask = 0x0fff;

UdpSocket hold_port(const UdpOptions& options) {
  UdpOptions small = options;
  small.receive_buffer_bytes = small.send_buffer_bytes = kHolderBufferBytes;
  UdpSocket socket = open_udp_socket(small);
  // Without it the kernel divides a datagram that stands for many before it looks at the filter. It
  // is from Linux 5.0; what cannot be had only costs time.
  const int on = 1;
  ::setsockopt(socket.fd.get(), SOL_UDP, UDP_GRO, &on, sizeof on);
  auto code = drop_all_filter();
  const sock_fprog program{static_cast<unsigned short>(code.size()), code.data()};
  if (::setsockopt(socket.fd.get(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) != 0) {
    const int error = errno;
    throw IoError("cannot hold the port on " + options.nic + " (setsockopt SO_ATTACH_FILTER: " +
                      std::strerror(error) + "); use --transport udp",
                  error);
  }
  return socket;
}

Nic card_of(const UdpOptions& options) {
  const auto nic = options.card ? options.card : find_nic(options.nic);
  if (!nic) throw UnknownNic(unknown_nic_text(options.nic));
  return *nic;
}

bool is_raw_ip(std::uint16_t type) { return type == ARPHRD_NONE || type == ARPHRD_RAWIP; }

PacketRing::Device device_of(const PacketRing& ring, const std::string& nic) {
  const auto device = ring.device();
  if (!device) throw IoError("there is no such network card: " + nic, ENODEV);
  if (device->type != ARPHRD_ETHER && device->type != ARPHRD_LOOPBACK && !is_raw_ip(device->type)) {
    throw IoError(nic + " has frames of a kind that is not known (type " +
                      std::to_string(device->type) + "); use --transport udp",
                  EPROTONOSUPPORT);
  }
  return *device;
}

// An address without port and note, as a source.
Address host_only(const Address& address) {
  Address out = with_port(address, 0);
  ReceiverNotes::put(out, 0);
  return out;
}

Address address_of(const ReceiverNotes::Host& host, const Address& like) {
  Address out = host_only(like);
  const bool ipv6 = is_ipv6(like);
  std::memcpy(&out.raw[ipv6 ? offsetof(sockaddr_in6, sin6_addr) : offsetof(sockaddr_in, sin_addr)],
              host.data(), ipv6 ? sizeof(in6_addr) : sizeof(in_addr));
  return out;
}

bool refuses_segmentation(int error) {
  // Kernels before 6.2 do not know it; others refuse it when the header says what cannot be.
  return error == EINVAL || error == EMSGSIZE || error == EIO || error == EOPNOTSUPP;
}

}  // namespace

struct RingTransport::SendBuffers {
  std::array<mmsghdr, kSendMessages> messages;
  // How many datagrams each message has.
  std::array<std::size_t, kSendMessages> datagrams;
  std::array<iovec, kSendVectors> vectors;
  std::array<sockaddr_ll, kSendMessages> names;
  // What the kernel is to do, and the headers, in one piece.
  std::array<std::array<std::byte, sizeof(OffloadHeader) + kMostHeaderBytes>, kSendMessages>
      headers;
  std::array<std::size_t, kSendMessages> header_bytes;
};

RingTransport::RingTransport(const UdpOptions& options)
    : holder_(hold_port(options)),
      note_receivers_(options.answer_from_receiver && is_unspecified(holder_.local)),
      card_(card_of(options)),
      ring_(card_.index, options.nic, options.send_buffer_bytes),
      device_(device_of(ring_, options.nic)),
      hops_(card_.index, device_.type == ARPHRD_ETHER, holder_.fd.get()),
      out_(std::make_unique<SendBuffers>()) {
  capabilities_ = {.segmentation_offload = true,
                   .receive_offload = true,
                   .max_datagram_bytes = kMostPayloadBytes,
                   .send_buffer_bytes = ring_.send_buffer_bytes(),
                   .receive_buffer_bytes = PacketRing::kBlocks * PacketRing::kBlockBytes};
  warnings_ = holder_.warnings;
  warnings_.push_back("packets of " + options.nic + " (port " +
                      std::to_string(port_of(holder_.local)) +
                      ") bypass nftables and NAT of this host; use --transport udp if rules must "
                      "apply to them");
  ring_.start(ring_filter({.ethernet = !is_raw_ip(device_.type),
                           .ipv6 = is_ipv6(holder_.local),
                           .port = port_of(holder_.local)}));
}

RingTransport::~RingTransport() = default;

// Reads the NIC's addresses, MTU and hardware address anew; what cannot be read stays.
void RingTransport::read_card() {
  const auto device = ring_.device();
  if (!device) {
    gone_ = true;
    return;
  }
  device_ = *device;
  if (auto card = hops_.read_card()) card_ = std::move(*card);
}

void RingTransport::follow_changes(TimePoint now) {
  const NextHops::Changes changes = hops_.take_events(now);
  if (changes.gone && nic_vanished(holder_.fd.get())) gone_ = true;
  if (changes.card && !gone_) read_card();
}

// Counts datagrams that are dropped; returns how many those are.
std::size_t RingTransport::drop(std::size_t count, int error) {
  if (count == 0) return 0;
  counters_.send_errors += count;
  counters_.last_send_error = error;
  return count;
}

// Writes the headers of a run of datagrams to one address as message number `message`.
RingTransport::Obstacle RingTransport::prepare(std::span<const Outgoing> run, std::size_t message,
                                               TimePoint now) {
  const Outgoing& first = run[0];
  const bool ipv6 = is_ipv6(first.to);
  if (family_of(first.to) != family_of(holder_.local)) return {.error = EAFNOSUPPORT};
  const std::size_t headers = ipv6 ? kHeaders6 : kHeaders4;
  if (first.size() > kMostPayloadBytes || first.size() + headers > card_.mtu) {
    return {.error = EMSGSIZE};
  }
  Address source;
  if (!is_unspecified(holder_.local)) {
    source = host_only(holder_.local);
  } else if (const auto* noted = notes_.find(first.to)) {
    source = address_of(*noted, holder_.local);
  }
  const NextHops::Hop hop = hops_.find(host_only(first.to), source, now);
  if (hop.state == NextHops::State::kAsking) return {.error = EAGAIN, .asking = true};
  if (hop.state != NextHops::State::kKnown) return {.error = EHOSTUNREACH};
  std::size_t bytes = 0;
  for (const Outgoing& datagram : run) bytes += datagram.size();
  FrameAddresses addresses{
      .from = with_port(hop.source, port_of(holder_.local)), .to = first.to, .ecn = first.ecn};
  if (!is_raw_ip(device_.type)) {
    addresses.ethernet = EthernetHeader{.to = hop.mac, .from = device_.mac};
  }
  const auto header = build_header(addresses, bytes);
  if (!header) return {.error = EMSGSIZE};
  OffloadHeader offload{.flags = OffloadHeader::kNeedsChecksum,
                        .header_bytes = static_cast<std::uint16_t>(header->size),
                        .checksum_start = static_cast<std::uint16_t>(header->udp_at),
                        .checksum_offset = kUdpCheckAt};
  if (run.size() > 1) {
    offload.kind = OffloadHeader::kUdpSegments;
    offload.segment_bytes = static_cast<std::uint16_t>(first.size());
  }
  auto& out = out_->headers[message];
  std::memcpy(out.data(), &offload, sizeof offload);
  std::ranges::copy(header->view(), out.begin() + sizeof offload);
  out_->header_bytes[message] = sizeof offload + header->size;
  sockaddr_ll& name = out_->names[message];
  name = {};
  name.sll_family = AF_PACKET;
  name.sll_protocol = htons(ipv6 ? ETH_P_IPV6 : ETH_P_IP);
  name.sll_ifindex = card_.index;
  return {};
}

// Describes the head of `batch` to the kernel; returns the number of messages, and what keeps the
// datagram behind them from being sent.
std::size_t RingTransport::fill(std::span<const Outgoing> batch, bool segment, TimePoint now,
                                Obstacle& obstacle) {
  std::size_t messages = 0;
  std::size_t vectors = 0;
  while (!batch.empty() && messages < kSendMessages) {
    const std::size_t count = segment ? run_length(batch) : 1;
    if (vectors + 1 + kMostParts * count > kSendVectors) break;
    obstacle = prepare(batch.first(count), messages, now);
    if (obstacle.error != 0) break;
    msghdr& header = out_->messages[messages].msg_hdr;
    header = {};
    header.msg_name = &out_->names[messages];
    header.msg_namelen = sizeof out_->names[messages];
    header.msg_iov = &out_->vectors[vectors];
    const std::size_t first = vectors;
    out_->vectors[vectors++] = {out_->headers[messages].data(), out_->header_bytes[messages]};
    for (const Outgoing& datagram : batch.first(count)) {
      for (const ByteView part : {datagram.head, datagram.payload, datagram.tail}) {
        if (part.empty()) continue;
        // The kernel only reads it; it is not const because sendmsg shares its struct with recvmsg.
        out_->vectors[vectors++] = {const_cast<std::byte*>(part.data()), part.size()};
      }
    }
    header.msg_iovlen = vectors - first;
    out_->datagrams[messages++] = count;
    batch = batch.subspan(count);
  }
  return messages;
}

// Counts the datagrams of messages that the kernel has taken; returns how many those are.
std::size_t RingTransport::count_sent(int messages) {
  ++counters_.send_calls;
  std::size_t datagrams = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(messages); ++i) {
    if (out_->datagrams[i] > 1) refusals_ = 0;
    datagrams += out_->datagrams[i];
  }
  counters_.sent_datagrams += datagrams;
  return datagrams;
}

// Offers the head of `batch` to the kernel once. Returns the errno of what stands in the way of the
// first datagram that was not taken; 0: nothing, go on.
int RingTransport::offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) {
  const bool segment = capabilities_.segmentation_offload && result.taken >= unsegmented_until_;
  auto rest = batch.subspan(result.taken);
  if (!segment && unsegmented_until_ > result.taken) {
    rest = rest.first(unsegmented_until_ - result.taken);
  }
  Obstacle obstacle;
  const std::size_t messages = fill(rest, segment, now, obstacle);
  if (messages == 0) {
    result.refused = obstacle.asking;
    return obstacle.error;
  }
  const int sent = ::sendmmsg(native_handle(), out_->messages.data(),
                              static_cast<unsigned>(messages), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent > 0) {
    result.taken += count_sent(sent);
    return 0;
  }
  const int error = errno;
  if (error == EINTR) return 0;
  if (error == EAGAIN || error == EWOULDBLOCK) {
    result.would_block = true;
  } else if (out_->datagrams[0] > 1 && refuses_segmentation(error)) {
    ++counters_.offload_refused;
    if (++refusals_ >= kRefusalsToGiveUp) capabilities_.segmentation_offload = false;
    unsegmented_until_ = result.taken + out_->datagrams[0];
    return 0;
  } else {
    gone_ = nic_vanished(holder_.fd.get());
    result.refused = !gone_ && (error == ENOBUFS || error == EPERM);
  }
  return error;
}

BatchResult RingTransport::send(std::span<const Outgoing> batch) {
  const TimePoint now = io::now();
  follow_changes(now);
  BatchResult result;
  unsegmented_until_ = 0;
  while (result.taken < batch.size() && !gone_) {
    const int error = offer(batch, now, result);
    if (result.would_block) return result;
    if (result.refused) {
      ++counters_.send_refusals;
      counters_.last_send_error = error;
      return result;
    }
    // One that cannot be sent leaves those behind it their chance.
    if (error != 0 && !gone_) result.taken += drop(1, error);
  }
  if (gone_) {
    result.gone = ENODEV;
    result.taken += drop(batch.size() - result.taken, ENODEV);
  }
  return result;
}

std::span<const Incoming> RingTransport::receive() {
  datagrams_.clear();
  const TimePoint now = io::now();
  follow_changes(now);
  const Duration offset = wall_offset();
  const bool was_idle = !ring_.holds_block();
  // A block of which nothing is ours is no reason to stop, but a flood of such must not keep us.
  for (std::size_t i = 0; i < PacketRing::kBlocks && datagrams_.empty(); ++i) {
    if (!ring_.next_block()) {
      // A card that goes down leaves an error at the socket, which would be reported as readable
      // until somebody takes it. Whoever gives a block back comes again if there is one.
      int error = 0;
      socklen_t size = sizeof error;
      if (was_idle) ::getsockopt(native_handle(), SOL_SOCKET, SO_ERROR, &error, &size);
      break;
    }
    ++counters_.receive_calls;
    while (const auto frame = ring_.next_frame()) take(*frame, now, offset);
    counters_.receive_queue_drops += ring_.take_drops();
  }
  counters_.received_datagrams += datagrams_.size();
  return datagrams_;
}

void RingTransport::refuse(FrameProblem problem) {
  ++refused_[static_cast<std::size_t>(problem)];
  ++counters_.receive_errors;
}

// Whether a datagram to this address is for this transport.
bool RingTransport::is_ours(const Address& to) const {
  if (port_of(to) != port_of(holder_.local)) return false;
  if (!is_unspecified(holder_.local)) return to == holder_.local;
  // All of 127/8 is at home on the loopback card.
  if (device_.type == ARPHRD_LOOPBACK && is_loopback(to)) return true;
  const Address host = with_port(to, 0);
  return std::ranges::find(card_.addresses, host) != card_.addresses.end();
}

// Adds the datagrams of a frame to the result.
void RingTransport::take(const PacketRing::Frame& frame, TimePoint now, Duration wall_offset) {
  if (frame.cut) return refuse(FrameProblem::kTruncated);
  if (frame.tag && (*frame.tag & kVlanMask) != 0) return refuse(FrameProblem::kVlan);
  const auto parsed = parse_frame(frame.bytes, {.ethernet = !is_raw_ip(device_.type),
                                                .checksum_known = frame.checksum_known,
                                                .loopback = device_.type == ARPHRD_LOOPBACK,
                                                .device = static_cast<std::uint32_t>(card_.index)});
  if (const auto* problem = std::get_if<FrameProblem>(&parsed)) return refuse(*problem);
  const ParsedFrame& datagram = std::get<ParsedFrame>(parsed);
  if (!is_ours(datagram.to)) return;
  ByteView rest = datagram.payload;
  std::size_t segment = 0;
  const int kind = frame.offload.kind & ~OffloadHeader::kEcnMark;
  if (kind == OffloadHeader::kUdpSegments) {
    segment = frame.offload.segment_bytes;
    if (segment == 0 || rest.size() > segment * kMaxCoalesced) {
      return refuse(FrameProblem::kUdpLength);
    }
  } else if (kind != OffloadHeader::kNoSegments) {
    // To be cut into fragments of IP.
    return refuse(FrameProblem::kFragment);
  }
  Incoming out{.from = datagram.from, .bytes = {}, .ecn = datagram.ecn};
  out.at = instant_of_stamp(frame.stamp, now, wall_offset);
  if (note_receivers_) {
    const bool ipv6 = is_ipv6(datagram.to);
    ReceiverNotes::put(out.from,
                       notes_.note_of(&datagram.to.raw[ipv6 ? offsetof(sockaddr_in6, sin6_addr)
                                                            : offsetof(sockaddr_in, sin_addr)],
                                      ipv6 ? sizeof(in6_addr) : sizeof(in_addr)));
  }
  while (segment > 0 && rest.size() > segment) {
    out.bytes = rest.first(segment);
    datagrams_.push_back(out);
    rest = rest.subspan(segment);
  }
  out.bytes = rest;
  datagrams_.push_back(out);
}

}  // namespace interneuron::io
