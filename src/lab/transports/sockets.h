// Sockets of the transports that are compared: IPv4, numeric addresses. They throw Failure (1) that
// names the call and the address. Thread-safe.
#pragma once

#include <poll.h>

#include <span>
#include <string>

#include "interneuron/time.h"
#include "node/io/file_descriptor.h"

namespace interneuron::transports {

// IPPROTO_UDP, IPPROTO_TCP or IPPROTO_MPTCP; never blocks.
io::FileDescriptor open_socket(int protocol);
void bind_to(const io::FileDescriptor& socket, const std::string& address, std::uint16_t port);
// A stream only begins to connect: its socket becomes writable when it is, see check_connected().
void connect_to(const io::FileDescriptor& socket, const std::string& address, std::uint16_t port);
// Throws if a connection that connect_to() began has failed.
void check_connected(const io::FileDescriptor& socket);
// Throws when the kernel has no such control.
void control_congestion(const io::FileDescriptor& socket, const std::string& name);
// As large as the kernel lets it be, up to kBufferBytes.
void enlarge_buffers(const io::FileDescriptor& socket);
inline constexpr int kBufferBytes = 8 * 1024 * 1024;

// Waits until one of them is ready, a signal has come, or `until`; returns whether one is ready.
bool wait_for(std::span<pollfd> sockets, TimePoint until);

}  // namespace interneuron::transports
