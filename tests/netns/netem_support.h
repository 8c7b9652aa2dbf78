// Two network namespaces joined by a veth pair, for tests of tc-netem, and UDP through it in
// numbers.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/conditions.h"
#include "netns/netem/qdisc.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// Skips where namespaces may not be made or the kernel has no netem. Each test begins in `left_`.
class NetemTest : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  // Further veth pairs: NIC "vethN" in both namespaces, addresses 10.99.N.1 (left) and .2 (right),
  // for N from `first` to `last`. SetUp() makes veth1.
  void join(int first, int last);

  // A UDP socket on either side of that pair, connected to the other side's.
  io::FileDescriptor udp(bool left, int network) const;

  io::FileDescriptor home_;
  io::FileDescriptor left_;
  io::FileDescriptor right_;
};

// A link that does nothing but delay and serialize.
emu::Conditions clean(double rate_mbit, Duration one_way);

struct Arrival {
  std::uint32_t number = 0;
  Duration at{};     // CLOCK_REALTIME, by the kernel
  Duration delay{};  // since it was sent
};

inline constexpr std::size_t kUdpHeaders = 28;  // IPv4 and UDP, bytes

// Sends `count` datagrams numbered from `first`, `ip_bytes` long with their headers, at once.
void send_numbered(int fd, std::uint32_t first, std::size_t count, std::size_t ip_bytes);
// Those that have arrived, and that arrive until none has for `patience`.
void receive_numbered(int fd, std::vector<Arrival>& arrivals, Duration patience = Duration{});

// Sends `count` in batches of 50 and returns those that came.
std::vector<Arrival> stream(int from, int to, std::size_t count, std::size_t ip_bytes = 100);

void rest(Duration time);

// One NIC under control and a socket at either end.
class QdiscNetemTest : public NetemTest {
 protected:
  void SetUp() override {
    NetemTest::SetUp();
    if (IsSkipped()) return;
    control_.emplace();
    left_udp_ = udp(true, 1);
    right_udp_ = udp(false, 1);
  }
  void add(const emu::Conditions& conditions) { nic_ = control_->add("veth1", conditions); }
  std::size_t change(const emu::Conditions& conditions) {
    return control_->change(nic_, conditions);
  }
  EgressCounters counters() { return control_->counters().at(nic_); }
  std::vector<Arrival> send(std::size_t count, std::size_t ip_bytes = 100) {
    return stream(left_udp_.get(), right_udp_.get(), count, ip_bytes);
  }

  std::optional<TrafficControl> control_;
  std::size_t nic_ = 0;
  io::FileDescriptor left_udp_;
  io::FileDescriptor right_udp_;
};

}  // namespace interneuron::netns
