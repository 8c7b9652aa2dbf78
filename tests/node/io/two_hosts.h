// Two hosts with a link between them, for tests that move real datagrams:
//
//   here: va 10.99.0.1/24, fd99::1/64 ── veth ── vb 10.99.0.2/24, fd99::2/64, 10.99.0.3/32 :there
//
// `there` is a network namespace of its own. For use inside in_namespace().
#pragma once

#include <fcntl.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sched.h>
#include <sys/socket.h>

#include <functional>
#include <memory>
#include <string>

#include "namespace.h"
#include "node/io/address.h"
#include "node/io/file_descriptor.h"
#include "node/io/nic.h"
#include "node/io/steady_clock.h"
#include "node/io/udp_socket.h"
#include "node/ring/frame.h"
#include "support.h"

namespace interneuron::io {

class TwoHosts {
 public:
  TwoHosts() {
    made_ = there_.made() && there_.take("vb") && shell("ip neigh flush dev va nud permanent") &&
            shell("ip -6 addr add fd99::1/64 dev va nodad") && there_.shell("ip link set lo up") &&
            there_.shell("ip addr add 10.99.0.2/24 dev vb") &&
            there_.shell("ip addr add 10.99.0.3/32 dev vb") &&
            there_.shell("ip -6 addr add fd99::2/64 dev vb nodad") &&
            there_.shell("ip link set vb up");
  }
  bool made() const { return made_; }
  // Joins them by another link: vc 10.98.0.1/24 here, vd 10.98.0.2/24 there.
  bool add_second_link() const {
    return shell("ip link add vc type veth peer name vd") && there_.take("vd") &&
           shell("ip addr add 10.98.0.1/24 dev vc") && shell("ip link set vc up") &&
           there_.shell("ip addr add 10.98.0.2/24 dev vd") && there_.shell("ip link set vd up");
  }
  bool shell_there(const std::string& command) const { return there_.shell(command); }

  // Does something in the other namespace: sockets that it opens stay there.
  template <class Action>
  auto there(const Action& action) const {
    const FileDescriptor here(::open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC));
    const FileDescriptor other(::open(
        ("/proc/" + std::to_string(there_.process()) + "/ns/net").c_str(), O_RDONLY | O_CLOEXEC));
    EXPECT_EQ(::setns(other.get(), CLONE_NEWNET), 0);
    // Goes back also when the action throws.
    const std::shared_ptr<void> back(
        nullptr, [&here](void*) { EXPECT_EQ(::setns(here.get(), CLONE_NEWNET), 0); });
    return action();
  }

  static UdpOptions options(const char* nic, const char* host, std::uint16_t port = 0) {
    return UdpOptions{.nic = nic, .local = *make_address(host, port)};
  }

  // Waits until the kernels of both know each other's address of IPv6; false when they never do.
  bool meet() const {
    UdpTransport one(options("va", "fd99::1"));
    const auto other =
        there([] { return std::make_unique<UdpTransport>(options("vb", "fd99::2")); });
    return reaches(one, *other) && reaches(*other, one);
  }

 private:
  static bool reaches(Transport& from, Transport& to) {
    const TimePoint end = now() + kPatience;
    while (now() < end) {
      from.send(to_all(to.local_address(), {payload(1, 10)}));
      pollfd item{.fd = to.native_handle(), .events = POLLIN, .revents = 0};
      if (::poll(&item, 1, 20) == 1 && !to.receive().empty()) return true;
    }
    return false;
  }

  OtherNamespace there_;
  bool made_ = false;
};

// Puts frames on a link as they are.
class FrameSender {
 public:
  explicit FrameSender(const char* nic)
      : socket_(::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0)),
        index_(static_cast<int>(::if_nametoindex(nic))) {}
  bool send(ByteView frame) const {
    sockaddr_ll to{};
    to.sll_family = AF_PACKET;
    to.sll_ifindex = index_;
    return ::sendto(socket_.get(), frame.data(), frame.size(), 0,
                    reinterpret_cast<const sockaddr*>(&to),
                    sizeof to) == static_cast<ssize_t>(frame.size());
  }

 private:
  FileDescriptor socket_;
  int index_;
};

// "02:00:00:00:00:01"
inline Mac parse_mac(const std::string& text) {
  Mac out{};
  for (std::size_t i = 0; i < out.size() && 3 * i + 2 <= text.size(); ++i) {
    out[i] = static_cast<std::byte>(std::stoi(text.substr(3 * i, 2), nullptr, 16));
  }
  return out;
}

// Headers with a complete checksum, and the payload.
inline Bytes whole_frame(const FrameAddresses& addresses, const Bytes& payload) {
  FrameHeader header = build_header(addresses, payload.size()).value();
  const ByteView part(payload);
  complete_checksum(header, {&part, 1});
  Bytes out(header.view().begin(), header.view().end());
  out.insert(out.end(), payload.begin(), payload.end());
  return out;
}

}  // namespace interneuron::io
