#include "interneuron/pcap_tap.h"

#include <gtest/gtest.h>
#include <pcap/pcap.h>
#include <sys/socket.h>

#include <array>
#include <filesystem>
#include <map>

#include "node/io/udp_socket.h"
#include "tests/node/io/namespace.h"
#include "tests/node/io/support.h"

namespace interneuron::io::pcap_tap_test {
namespace {

struct Captured {
  std::size_t packets = 0;
  std::map<int, std::size_t> by_index;
  bool nanoseconds = false;
  int link_type = 0;
};

Captured read_capture(const std::string& file) {
  Captured out;
  std::array<char, PCAP_ERRBUF_SIZE> error{};
  pcap_t* handle = ::pcap_open_offline_with_tstamp_precision(
      file.c_str(), PCAP_TSTAMP_PRECISION_NANO, error.data());
  if (handle == nullptr) return out;
  out.link_type = ::pcap_datalink(handle);
  pcap_pkthdr* header = nullptr;
  const u_char* bytes = nullptr;
  while (::pcap_next_ex(handle, &header, &bytes) == 1) {
    ++out.packets;
    ++out.by_index[bytes[4] << 24 | bytes[5] << 16 | bytes[6] << 8 | bytes[7]];
    if (header->ts.tv_usec % 1000 != 0) out.nanoseconds = true;
  }
  ::pcap_close(handle);
  return out;
}

std::string temporary_file() {
  return (std::filesystem::temp_directory_path() /
          ("interneuron-" + std::to_string(::getpid()) + ".pcap"))
      .string();
}

UdpTransport open_on(const std::string& nic, const std::string& host) {
  UdpOptions options{.nic = nic, .local = *make_address(host, 0)};
  return UdpTransport(options);
}

// One after the other, so that each is a packet of its own.
void send(UdpTransport& from, const Address& to, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const Bytes bytes = payload(i, 100);
    const std::array<Outgoing, 1> one{Outgoing{to, bytes}};
    from.send(one);
  }
}

TEST(PcapTap, WritesWhatOurSocketsCarryAndNothingElse) {
  in_namespace([] {
    const std::string file = temporary_file();
    UdpTransport early = open_on("lo", "127.0.0.1");
    {
      PcapTap tap(file);
      send(early, early.local_address(), 20);
      UdpTransport late = open_on("va", "10.99.0.1");
      send(late, *make_address("10.99.0.2", 9), 30);
      // Not ours: a socket that nobody noted.
      const FileDescriptor foreign(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
      const Address nobody = *make_address("127.0.0.1", 9);
      EXPECT_EQ(::sendto(foreign.get(), "x", 1, 0,
                         reinterpret_cast<const sockaddr*>(nobody.raw.data()), nobody.size),
                1)
          << "another program's packet is sent";
      const PcapTap::Counters counters = tap.stop();
      // What leaves va comes in at vb, which is in the same namespace.
      EXPECT_EQ(counters.packets, 80) << "80 packets are counted";
      EXPECT_EQ(counters.dropped, 0) << "none is dropped";
      EXPECT_EQ(counters.nics.size(), 3) << "on three NICs";
      std::map<std::string, std::uint64_t> by_name;
      for (const auto& nic : counters.nics) by_name[nic.name] = nic.packets;
      EXPECT_EQ(by_name["lo"], 20) << "each NIC's are counted";
      EXPECT_EQ(by_name["va"], 30) << "each NIC's are counted";
      EXPECT_EQ(by_name["vb"], 30) << "each NIC's are counted";
    }
    const Captured captured = read_capture(file);
    EXPECT_EQ(captured.packets, 80) << "80 packets are in the file";
    EXPECT_EQ(captured.by_index.size(), 3) << "with three interfaces";
    EXPECT_EQ(captured.by_index.at(1), 20) << "the loopback's once each";
    EXPECT_TRUE(captured.nanoseconds) << "stamped in nanoseconds";
    EXPECT_EQ(captured.link_type, DLT_LINUX_SLL2) << "as LINUX_SLL2";
    std::filesystem::remove(file);
  });
}

TEST(PcapTap, WithoutSocketsThereIsAnEmptyCapture) {
  in_namespace([] {
    const std::string file = temporary_file();
    PcapTap tap(file);
    const PcapTap::Counters counters = tap.stop();
    EXPECT_EQ(counters.packets, 0) << "nothing is captured";
    EXPECT_EQ(std::filesystem::file_size(file), 24) << "the file has a header";
    EXPECT_EQ(tap.stop().packets, 0) << "a second stop is harmless";
    std::filesystem::remove(file);
  });
}

TEST(PcapTap, SaysWhichFileItCannotWrite) {
  in_namespace([] {
    try {
      const PcapTap tap("/nowhere/x.pcap");
      FAIL() << "it throws";
    } catch (const IoError& error) {
      EXPECT_TRUE(std::string(error.what()).find("/nowhere/x.pcap") != std::string::npos)
          << "the file is named";
      EXPECT_NE(error.code(), EPERM) << "it is not for want of a privilege";
    }
  });
}

}  // namespace
}  // namespace interneuron::io::pcap_tap_test
