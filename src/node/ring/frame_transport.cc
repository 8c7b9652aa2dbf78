#include "node/ring/frame_transport.h"

#include <linux/ethtool.h>
#include <linux/if_arp.h>
#include <linux/sock_diag.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>
#include <variant>

#include "node/io/address.h"
#include "node/io/steady_clock.h"
#include "node/ring/ring_filter.h"

namespace interneuron::io {

namespace {

// Datagrams per frame that is received: UDP_MAX_SEGMENTS of Linux >= 6.9.
constexpr std::size_t kMaxCoalesced = 128;
// The buffers of the socket that only holds the port: the kernel grants its least.
constexpr std::size_t kHolderBufferBytes = 1024;
// Sizes of IP and UDP headers, bytes: what counts against the MTU.
constexpr std::size_t kHeaders4 = 20 + 8;
constexpr std::size_t kHeaders6 = 40 + 8;
constexpr std::uint16_t kTagVlanMask = 0x0fff;

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

}  // namespace

FrameTransport::FrameTransport(const UdpOptions& options, const TransportCaps& capabilities)
    : capabilities_(capabilities),
      holder_(hold_port(options)),
      note_receivers_(options.answer_from_receiver && is_unspecified(holder_.local)),
      card_(card_of(options)),
      device_(known_device(options.nic)),
      hops_(card_.index, device_.type == ARPHRD_ETHER, holder_.fd.get()),
      warnings_(holder_.warnings) {
  capabilities_.max_datagram_bytes = kMostPayloadBytes;
  warnings_.push_back("packets of " + options.nic + " (port " +
                      std::to_string(port_of(holder_.local)) +
                      ") bypass nftables and NAT of this host; use --transport udp if rules must "
                      "apply to them");
}

bool FrameTransport::has_ethernet_headers() const { return !is_raw_ip(device_.type); }

bool FrameTransport::is_loopback_card() const { return device_.type == ARPHRD_LOOPBACK; }

// By the number of the NIC, which keeps it when it gets another name, in the network namespace of
// the holder, whichever the thread is in.
std::optional<FrameTransport::Device> FrameTransport::read_device() const {
  ifreq request{};
  request.ifr_ifindex = card_.index;
  if (::ioctl(holder_.fd.get(), SIOCGIFNAME, &request) != 0 ||
      ::ioctl(holder_.fd.get(), SIOCGIFHWADDR, &request) != 0) {
    return std::nullopt;
  }
  Device out{.type = request.ifr_hwaddr.sa_family};
  std::memcpy(out.mac.data(), request.ifr_hwaddr.sa_data, out.mac.size());
  return out;
}

std::string FrameTransport::card_name() const {
  ifreq request{};
  request.ifr_ifindex = card_.index;
  if (::ioctl(holder_.fd.get(), SIOCGIFNAME, &request) != 0) return {};
  return {request.ifr_name, ::strnlen(request.ifr_name, IFNAMSIZ)};
}

std::uint32_t FrameTransport::receive_queues() const {
  ethtool_channels channels{};
  channels.cmd = ETHTOOL_GCHANNELS;
  ifreq request{};
  card_name().copy(request.ifr_name, IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&channels);
  if (::ioctl(holder_.fd.get(), SIOCETHTOOL, &request) != 0) return card_.receive_queues;
  return std::max(1U, channels.rx_count + channels.combined_count);
}

std::uint64_t FrameTransport::take_missed() {
  std::array<std::uint32_t, SK_MEMINFO_VARS> figures{};
  socklen_t size = sizeof figures;
  // From Linux 4.12.
  if (::getsockopt(holder_.fd.get(), SOL_SOCKET, SO_MEMINFO, figures.data(), &size) != 0) return 0;
  const std::uint32_t missed = figures[SK_MEMINFO_DROPS];
  return missed - std::exchange(missed_, missed);
}

FrameTransport::Device FrameTransport::known_device(const std::string& nic) const {
  const auto device = read_device();
  if (!device) throw IoError("there is no such network card: " + nic, ENODEV);
  if (device->type != ARPHRD_ETHER && device->type != ARPHRD_LOOPBACK && !is_raw_ip(device->type)) {
    throw IoError(nic + " has frames of a kind that is not known (type " +
                      std::to_string(device->type) + "); use --transport udp",
                  EPROTONOSUPPORT);
  }
  return *device;
}

// Reads the NIC's addresses, MTU and hardware address anew; what cannot be read stays.
void FrameTransport::read_card() {
  const auto device = read_device();
  if (!device) {
    gone_ = true;
    return;
  }
  device_ = *device;
  if (auto card = hops_.read_card()) card_ = std::move(*card);
  follow_card();
}

void FrameTransport::follow_changes(TimePoint now) {
  const NextHops::Changes changes = hops_.take_events(now);
  if (changes.gone && nic_vanished(holder_.fd.get())) gone_ = true;
  if (changes.card && !gone_) read_card();
}

// Counts datagrams that are dropped; returns how many those are.
std::size_t FrameTransport::drop(std::size_t count, int error) {
  if (count == 0) return 0;
  counters_.send_errors += count;
  counters_.last_send_error = error;
  return count;
}

FrameTransport::Obstacle FrameTransport::address(std::span<const Outgoing> run, TimePoint now,
                                                 FrameHeader& header) {
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
  if (has_ethernet_headers()) {
    addresses.ethernet = EthernetHeader{.to = hop.mac, .from = device_.mac};
  }
  const auto built = build_header(addresses, bytes);
  if (!built) return {.error = EMSGSIZE};
  header = *built;
  return {};
}

void FrameTransport::judge_refusal(int error, BatchResult& result) {
  gone_ = nic_vanished(holder_.fd.get());
  result.refused = !gone_ && (error == ENOBUFS || error == EPERM);
}

// A peer whose hardware address is asked for is waited for by what goes to it alone: the address
// may be one that a stranger has made up, and nobody else is to wait for that.
bool FrameTransport::others_wait_behind(std::span<const Outgoing> batch) {
  if (batch.empty()) return false;
  const Address host = host_only(batch[0].to);
  return std::ranges::any_of(
      batch, [&host](const Outgoing& datagram) { return host_only(datagram.to) != host; });
}

BatchResult FrameTransport::send(std::span<const Outgoing> batch) {
  const TimePoint now = io::now();
  follow_changes(now);
  BatchResult result;
  // Once also where nothing is offered: the transport may hold some of what it took earlier.
  for (bool first = true; !gone_ && (first || result.taken < batch.size()); first = false) {
    const int error = offer(batch, now, result);
    const auto rest = batch.subspan(result.taken);
    if (result.would_block) return result;
    if (result.refused && error == EAGAIN && others_wait_behind(rest)) {
      result.refused = false;
      result.taken += drop(1, EHOSTUNREACH);
      continue;
    }
    if (result.refused) {
      ++counters_.send_refusals;
      counters_.last_send_error = error;
      return result;
    }
    // One that cannot be sent leaves those behind it their chance.
    if (error != 0 && !gone_ && !rest.empty()) result.taken += drop(1, error);
  }
  if (gone_) {
    result.gone = ENODEV;
    result.taken += drop(batch.size() - result.taken, ENODEV);
  }
  return result;
}

std::span<const Incoming> FrameTransport::receive() {
  datagrams_.clear();
  const TimePoint now = io::now();
  follow_changes(now);
  collect(now);
  counters_.received_datagrams += datagrams_.size();
  return datagrams_;
}

void FrameTransport::refuse(FrameProblem problem) {
  ++refused_[static_cast<std::size_t>(problem)];
  ++counters_.receive_errors;
}

// Whether a datagram to this address is for this transport.
bool FrameTransport::is_ours(const Address& to) const {
  if (port_of(to) != port_of(holder_.local)) return false;
  if (!is_unspecified(holder_.local)) return to == holder_.local;
  // All of 127/8 is at home on the loopback card.
  if (is_loopback_card() && is_loopback(to)) return true;
  const Address host = with_port(to, 0);
  return std::ranges::find(card_.addresses, host) != card_.addresses.end();
}

void FrameTransport::take(const Arrived& frame) {
  if (frame.tag && (*frame.tag & kTagVlanMask) != 0) return refuse(FrameProblem::kVlan);
  const auto parsed = parse_frame(frame.bytes, {.ethernet = has_ethernet_headers(),
                                                .checksum_known = frame.checksum_known,
                                                .may_be_partial = frame.may_be_partial,
                                                .loopback = is_loopback_card(),
                                                .device = static_cast<std::uint32_t>(card_.index)});
  if (const auto* problem = std::get_if<FrameProblem>(&parsed)) return refuse(*problem);
  const ParsedFrame& datagram = std::get<ParsedFrame>(parsed);
  if (!is_ours(datagram.to)) return;
  ByteView rest = datagram.payload;
  const std::size_t segment = frame.segment_bytes;
  if (segment > 0 && rest.size() > segment * kMaxCoalesced) {
    return refuse(FrameProblem::kUdpLength);
  }
  Incoming out{.from = datagram.from, .bytes = {}, .at = frame.at, .ecn = datagram.ecn};
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
