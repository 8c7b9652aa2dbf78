#include "app/cli/probe.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <memory>
#include <random>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/process/status_line.h"
#include "app/settings/peer_address.h"
#include "core/secure/caller.h"
#include "interneuron/endpoint.h"
#include "node/io/nic_choice.h"
#include "node/io/stamped_socket.h"
#include "node/io/steady_clock.h"
#include "node/monitor/link_monitor.h"

namespace interneuron::cli {
namespace {

using process::Failure;
using process::kFailed;
using process::kUsage;

constexpr Duration kLiveEvery = std::chrono::milliseconds(200);
// How long a roadside unit with keys may take to answer the handshake, of which there are a dozen
// tries until then.
constexpr Duration kHandshakeTime = std::chrono::seconds(4);
// How long replies are still awaited after Ctrl-C.
constexpr Duration kFarewell = std::chrono::seconds(2);

Address peer_address(const ProbeOptions& options, const std::string& text, const char* option) {
  return settings::resolve_peer(text, option, options.stamp.value_or(settings::kDefaultPort));
}

struct Choice {
  std::string nic;
  Address peer{};
};

Address common_peer(const ProbeOptions& options) {
  if (options.peer.empty()) {
    throw Failure(kUsage, "no peer: give --peer HOST, or --nic NIC=HOST for each NIC");
  }
  return peer_address(options, options.peer, "--peer");
}

// The NICs that the peer is routed through.
std::vector<Choice> ready_nics(const Address& peer, io::LinkMonitor& monitor) {
  std::vector<Choice> chosen;
  for (const io::Nic& nic : monitor.nics()) {
    if ((nic.kind == "loopback") != is_loopback(peer)) continue;
    monitor.require_route(nic.name, peer);
    if (monitor.state(nic.name) == NicState::kReady) chosen.push_back({nic.name, peer});
  }
  if (chosen.empty()) {
    throw Failure(kFailed, "no network card is ready with a route to " + to_string(peer) +
                               "; `interneuron links` says why, --nic NAME tries one anyway");
  }
  return chosen;
}

// The NICs to probe over, by name, each once, and to whom.
std::vector<Choice> choose_nics(const ProbeOptions& options, io::LinkMonitor& monitor) {
  if (options.nics.empty()) return ready_nics(common_peer(options), monitor);
  std::vector<Choice> chosen;
  for (const std::string& text : options.nics) {
    const auto equals = text.find('=');
    const std::string pattern = text.substr(0, equals);
    const Address peer = equals == std::string::npos
                             ? common_peer(options)
                             : peer_address(options, text.substr(equals + 1), "--nic");
    const std::string wrong = io::nic_pattern_error(pattern);
    if (!wrong.empty()) throw Failure(kUsage, "--nic '" + text + "': " + wrong);
    bool any = false;
    for (const io::Nic& nic : monitor.nics()) {
      if (!io::matches(pattern, nic)) continue;
      any = true;
      if (std::ranges::find(chosen, nic.name, &Choice::nic) != chosen.end()) continue;
      chosen.push_back({nic.name, peer});
    }
    if (!any) throw io::UnknownNic(io::no_match_text(pattern, monitor.nics()));
  }
  return chosen;
}

// Nothing where packets are in the clear.
std::unique_ptr<crypto::Caller> call_with(const settings::Credentials& credentials) {
  NodeOptions options;
  credentials.apply(options);
  if (!options.security) return nullptr;
  Security security = *options.security;
  security.seed = random_key();
  std::random_device random;
  SessionId life;
  while (life.value == 0) life.value = random();
  return std::make_unique<crypto::Caller>(io::now(), security, life);
}

// One run of the command: a Measurement for each NIC, whose packets it sends, receives and waits
// for on the calling thread until all have ended or a signal comes. It owns the sockets. What they
// receive may be anybody's bytes: a Measurement takes only replies to what it sent.
class Prober {
 public:
  explicit Prober(const ProbeOptions& options);
  int run();

 private:
  struct Nic {
    std::string name;
    // Who answers on this NIC's network.
    Address peer{};
    std::unique_ptr<io::StampedSocket> socket;
    probe::Options options;
    // Begins when there are keys, where packets are encrypted.
    std::unique_ptr<probe::Measurement> measurement;
    // The error number of the last packet that could not be sent, and how many there were.
    int send_error = 0;
    std::uint64_t send_errors = 0;
    // The NIC was taken away during the run.
    bool gone = false;
  };
  void open(const Choice& choice, io::LinkMonitor& monitor);
  probe::Options measurement_options(const io::Nic& nic, const Address& peer) const;
  void agree_on_keys();
  void ask();
  void send_due(Nic& nic);
  void receive(Nic& nic);
  void wait();
  bool done() const;
  void stop();
  void show_live();
  std::string problem_of(const Nic& nic) const;
  int conclude();

