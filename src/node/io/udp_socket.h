// A UDP socket that belongs to one NIC, set up for batched input and output; see UdpTransport for
// its use.
#pragma once

#include <sys/socket.h>

#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "node/io/file_descriptor.h"
#include "node/io/nic.h"

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

}  // namespace interneuron::io
