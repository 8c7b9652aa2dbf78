#include "node/xdp/xdp_transport.h"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "node/io/address.h"
#include "node/io/parts.h"

namespace interneuron::io {

namespace {

// Each receive queue takes memory of its own, locked. No measurement behind this value: it is more
// than modems, Wi-Fi cards and small hosts have, and 256 MiB.
constexpr std::uint32_t kMostQueues = 16;
// As many batches as hold all frames that can have arrived at a socket.
constexpr std::size_t kMostBatches = XdpSocket::kReceiveChunks / XdpSocket::kBatch;
// How often the kernel is asked for what it has dropped. No measurement behind this value: it is
// often enough for a counter, and seldom enough for a system call.
constexpr Duration kDropsInterval = std::chrono::milliseconds(10);
// How often it is asked how many receive queues are in use, of which it tells nobody. No
// measurement behind this value: people change it by hand, and a question takes microseconds.
constexpr Duration kQueuesInterval = std::chrono::seconds(1);

// Whether the kernel takes later what it did not take with this error.
bool passes(int error) { return error == EAGAIN || error == EBUSY || error == ENOBUFS; }

// Returns for how many receive queues the program is to have room.
std::uint32_t check_card(const std::string& nic, bool has_ethernet, std::uint32_t queues) {
  if (!has_ethernet) {
    throw IoError(nic +
                      " has no frames of Ethernet, which AF_XDP is used for here; use "
                      "--transport ring or udp",
                  EPROTONOSUPPORT);
  }
  if (queues > kMostQueues) {
    throw IoError(nic + " has " + std::to_string(queues) + " receive queues, and AF_XDP is used " +
                      "for at most " + std::to_string(kMostQueues) + " here; run `ethtool -L " +
                      nic + " combined " + std::to_string(kMostQueues) +
                      "`, or use --transport ring or udp",
                  EINVAL);
  }
  return kMostQueues;
}

}  // namespace

XdpTransport::XdpTransport(const UdpOptions& options)
    : FrameTransport(options, {.send_buffer_bytes =
                                   std::size_t{XdpSocket::kSendChunks} * XdpSocket::kChunkBytes,
                               .receive_buffer_bytes = std::size_t{XdpSocket::kReceiveChunks} *
                                                       XdpSocket::kChunkBytes}),
      program_(
          card().index, options.nic, is_ipv6(local_address()), port_of(local_address()),
          check_card(options.nic, has_ethernet_headers() && !is_loopback_card(), receive_queues())),
      poll_all_(::epoll_create1(EPOLL_CLOEXEC)) {
  open_sockets(options.nic, receive_queues(), options.may_wait);
  follow_card();
  // What came before the program was there is not missed.
  take_missed();
}

XdpTransport::~XdpTransport() = default;

void XdpTransport::open_sockets(const std::string& nic, std::uint32_t queues, bool may_wait) {
  while (sockets_.size() < queues) {
    const auto queue = static_cast<std::uint32_t>(sockets_.size());
    auto socket = std::make_unique<XdpSocket>(nic, queue, may_wait);
    epoll_event event{};
    event.events = EPOLLIN;
    if (::epoll_ctl(poll_all_.get(), EPOLL_CTL_ADD, socket->native_handle(), &event) != 0) {
      throw IoError("cannot poll the receive queues of " + nic +
                        " (epoll_ctl: " + std::strerror(errno) + "); use --transport ring or udp",
                    errno);
    }
    program_.add_socket(queue, socket->native_handle());
    sockets_.push_back(std::move(socket));
  }
}

// Opens sockets for receive queues that have come into use. Those of queues that are not any more
// stay: they may come back. What cannot be opened is tried again with the next look.
void XdpTransport::follow_queues() {
  const std::uint32_t queues = std::min(receive_queues(), kMostQueues);
  if (queues <= sockets_.size()) return;
  try {
    open_sockets(card_name(), queues, false);
  } catch (const IoError&) {
    // Their frames are counted as missed.
  }
}

void XdpTransport::follow_card() {
  const Address local = local_address();
  if (!is_unspecified(local)) {
    program_.take_addresses(std::array{local});
    return;
  }
  std::vector<Address> own;
  std::ranges::copy_if(card().addresses, std::back_inserter(own),
                       [&local](const Address& a) { return family_of(a) == family_of(local); });
  program_.take_addresses(own);
}

// Writes a datagram behind these headers into memory that is to leave.
FrameTransport::Obstacle XdpTransport::write(const Outgoing& datagram, const FrameHeader& header) {
  const std::span<std::byte> room = sockets_.front()->reserve();
  if (room.empty()) return {.error = ENOBUFS};
  if (header.size + datagram.size() > room.size()) return {.error = EMSGSIZE};
  const std::array parts{datagram.head, datagram.payload, datagram.tail};
  FrameHeader whole = header;
  complete_checksum(whole, parts);
  auto at = std::ranges::copy(whole.view(), room.begin()).out;
  for (const ByteView part : parts) at = std::ranges::copy(part, at).out;
  sockets_.front()->commit(header.size + datagram.size());
  return {};
}

int XdpTransport::offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) {
  // The kernel would keep what it is given until the NIC is up.
  if (!card().admin_up) return ENETDOWN;
  const std::size_t before = result.taken;
  const Outgoing* addressed = nullptr;
  FrameHeader header;
  Obstacle obstacle;
  for (const Outgoing& datagram : batch.subspan(result.taken)) {
    // What differs in nothing that stands in a header needs no other.
    const bool is_alike = addressed != nullptr && addressed->to == datagram.to &&
                          addressed->ecn == datagram.ecn && addressed->size() == datagram.size();
    if (!is_alike) obstacle = address({&datagram, 1}, now, header);
    if (obstacle.error == 0) obstacle = write(datagram, header);
    if (obstacle.error != 0) break;
    addressed = &datagram;
    ++result.taken;
  }
  const std::size_t written = result.taken - before;
  // Also where nothing was written: what waits may make room.
  const int error = sockets_.front()->flush();
  if (written > 0) {
    ++counters_.send_calls;
    counters_.sent_datagrams += written;
  }
  if (error != 0 && !passes(error)) {
    judge_refusal(error, result);
    return written > 0 ? 0 : error;
  }
  if (error != 0) {
    // Some of what was taken is still here, now or from earlier calls.
    result.refused = true;
    return ENOBUFS;
  }
  if (written > 0) return 0;
  result.refused = obstacle.asking || obstacle.error == ENOBUFS;
  return obstacle.error;
}

