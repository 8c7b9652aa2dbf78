#include "io/udp_transport.h"

#include <net/if.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "io/address.h"

namespace interneuron::io {

namespace {

constexpr std::size_t kSendMessages = 32;  // per sendmmsg; chosen: 32 x 45 datagrams are 2 MB
constexpr std::size_t kSendVectors =
    1024;                                 // datagrams per sendmmsg; UIO_MAXIOV per message is 1024
constexpr std::size_t kMaxSegments = 64;  // per message: UDP_MAX_SEGMENTS of Linux < 6.9
constexpr std::size_t kMaxSegmentedBytes = 65507;  // of one message, IPv4: 65535 - 20 - 8
constexpr std::size_t kReceiveMessages = 16;       // per recvmmsg; chosen: up to 1 MiB
constexpr std::size_t kReceiveBytes = 64 * 1024;   // per message: the most UDP_GRO coalesces
constexpr std::size_t kMaxCoalesced =
    128;  // datagrams per message: UDP_MAX_SEGMENTS of Linux >= 6.9
constexpr std::size_t kRefusalsToGiveUp = 8;  // chosen: then segmentation stays off

bool refuses_segmentation(int error) {
  // EIO: the NIC computes no checksums; EINVAL, EMSGSIZE: a segment exceeds the MTU; the others: an
  // old kernel.
  return error == EIO || error == EINVAL || error == EMSGSIZE || error == EOPNOTSUPP ||
         error == ENOPROTOOPT;
}

// After a failed send: is it because the NIC is gone? The errors of send itself do not tell
// (ENODEV, ENETUNREACH or EINVAL, depending on how the socket is bound), but a socket cannot name a
// card that is no more.
bool nic_vanished(int fd) {
  std::array<char, IFNAMSIZ> name{};
  socklen_t size = name.size();
  return ::getsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, name.data(), &size) != 0 && errno == ENODEV;
}

struct alignas(cmsghdr) SegmentControl {
  std::array<std::byte, CMSG_SPACE(sizeof(std::uint16_t))> raw;
};

struct alignas(cmsghdr) ReceiveControl {
  std::array<std::byte, CMSG_SPACE(sizeof(int)) + CMSG_SPACE(sizeof(std::uint32_t))> raw;
};

}  // namespace

struct UdpTransport::SendBuffers {
  std::array<mmsghdr, kSendMessages> messages;
  std::array<std::size_t, kSendMessages> datagrams;  // in each message
  std::array<iovec, kSendVectors> vectors;
  std::array<SegmentControl, kSendMessages> controls;
};

struct UdpTransport::ReceiveBuffers {
  std::array<mmsghdr, kReceiveMessages> messages;
  std::array<iovec, kReceiveMessages> vectors;
  std::array<sockaddr_storage, kReceiveMessages> names;
  std::array<ReceiveControl, kReceiveMessages> controls;
  std::array<std::size_t, kReceiveMessages> segment_bytes;  // 0 = not coalesced
  std::vector<std::byte> bytes;
  std::vector<Incoming> datagrams;
};

UdpTransport::UdpTransport(const UdpOptions& options)
    : socket_(open_udp_socket(options)),
      out_(std::make_unique<SendBuffers>()),
      in_(std::make_unique<ReceiveBuffers>()) {
  in_->bytes.resize(kReceiveMessages * kReceiveBytes);
  in_->datagrams.reserve(kReceiveMessages * kMaxCoalesced);
}

UdpTransport::~UdpTransport() = default;

