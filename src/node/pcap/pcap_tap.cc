#include "interneuron/pcap_tap.h"

#include <net/if.h>
#include <pcap/pcap.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>

#include "interneuron/transport.h"
#include "node/io/file_descriptor.h"
#include "node/io/this_program.h"
#include "node/io/udp_ports.h"

namespace interneuron {
namespace {

// Packets are captured whole; only the loopback card has a larger MTU, 65,536.
constexpr int kSnapshotBytes = 65535;
// The kernel hands over a block of packets when it is full or this old. Longer means fewer
// wake-ups, shorter means that less is lost when the process is killed. No measurement behind this
// value.
constexpr int kBlockMs = 50;
// Holds 0.4 s of packets at 300 Mbit/s while the capture thread is away.
constexpr int kBufferBytes = 16 * 1024 * 1024;
// LINUX_SLL2: protocol (2), reserved (2), interface index (4), big-endian.
constexpr std::size_t kIndexAt = 4;

struct CloseHandle {
  void operator()(pcap_t* handle) const { ::pcap_close(handle); }
};
struct CloseDump {
  void operator()(pcap_dumper_t* dump) const { ::pcap_dump_close(dump); }
};

std::string filter_of(const std::vector<std::uint16_t>& ports) {
  // A filter that passes nothing yet.
  if (ports.empty()) return "udp port 0";
  std::string text;
  for (const std::uint16_t port : ports) {
    text += (text.empty() ? "udp port " : " or udp port ") + std::to_string(port);
  }
  return text;
}

using Handle = std::unique_ptr<pcap_t, CloseHandle>;

Handle open_any() {
  std::array<char, PCAP_ERRBUF_SIZE> error{};
  Handle handle(::pcap_create("any", error.data()));
  if (!handle) throw IoError(std::string("cannot capture packets: ") + error.data(), 0);
  ::pcap_set_snaplen(handle.get(), kSnapshotBytes);
  ::pcap_set_promisc(handle.get(), 0);
  ::pcap_set_timeout(handle.get(), kBlockMs);
  ::pcap_set_buffer_size(handle.get(), kBufferBytes);
  ::pcap_set_tstamp_precision(handle.get(), PCAP_TSTAMP_PRECISION_NANO);
  const int result = ::pcap_activate(handle.get());
  if (result == PCAP_ERROR_PERM_DENIED || result == PCAP_ERROR_PROMISC_PERM_DENIED) {
    throw IoError("not permitted to capture packets; run `sudo setcap cap_net_raw+ep " +
                      io::this_program() + "`, or run as root",
                  EPERM);
  }
  if (result < 0) {
    throw IoError(
        std::string("cannot capture packets (pcap_activate: ") + ::pcap_geterr(handle.get()) + ")",
        0);
  }
  if (::pcap_set_datalink(handle.get(), DLT_LINUX_SLL2) != 0 ||
      ::pcap_setnonblock(handle.get(), 1, error.data()) != 0) {
    throw IoError("this libpcap cannot capture with LINUX_SLL2; 1.10 or newer is needed", 0);
  }
  return handle;
}

}  // namespace

class PcapTap::Impl {
 public:
  explicit Impl(const std::string& file)
      : handle_(open_any()), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    dump_.reset(::pcap_dump_open(handle_.get(), file.c_str()));
    if (!dump_) {
      throw IoError(std::string("cannot write the capture: ") + ::pcap_geterr(handle_.get()), 0);
    }
    ::pcap_dump_flush(dump_.get());
    io::listen_to_udp_ports([this](const std::vector<std::uint16_t>& ports) { filter(ports); });
    start_thread();
  }
  ~Impl() { stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Counters stop() {
    if (!thread_.joinable()) return counters_;
    io::listen_to_udp_ports({});
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
    thread_.join();
    // The kernel hands over its last block, which is not full, when it is kBlockMs old.
    pollfd item{::pcap_get_selectable_fd(handle_.get()), POLLIN, 0};
    ::poll(&item, 1, 2 * kBlockMs);
    take();
    pcap_stat stat{};
    if (::pcap_stats(handle_.get(), &stat) == 0) counters_.dropped = stat.ps_drop;
    for (const auto& [index, seen] : nics_) {
      counters_.nics.push_back({seen.name, index, seen.packets});
    }
    dump_.reset();
    return counters_;
  }

 private:
  // What has been written of one NIC, by its index.
  struct Seen {
    std::string name;
    std::uint64_t packets = 0;
  };

  // The thread takes no signals: they are for the program's own threads.
  void start_thread() {
    sigset_t all;
    sigset_t before;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before);
    thread_ = std::thread([this] { run(); });
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  // When the kernel refuses a filter, the one before stays.
  void filter(const std::vector<std::uint16_t>& ports) {
    const std::lock_guard lock(mutex_);
    bpf_program program{};
    if (::pcap_compile(handle_.get(), &program, filter_of(ports).c_str(), 1,
                       PCAP_NETMASK_UNKNOWN) != 0) {
      return;
    }
    ::pcap_setfilter(handle_.get(), &program);
    ::pcap_freecode(&program);
  }

  void run() {
    std::array<pollfd, 2> items{pollfd{::pcap_get_selectable_fd(handle_.get()), POLLIN, 0},
                                pollfd{wake_.get(), POLLIN, 0}};
    for (;;) {
      // Cannot happen: the thread takes no signals.
      if (::poll(items.data(), items.size(), -1) < 0) continue;
      take();
      if (items[1].revents != 0) return;
      // After an error the handle would be ready for ever.
      if (!counters_.problem.empty()) items[0].fd = -1;
    }
  }

  void take() {
    const std::lock_guard lock(mutex_);
    const auto write = [](u_char* self, const pcap_pkthdr* header, const u_char* bytes) {
      reinterpret_cast<Impl*>(self)->write(header, bytes);
    };
    if (!counters_.problem.empty()) return;
    const int taken = ::pcap_dispatch(handle_.get(), -1, write, reinterpret_cast<u_char*>(this));
    if (taken < 0) {
      counters_.problem = ::pcap_geterr(handle_.get());
    } else if (taken > 0 && ::pcap_dump_flush(dump_.get()) != 0) {
      counters_.problem = std::strerror(errno);
    }
  }

  void write(const pcap_pkthdr* header, const u_char* bytes) {
    ::pcap_dump(reinterpret_cast<u_char*>(dump_.get()), header, bytes);
    ++counters_.packets;
    if (header->caplen < kIndexAt + 4) return;
    unsigned index = 0;
    for (std::size_t i = 0; i < 4; ++i) index = (index << 8) | bytes[kIndexAt + i];
    Seen& seen = nics_[static_cast<int>(index)];
    ++seen.packets;
    if (!seen.name.empty()) return;
    std::array<char, IF_NAMESIZE> name{};
    const bool known = ::if_indextoname(index, name.data()) != nullptr;
    seen.name = known ? std::string(name.data()) : "#" + std::to_string(index);
  }

  Handle handle_;
  std::unique_ptr<pcap_dumper_t, CloseDump> dump_;
  io::FileDescriptor wake_;
  // Guards the handle, which both threads use.
  std::mutex mutex_;
  std::map<int, Seen> nics_;
  Counters counters_;
  std::thread thread_;
};

PcapTap::PcapTap(const std::string& file) : impl_(std::make_unique<Impl>(file)) {}
PcapTap::~PcapTap() = default;
PcapTap::Counters PcapTap::stop() { return impl_->stop(); }

}  // namespace interneuron