bool XdpTransport::take_arrived() {
  bool any = false;
  for (const auto& socket : sockets_) {
    for (const XdpSocket::Frame& frame : socket->receive()) {
      any = true;
      // To another host: the NIC hears it in promiscuous mode.
      const bool is_to_us = frame.bytes.size() >= mac().size() &&
                            std::ranges::equal(frame.bytes.first(mac().size()), mac());
      if (!is_to_us) continue;
      take({.bytes = frame.bytes,
            .at = frame.stamp.value_or(TimePoint::min()),
            .may_be_partial = true});
    }
  }
  return any;
}

void XdpTransport::collect(TimePoint now) {
  // What the kernel still does not take, send() tells of.
  if (sockets_.front()->needs_flush()) sockets_.front()->flush();
  // Frames of which none is for us are no reason to stop, but a flood of such must not keep us.
  bool any = false;
  for (std::size_t i = 0; i < kMostBatches && !received_any() && take_arrived(); ++i) any = true;
  if (any) {
    ++counters_.receive_calls;
  } else {
    // A NIC that goes leaves an error at its sockets, which would be reported as readable until
    // somebody takes it.
    for (const auto& socket : sockets_) {
      int error = 0;
      socklen_t size = sizeof error;
      ::getsockopt(socket->native_handle(), SOL_SOCKET, SO_ERROR, &error, &size);
    }
  }
  if (now < next_look_at_drops_) return;
  next_look_at_drops_ = now + kDropsInterval;
  counters_.receive_errors += take_missed();
  for (const auto& socket : sockets_) counters_.receive_queue_drops += socket->take_drops();
  if (now < next_look_at_queues_) return;
  next_look_at_queues_ = now + kQueuesInterval;
  follow_queues();
}

namespace {

void require_xdp() {
  XdpProgram::require_privilege();
  XdpSocket::require_memory();
}

}  // namespace

}  // namespace interneuron::io

const interneuron::io::TransportPart interneuron_xdp_part{
    interneuron::io::open_as<interneuron::io::XdpTransport>, interneuron::io::require_xdp};