namespace {

// How many leading datagrams can leave as one message: same address, same size, only the last may
// be shorter.
std::size_t run_length(std::span<const Outgoing> batch) {
  const std::size_t segment = batch[0].bytes.size();
  std::size_t total = segment;
  std::size_t count = 1;
  while (count < std::min(batch.size(), kMaxSegments)) {
    const Outgoing& next = batch[count];
    total += next.bytes.size();
    if (next.bytes.empty() || next.bytes.size() > segment || total > kMaxSegmentedBytes ||
        next.to != batch[0].to) {
      break;
    }
    ++count;
    if (next.bytes.size() < segment) break;
  }
  return count;
}

void set_segment_size(msghdr& header, SegmentControl& control, std::size_t segment) {
  const auto size = static_cast<std::uint16_t>(segment);
  header.msg_control = control.raw.data();
  header.msg_controllen = control.raw.size();
  cmsghdr* item = CMSG_FIRSTHDR(&header);
  item->cmsg_level = SOL_UDP;
  item->cmsg_type = UDP_SEGMENT;
  item->cmsg_len = CMSG_LEN(sizeof size);
  std::memcpy(CMSG_DATA(item), &size, sizeof size);
}

}  // namespace

// Describes the head of `batch` to the kernel; returns the number of messages.
std::size_t UdpTransport::fill(std::span<const Outgoing> batch, bool segment) {
  std::size_t messages = 0;
  std::size_t vectors = 0;
  while (!batch.empty() && messages < kSendMessages) {
    const std::size_t count = segment ? run_length(batch) : 1;
    if (vectors + count > kSendVectors) break;
    msghdr& header = out_->messages[messages].msg_hdr;
    header = {};
    // The kernel only reads both; sendmmsg shares its struct with recvmmsg.
    header.msg_name = const_cast<std::byte*>(batch[0].to.raw.data());
    header.msg_namelen = batch[0].to.size;
    header.msg_iov = &out_->vectors[vectors];
    header.msg_iovlen = count;
    for (const Outgoing& datagram : batch.first(count)) {
      out_->vectors[vectors++] = {const_cast<std::byte*>(datagram.bytes.data()),
                                  datagram.bytes.size()};
    }
    if (count > 1) {
      set_segment_size(header, out_->controls[messages], batch[0].bytes.size());
    }
    out_->datagrams[messages++] = count;
    batch = batch.subspan(count);
  }
  return messages;
}

SendResult UdpTransport::send(std::span<const Outgoing> batch) {
  SendResult result;
  std::size_t unsegmented_until = 0;  // datagrams before this one go one by one
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
  if (count < 0) {
    if (errno != EAGAIN && errno != EWOULDBLOCK) ++counters_.receive_errors;
    return {};
  }
  ++counters_.receive_calls;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    read_control(i);
    split(i);
  }
  counters_.received_datagrams += in.datagrams.size();
  return in.datagrams;
}

void UdpTransport::read_control(std::size_t message) {
  msghdr& header = in_->messages[message].msg_hdr;
  in_->segment_bytes[message] = 0;
  for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr; item = CMSG_NXTHDR(&header, item)) {
    if (item->cmsg_level == SOL_UDP && item->cmsg_type == UDP_GRO) {
      int size = 0;
      std::memcpy(&size, CMSG_DATA(item), sizeof size);
      in_->segment_bytes[message] = static_cast<std::size_t>(std::max(size, 0));
    } else if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;  // since the socket was opened, modulo 2^32
      std::memcpy(&drops, CMSG_DATA(item), sizeof drops);
      counters_.receive_queue_drops += drops - kernel_drops_;
      kernel_drops_ = drops;
    }
  }
}

void UdpTransport::split(std::size_t message) {
  const mmsghdr& received = in_->messages[message];
  const Address from = from_sockaddr(reinterpret_cast<const sockaddr*>(&in_->names[message]),
                                     received.msg_hdr.msg_namelen);
  if ((received.msg_hdr.msg_flags & MSG_TRUNC) != 0 || from.size == 0) {
    ++counters_.receive_errors;
    return;
  }
  ByteView rest(&in_->bytes[message * kReceiveBytes], received.msg_len);
  const std::size_t segment = in_->segment_bytes[message];
  while (segment > 0 && rest.size() > segment) {
    in_->datagrams.push_back({from, rest.first(segment)});
    rest = rest.subspan(segment);
  }
  in_->datagrams.push_back({from, rest});
}

}  // namespace interneuron::io