  const ProbeOptions& options_;
  std::optional<settings::Credentials> credentials_;
  // Where packets are encrypted.
  std::unique_ptr<crypto::Caller> caller_;
  std::vector<Nic> nics_;
  process::StatusLine line_;
  std::optional<TimePoint> shown_at_;
  std::array<std::byte, 2048> buffer_;
};

Prober::Prober(const ProbeOptions& options) : options_(options) {
  io::LinkMonitor monitor;
  for (const Choice& choice : choose_nics(options, monitor)) open(choice, monitor);
  if (options.stamp) return;
  credentials_.emplace(options.keys, settings::Trusts::kThePeer);
  for (const std::string& warning : credentials_->warnings()) {
    fmt::print(stderr, "interneuron: {}\n", warning);
  }
  caller_ = call_with(*credentials_);
}

probe::Options Prober::measurement_options(const io::Nic& nic, const Address& peer) const {
  probe::Options o;
  o.format = options_.stamp ? probe::Format::kStamp : probe::Format::kEcho;
  o.count = options_.count == 0 ? probe::kMaxPings : options_.count;
  o.interval = from_ms(options_.interval_ms);
  o.timeout = from_ms(options_.timeout_ms);
  o.size = options_.size;
  o.rate = !options_.no_rate;
  o.ip_udp_bytes = is_ipv6(peer) ? kIpv6UdpBytes : kIpv4UdpBytes;
  const std::size_t room = nic.mtu - std::min(nic.mtu, o.ip_udp_bytes);
  o.train_size = std::min(room, kMaxDatagramBytes);
  if (o.size > o.train_size) {
    throw Failure(kUsage, fmt::format("--size {}: {} carries at most {} bytes (MTU {})", o.size,
                                      nic.name, o.train_size, nic.mtu));
  }
  std::random_device random;
  while (o.session.value == 0) o.session.value = random();
  o.link = LinkId{static_cast<std::uint8_t>(nics_.size())};
  o.wall = io::wall_offset() + wire::kNtpToUnix;
  return o;
}

void Prober::open(const Choice& choice, io::LinkMonitor& monitor) {
  const io::Nic* nic = monitor.find(choice.nic);
  if (nic == nullptr) throw io::UnknownNic(io::unknown_nic_text(choice.nic));
  monitor.require_route(choice.nic, choice.peer);
  io::UdpOptions udp{.nic = choice.nic};
  // Where only a rule for the source address routes the peer through this NIC.
  const auto source = monitor.required_source(choice.nic);
  udp.local = source.value_or(*make_address(is_ipv6(choice.peer) ? "::" : "0.0.0.0", 0));
  Nic added;
  added.name = choice.nic;
  added.peer = choice.peer;
  added.socket = std::make_unique<io::StampedSocket>(udp);
  added.options = measurement_options(*nic, choice.peer);
  nics_.push_back(std::move(added));
}

// The first copy of a handshake that is answered opens all NICs, which have one peer.
void Prober::ask() {
  if (!caller_ || !caller_->is_due(io::now())) return;
  for (Nic& nic : nics_) {
    const std::size_t size = caller_->write(nic.options.link, buffer_);
    const int error = nic.socket->send(nic.peer, ByteView(buffer_).first(size));
    if (error != 0) nic.send_error = error;
  }
  caller_->sent(io::now());
}

void Prober::agree_on_keys() {
  const TimePoint until = io::now() + kHandshakeTime;
  while (caller_ && !caller_->is_open(io::now())) {
    if (process::SignalWatch::last() != 0)
      throw Failure(kFailed, "stopped before any key was agreed on");
    if (io::now() >= until) {
      for (const Nic& nic : nics_) {
        if (nic.send_error != 0) throw Failure(kFailed, problem_of(nic));
      }
      throw Failure(kFailed, "no handshake with " + to_string(nics_.front().peer) +
                                 ": does `interneuron road` run there with the key of --peer-key, "
                                 "does it --trust " +
                                 to_base64(credentials_->public_key()) +
                                 ", and does a firewall let UDP through?");
    }
    ask();
    wait();
    for (Nic& nic : nics_) receive(nic);
  }
  for (Nic& nic : nics_) {
    nic.measurement = std::make_unique<probe::Measurement>(nic.options, io::now());
  }
}

void Prober::send_due(Nic& nic) {
  while (const std::size_t size = nic.measurement->poll(io::now(), buffer_)) {
    if (caller_ && !caller_->seal(io::now(), std::span(buffer_).first(size))) continue;
    const int error = nic.socket->send(nic.peer, ByteView(buffer_).first(size));
    if (error == 0) continue;
    nic.send_error = error;
    ++nic.send_errors;
    if (error == ENODEV || error == ENXIO) {
      nic.gone = true;
      nic.measurement->stop(io::now());
      return;
    }
  }
}

void Prober::receive(Nic& nic) {
  while (const auto datagram = nic.socket->receive()) {
    if (datagram->from != nic.peer) continue;
    const auto bytes = caller_ ? caller_->handle(io::now(), datagram->bytes)
                               : std::optional<ByteView>(datagram->bytes);
    if (!bytes || !nic.measurement) continue;
    const auto reply = nic.measurement->handle(datagram->at, *bytes);
    if (reply && options_.json_stream) {
      fmt::print("{}\n", reply_json(nic.name, *reply).dump());
    }
  }
}

void Prober::wait() {
  std::vector<pollfd> sockets;
  TimePoint next = io::now() + kLiveEvery;
  for (const Nic& nic : nics_) {
    sockets.push_back({nic.socket->native_handle(), POLLIN, 0});
    const auto due = nic.measurement ? nic.measurement->next_timeout() : std::nullopt;
    if (due) next = std::min(next, *due);
  }
  if (caller_) next = std::min(next, caller_->next_timeout().value_or(next));
  const Duration left = std::max(next - io::now(), Duration::zero());
  const timespec time{.tv_sec = static_cast<time_t>(left / std::chrono::seconds(1)),
                      .tv_nsec = static_cast<long>((left % std::chrono::seconds(1)).count())};
  if (options_.json_stream) std::fflush(stdout);
  ::ppoll(sockets.data(), sockets.size(), &time, nullptr);
}

bool Prober::done() const {
  return std::ranges::all_of(nics_, [](const Nic& nic) { return nic.measurement->done(); });
}

void Prober::stop() {
  for (Nic& nic : nics_) nic.measurement->stop(io::now());
}

void Prober::show_live() {
  const TimePoint now = io::now();
  if (options_.json_stream || !line_.live()) return;
  if (shown_at_ && now - *shown_at_ < kLiveEvery) return;
  shown_at_ = now;
  std::string text;
  for (const Nic& nic : nics_) {
    const auto& log = nic.measurement->log();
    const auto newest = std::find_if(log.rbegin(), log.rend(), [](const probe::SentPacket& p) {
      return p.answered && p.purpose == probe::Purpose::kPing;
    });
    text += fmt::format("{}{:<12} {} of {} answered", text.empty() ? "" : "\n", nic.name,
                        nic.measurement->pings_answered(), nic.measurement->pings_sent());
    if (newest != log.rend()) text += fmt::format(", rtt {:.2f} ms", to_ms(newest->rtt()));
  }
  line_.show(text);
}

std::string Prober::problem_of(const Nic& nic) const {
  if (nic.gone) {
    return fmt::format("{}: went away during the probe, after {} packets", nic.name,
                       nic.measurement->pings_sent());
  }
  if (nic.measurement && nic.measurement->pings_answered() > 0) return "";
  if (nic.send_error != 0) {
    return fmt::format(
        "{}: nothing could be sent to {}: {}; `interneuron links` says what it lacks", nic.name,
        to_string(nic.peer), std::strerror(nic.send_error));
  }
  return fmt::format(
      "{}: no reply from {}; {}", nic.name, to_string(nic.peer),
      options_.stamp
          ? "does a STAMP reflector (`interneuron road --stamp`) run there, and does a "
            "firewall let UDP through?"
          : "does `interneuron road` run there, and does a firewall let UDP through? (other "
            "STAMP reflectors: --stamp)");
}

int Prober::conclude() {
  // The table says all that the live lines said.
  line_.clear();
  std::vector<ProbedNic> results;
  for (const Nic& nic : nics_) {
    results.push_back({nic.name, to_string(nic.peer), to_string(nic.socket->local_address()),
                       nic.measurement->summary(), problem_of(nic)});
  }
  if (options_.json_stream) {
    fmt::print("{}\n", probe_json(options_, results).dump());
  } else if (options_.json) {
    fmt::print("{}\n", probe_json(options_, results).dump(2));
  } else {
    print_probe_table(options_, results);
  }
  std::fflush(stdout);
  int code = process::kFine;
  for (const ProbedNic& result : results) {
    if (result.problem.empty()) continue;
    fmt::print(stderr, "interneuron: {}\n", result.problem);
    code = kFailed;
  }
  return code;
}

int Prober::run() {
  const process::SignalWatch signals;
  const io::PreciseTimers precise;
  agree_on_keys();
  std::optional<TimePoint> interrupted;
  while (!done()) {
    ask();
    for (Nic& nic : nics_) send_due(nic);
    show_live();
    // A signal ends the pings; what is under way is waited for, but not for long.
    if (process::SignalWatch::last() != 0 && !interrupted) {
      interrupted = io::now();
      stop();
      continue;
    }
    if (interrupted && io::now() - *interrupted > kFarewell) break;
    wait();
    for (Nic& nic : nics_) receive(nic);
  }
  // The next run has to begin later, whatever the clock says then.
  if (caller_) {
    const std::string problem = credentials_->time_file()->store(caller_->unix_ns(io::now()));
    if (!problem.empty()) fmt::print(stderr, "interneuron: {}\n", problem);
  }
  return conclude();
}

}  // namespace

int run_probe(const ProbeOptions& options) { return Prober(options).run(); }

}  // namespace interneuron::cli
