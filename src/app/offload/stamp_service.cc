#include "app/offload/road.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>

#include "app/process/failure.h"
#include "core/probe/reflectors.h"
#include "node/io/nic_choice.h"
#include "node/io/stamped_socket.h"
#include "node/io/steady_clock.h"

namespace interneuron::offload {
namespace {

// How often NICs that came or went are looked for, in ms.
constexpr int kReopenMs = 1000;

struct Port {
  std::string nic;
  // The kernel's number of the NIC that the socket is bound to.
  int index = 0;
  std::unique_ptr<io::StampedSocket> socket;
};

}  // namespace

// The sockets and the thread behind a StampService.
class StampService::Impl {
 public:
  Impl(const StampOptions& options, const std::vector<std::string>& patterns,
       const std::string& address)
      : options_(options),
        patterns_(patterns),
        address_(address),
        wall_(io::wall_offset() + wire::kNtpToUnix),
        reflector_(!options.stateless, options.port),
        wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    for (const io::Nic& nic : io::list_nics()) {
      if (wanted(nic)) open(nic);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~Impl() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

 private:
  bool wanted(const io::Nic& nic) const {
    return std::ranges::any_of(patterns_,
                               [&nic](const std::string& p) { return io::matches(p, nic); });
  }

  void open(const io::Nic& nic) {
    const std::string what = "STAMP port " + std::to_string(options_.port) + " on " + nic.name;
    const bool only_ipv6 = !nic.addresses.empty() && is_ipv6(nic.addresses.front());
    const auto local =
        make_address(!address_.empty() ? address_ : (only_ipv6 ? "::" : "0.0.0.0"), options_.port);
    if (!local)
      throw process::Failure(process::kUsage,
                             "'" + address_ + "' is no numeric address like 10.0.0.1");
    if (!options_.is_public && !std::ranges::all_of(nic.addresses, is_private)) {
      throw process::Failure(process::kFailed,
                             what + " would be public; pass --stamp-public if that is meant");
    }
    try {
      io::UdpOptions udp{.nic = nic.name, .local = *local, .answer_from_receiver = true};
      ports_.push_back({nic.name, nic.index, std::make_unique<io::StampedSocket>(udp)});
    } catch (const IoError& error) {
      if (error.code() == EACCES) {
        throw process::Failure(process::kPrivilege,
                               what +
                                   " needs a privilege: run as root, or choose a port above "
                                   "1023 with --stamp PORT");
      }
      if (error.code() == EADDRINUSE) {
        throw process::Failure(process::kFailed,
                               what + " is taken; choose another with --stamp PORT");
      }
      throw;
    }
  }

  // Sockets of NICs that are gone or came back as another one are closed, new ones opened.
  void refresh() {
    const std::vector<io::Nic> nics = io::list_nics();
    std::erase_if(ports_, [&nics](const Port& port) {
      return std::ranges::none_of(nics, [&port](const io::Nic& nic) {
        return nic.name == port.nic && nic.index == port.index;
      });
    });
    for (const io::Nic& nic : nics) {
      if (!wanted(nic) || std::ranges::find(ports_, nic.name, &Port::nic) != ports_.end()) continue;
      try {
        open(nic);
        spdlog::info("STAMP on {}", nic.name);
      } catch (const std::exception& error) {
        spdlog::debug("{}", error.what());
      }
    }
  }

  void run() {
    TimePoint refreshed = io::now();
    for (;;) {
      std::vector<pollfd> waiting{{wake_.get(), POLLIN, 0}};
      for (const Port& port : ports_) {
        waiting.push_back({port.socket->native_handle(), POLLIN, 0});
      }
      ::poll(waiting.data(), waiting.size(), kReopenMs);
      if (waiting[0].revents != 0) return;
      for (std::size_t i = 0; i < ports_.size(); ++i) {
        if (waiting[i + 1].revents != 0) serve(ports_[i]);
      }
      if (io::now() - refreshed < std::chrono::milliseconds(kReopenMs)) continue;
      refreshed = io::now();
      try {
        refresh();
      } catch (const std::exception& error) {
        spdlog::warn("STAMP: {}", error.what());
      }
    }
  }

  void serve(Port& port) {
    // Sessions are told apart by NIC; an index is unique while the NIC is there.
    const LinkId id{static_cast<std::uint8_t>(port.index)};
    while (const auto request = port.socket->receive()) {
      const std::size_t size = reflector_.answer(
          {id, request->from, request->bytes, request->ttl, request->at}, io::now(), wall_, out_);
      if (size > 0) port.socket->send(request->from, ByteView(out_).first(size), request->to);
    }
  }

  StampOptions options_;
  std::vector<std::string> patterns_;
  std::string address_;
  Duration wall_;
  probe::StampReflector reflector_;
  io::FileDescriptor wake_;
  std::vector<Port> ports_;
  std::array<std::byte, 65536> out_;
  std::thread thread_;
};

StampService::StampService(const StampOptions& options, const std::vector<std::string>& patterns,
                           const std::string& address)
    : impl_(std::make_unique<Impl>(options, patterns, address)) {}
StampService::~StampService() = default;

}  // namespace interneuron::offload
