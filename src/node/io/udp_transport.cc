#include "node/io/udp_socket.h"

#include <net/if.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "node/io/address.h"
#include "node/io/segment_run.h"
#include "node/io/steady_clock.h"

namespace interneuron::io {

namespace {

// Messages per recvmmsg, each of which is several datagrams that the kernel has coalesced: up to 1
// MiB, a quarter of the socket's buffer.
constexpr std::size_t kReceiveMessages = 16;
// Bytes per message that is received: the most that UDP_GRO coalesces.
constexpr std::size_t kReceiveBytes = 64 * 1024;
// Datagrams per message that is received: UDP_MAX_SEGMENTS of Linux >= 6.9.
constexpr std::size_t kMaxCoalesced = 128;
// Reports taken from the error queue in one go, so that a flood of them does not hold up datagrams.
// No measurement behind this value: while there are more, the handle stays readable.
constexpr std::size_t kReportsPerCall = 64;

bool refuses_segmentation(int error) {
  // EIO: the NIC computes no checksums. EINVAL, EMSGSIZE: a segment exceeds the MTU. The others
  // come from an old kernel.
  return error == EIO || error == EINVAL || error == EMSGSIZE || error == EOPNOTSUPP ||
         error == ENOPROTOOPT;
}

// Whether a send failed only for now: see TransportCounters::send_refusals.
bool refuses_for_now(int error) { return error == ENOBUFS || error == EPERM; }

struct alignas(cmsghdr) SendControl {
  std::array<std::byte, CMSG_SPACE(sizeof(std::uint16_t)) + CMSG_SPACE(sizeof(in6_pktinfo)) +
                            CMSG_SPACE(sizeof(int))>
      raw;
};

struct alignas(cmsghdr) ReceiveControl {
  std::array<std::byte, CMSG_SPACE(sizeof(int)) + CMSG_SPACE(sizeof(std::uint32_t)) +
                            CMSG_SPACE(sizeof(in6_pktinfo)) + CMSG_SPACE(sizeof(timespec)) +
                            CMSG_SPACE(sizeof(int))>
      raw;
};

// The ECN bits of the byte that IPv4 calls type of service and IPv6 traffic class (RFC 3168 §5).
constexpr std::uint8_t kEcnMask = 3;

template <class Value>
void append(msghdr& header, SendControl& control, int level, int type, const Value& value) {
  header.msg_control = control.raw.data();
  auto* item = reinterpret_cast<cmsghdr*>(&control.raw[header.msg_controllen]);
  header.msg_controllen += CMSG_SPACE(sizeof value);
  item->cmsg_level = level;
  item->cmsg_type = type;
  item->cmsg_len = CMSG_LEN(sizeof value);
  std::memcpy(CMSG_DATA(item), &value, sizeof value);
}

}  // namespace

struct UdpTransport::SendBuffers {
  std::array<mmsghdr, kSendMessages> messages;
  // How many datagrams each message has.
  std::array<std::size_t, kSendMessages> datagrams;
  std::array<iovec, kSendVectors> vectors;
  std::array<SendControl, kSendMessages> controls;
};

struct UdpTransport::ReceiveBuffers {
  std::array<mmsghdr, kReceiveMessages> messages;
  std::array<iovec, kReceiveMessages> vectors;
  std::array<sockaddr_storage, kReceiveMessages> names;
  std::array<ReceiveControl, kReceiveMessages> controls;
  // Per message: the size of its datagrams, 0 when it is a single one; the note of the address that
  // received it, 0 for none.
  std::array<std::size_t, kReceiveMessages> segment_bytes;
  std::array<std::uint8_t, kReceiveMessages> notes;
  // The ECN bits of its datagrams.
  std::array<std::uint8_t, kReceiveMessages> ecn;
  // When it arrived: the time of day by the kernel, zero for none.
  std::array<Duration, kReceiveMessages> stamps;
  std::vector<std::byte> bytes;
  std::vector<Incoming> datagrams;
};

UdpTransport::UdpTransport(const UdpOptions& options)
    : socket_(open_udp_socket(options)),
      notes_(options.notes ? options.notes : std::make_shared<ReceiverNotes>()),
      out_(std::make_unique<SendBuffers>()),
      in_(std::make_unique<ReceiveBuffers>()) {
  in_->bytes.resize(kReceiveMessages * kReceiveBytes);
  in_->datagrams.reserve(kReceiveMessages * kMaxCoalesced);
  // A kernel that does not stamp costs precision only, and one that does not tell of ECN the
  // signal.
  const int on = 1;
  ::setsockopt(native_handle(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  const bool ipv6 = family_of(socket_.local) == AF_INET6;
  ::setsockopt(native_handle(), ipv6 ? IPPROTO_IPV6 : IPPROTO_IP,
               ipv6 ? IPV6_RECVTCLASS : IP_RECVTOS, &on, sizeof on);
}

UdpTransport::~UdpTransport() = default;

namespace {

void append_ecn(msghdr& header, SendControl& control, int family, std::uint8_t ecn) {
  const int traffic_class = ecn & kEcnMask;
  if (family == AF_INET) {
    append(header, control, IPPROTO_IP, IP_TOS, traffic_class);
  } else {
    append(header, control, IPPROTO_IPV6, IPV6_TCLASS, traffic_class);
  }
}

// Makes the message leave from this address of the NIC.
void append_source(msghdr& header, SendControl& control, int family,
                   const ReceiverNotes::Host& address) {
  if (family == AF_INET) {
    in_pktinfo source{};
    std::memcpy(&source.ipi_spec_dst, address.data(), sizeof source.ipi_spec_dst);
    append(header, control, IPPROTO_IP, IP_PKTINFO, source);
  } else {
    in6_pktinfo source{};
    std::memcpy(&source.ipi6_addr, address.data(), sizeof source.ipi6_addr);
    append(header, control, IPPROTO_IPV6, IPV6_PKTINFO, source);
  }
}

}  // namespace

// Describes the head of `batch` to the kernel; returns the number of messages.
std::size_t UdpTransport::fill(std::span<const Outgoing> batch, bool segment) {
  std::size_t messages = 0;
  std::size_t vectors = 0;
  while (!batch.empty() && messages < kSendMessages) {
    const std::size_t count = segment ? run_length(batch) : 1;
    if (vectors + kMostParts * count > kSendVectors) break;
    msghdr& header = out_->messages[messages].msg_hdr;
    header = {};
    // The kernel only reads both; they are not const because sendmmsg shares its struct with
    // recvmmsg.
    header.msg_name = const_cast<std::byte*>(batch[0].to.raw.data());
    header.msg_namelen = batch[0].to.size;
    header.msg_iov = &out_->vectors[vectors];
    const std::size_t first = vectors;
    for (const Outgoing& datagram : batch.first(count)) {
      for (const ByteView part : {datagram.head, datagram.payload, datagram.tail}) {
        if (part.empty()) continue;
        out_->vectors[vectors++] = {const_cast<std::byte*>(part.data()), part.size()};
      }
    }
    header.msg_iovlen = vectors - first;
    SendControl& control = out_->controls[messages];
    if (count > 1) {
      append(header, control, SOL_UDP, UDP_SEGMENT, static_cast<std::uint16_t>(batch[0].size()));
    }
    if (batch[0].ecn != 0) append_ecn(header, control, family_of(batch[0].to), batch[0].ecn);
    if (const auto* source = notes_->find(batch[0].to)) {
      append_source(header, control, family_of(batch[0].to), *source);
    }
    out_->datagrams[messages++] = count;
    batch = batch.subspan(count);
  }
  return messages;
}

BatchResult UdpTransport::send(std::span<const Outgoing> batch) {
  BatchResult result;
  // Datagrams before this one go one by one, because the kernel refused to segment them.
  std::size_t unsegmented_until = 0;
  while (result.taken < batch.size()) {
    const bool segment =
        socket_.capabilities.segmentation_offload && result.taken >= unsegmented_until;
    auto rest = batch.subspan(result.taken);
    if (!segment && unsegmented_until > result.taken) {
      rest = rest.first(unsegmented_until - result.taken);
    }
    const std::size_t messages = fill(rest, segment);
    const int sent = ::sendmmsg(native_handle(), out_->messages.data(),
                                static_cast<unsigned>(messages), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent > 0) {
      ++counters_.send_calls;
      for (std::size_t i = 0; i < static_cast<std::size_t>(sent); ++i) {
        if (out_->datagrams[i] > 1) refusals_ = 0;
        result.taken += out_->datagrams[i];
        counters_.sent_datagrams += out_->datagrams[i];
      }
      continue;
    }
    const int error = errno;
    if (error == EINTR) continue;
    const std::size_t first = out_->datagrams[0];
    if (error == EAGAIN || error == EWOULDBLOCK) {
      result.would_block = true;
      return result;
    }
    if (first > 1 && refuses_segmentation(error)) {
      ++counters_.offload_refused;
      if (++refusals_ >= kRefusalsToGiveUp) socket_.capabilities.segmentation_offload = false;
      unsegmented_until = result.taken + first;
      continue;
    }
    result.gone = nic_vanished(native_handle()) ? ENODEV : 0;
    if (result.gone == 0 && refuses_for_now(error)) {
      ++counters_.send_refusals;
      counters_.last_send_error = error;
      result.refused = true;
      return result;
    }
    const std::size_t dropped = result.gone != 0 ? batch.size() - result.taken : first;
    result.taken += dropped;
    counters_.send_errors += dropped;
    counters_.last_send_error = error;
  }
  return result;
}

std::span<const Incoming> UdpTransport::receive() {
  ReceiveBuffers& in = *in_;
  in.datagrams.clear();
  for (std::size_t i = 0; i < kReceiveMessages; ++i) {
    in.vectors[i] = {&in.bytes[i * kReceiveBytes], kReceiveBytes};
    msghdr& header = in.messages[i].msg_hdr;
    header = {};
    header.msg_name = &in.names[i];
    header.msg_namelen = sizeof in.names[i];
    header.msg_iov = &in.vectors[i];
    header.msg_iovlen = 1;
    header.msg_control = in.controls[i].raw.data();
    header.msg_controllen = in.controls[i].raw.size();
  }
  int count = 0;
  do {
    count =
        ::recvmmsg(native_handle(), in.messages.data(), kReceiveMessages, MSG_DONTWAIT, nullptr);
  } while (count < 0 && errno == EINTR);
  drained_ = count < static_cast<int>(kReceiveMessages);
  if (count < 0) {
    if (errno != EAGAIN && errno != EWOULDBLOCK) ++counters_.receive_errors;
    // Whoever polls cannot tell a report from a datagram: where there is none, it may be that.
    drain_errors();
    return {};
  }
  ++counters_.receive_calls;
  const TimePoint now = io::now();
  const Duration offset = wall_offset();
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    read_control(i);
    const Duration stamp = in.stamps[i];
    split(i, stamp > Duration::zero() ? instant_of_stamp(stamp, now, offset) : TimePoint::min());
  }
  counters_.received_datagrams += in.datagrams.size();
  return in.datagrams;
}

// What reports say is not looked at: that of the network can be forged.
void UdpTransport::drain_errors() {
  for (std::size_t i = 0; i < kReportsPerCall; ++i) {
    msghdr nothing{};
    if (::recvmsg(native_handle(), &nothing, MSG_ERRQUEUE | MSG_DONTWAIT) < 0) return;
    ++counters_.error_reports;
  }
}

// Takes from a received message what the kernel says of it: the size of its coalesced datagrams,
// the address that it came to, when, its ECN bits, and how many datagrams the socket has dropped.
void UdpTransport::read_control(std::size_t message) {
  ReceiveBuffers& in = *in_;
  msghdr& header = in.messages[message].msg_hdr;
  in.segment_bytes[message] = 0;
  in.notes[message] = in.ecn[message] = 0;
  in.stamps[message] = {};
  for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr; item = CMSG_NXTHDR(&header, item)) {
    const auto is = [item](int level, int type) {
      return item->cmsg_level == level && item->cmsg_type == type;
    };
    if (is(SOL_UDP, UDP_GRO)) {
      in.segment_bytes[message] = static_cast<std::size_t>(std::max(control_value<int>(item), 0));
    } else if (is(SOL_SOCKET, SO_RXQ_OVFL)) {
      // Since the socket was opened, modulo 2^32.
      const auto drops = control_value<std::uint32_t>(item);
      counters_.receive_queue_drops += drops - kernel_drops_;
      kernel_drops_ = drops;
    } else if (is(SOL_SOCKET, SO_TIMESTAMPNS)) {
      const auto stamp = control_value<timespec>(item);
      in.stamps[message] = std::chrono::seconds(stamp.tv_sec) + Duration{stamp.tv_nsec};
    } else if (is(IPPROTO_IP, IP_TOS)) {
      in.ecn[message] = control_value<std::uint8_t>(item) & kEcnMask;
    } else if (is(IPPROTO_IPV6, IPV6_TCLASS)) {
      in.ecn[message] = static_cast<std::uint8_t>(control_value<int>(item) & kEcnMask);
    } else if (is(IPPROTO_IP, IP_PKTINFO)) {
      const auto info = control_value<in_pktinfo>(item);
      in.notes[message] = notes_->note_of(&info.ipi_spec_dst, sizeof info.ipi_spec_dst);
    } else if (is(IPPROTO_IPV6, IPV6_PKTINFO)) {
      const auto info = control_value<in6_pktinfo>(item);
      in.notes[message] = notes_->note_of(&info.ipi6_addr, sizeof info.ipi6_addr);
    }
  }
}

// Adds the datagrams of a received message to the result; one that was cut off, or whose sender is
// neither IPv4 nor IPv6, is counted as an error.
void UdpTransport::split(std::size_t message, TimePoint at) {
  const mmsghdr& received = in_->messages[message];
  Address from = from_sockaddr(reinterpret_cast<const sockaddr*>(&in_->names[message]),
                               received.msg_hdr.msg_namelen);
  if ((received.msg_hdr.msg_flags & MSG_TRUNC) != 0 || from.size == 0) {
    ++counters_.receive_errors;
    return;
  }
  ReceiverNotes::put(from, in_->notes[message]);
  ByteView rest(&in_->bytes[message * kReceiveBytes], received.msg_len);
  const std::size_t segment = in_->segment_bytes[message];
  while (segment > 0 && rest.size() > segment) {
    in_->datagrams.push_back({from, rest.first(segment), at, in_->ecn[message]});
    rest = rest.subspan(segment);
  }
  in_->datagrams.push_back({from, rest, at, in_->ecn[message]});
}

}  // namespace interneuron::io
