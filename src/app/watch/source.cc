#include "app/watch/source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <thread>

#include "app/process/failure.h"
#include "app/settings/link_options.h"
#include "app/settings/peer_address.h"
#include "app/watch/journal.h"
#include "app/watch/json.h"
#include "app/watch/live_state.h"
#include "app/watch/time_keeper.h"
#include "app/watch/trust_keeper.h"
#include "interneuron/node.h"
#include "node/io/steady_clock.h"
#include "node/monitor/link_monitor.h"

namespace interneuron::watch {
namespace {

using namespace std::chrono_literals;

// Between two looks at a node's figures. No measurement behind this value: it only has to be
// shorter than anyone can read.
constexpr Duration kRefresh = 250ms;

// The kernel's part, and what the monitor says of changes.
class KernelView {
 public:
  explicit KernelView(const std::optional<Address>& peer) : peer_(peer) { require(); }

  const std::vector<NicFacts>& facts(std::vector<LinkEvent>& events) {
    for (const io::NicEvent& e : monitor_.update()) {
      if (e.from == e.to) continue;
      events.push_back({io::now(), e.nic, std::string(to_string(e.from)),
                        std::string(to_string(e.to)), e.reason});
    }
    require();
    facts_.clear();
    for (const io::Nic& nic : monitor_.nics()) {
      facts_.push_back({nic, monitor_.state(nic.name), std::string(monitor_.reason(nic.name))});
    }
    return facts_;
  }
  const std::vector<io::Nic>& nics() const { return monitor_.nics(); }

 private:
  // Towards the peer every NIC needs a route, also one that has come.
  void require() {
    if (!peer_) return;
    for (const io::Nic& nic : monitor_.nics()) monitor_.require_route(nic.name, *peer_);
  }

  std::optional<Address> peer_;
  io::LinkMonitor monitor_;
  std::vector<NicFacts> facts_;
};

LinksSnapshot snapshot_of(KernelView& kernel, const std::vector<LiveLinks>& live,
                          std::vector<LinkEvent>& kernel_events) {
  LinksSnapshot s;
  s.at = io::now();
  s.unix_ms = std::chrono::duration_cast<std::chrono::milliseconds>(
                  std::chrono::system_clock::now().time_since_epoch())
                  .count();
  s.rows = join(kernel.facts(kernel_events), live);
  s.events = kernel_events;
  for (const LiveLinks& program : live) {
    if (!program.program.empty()) {
      s.programs.push_back({program.program, program.pid, program.loop_stall, program.peers});
    }
    s.events.insert(s.events.end(), program.events.begin(), program.events.end());
  }
  std::ranges::stable_sort(s.events, {}, &LinkEvent::at);
  // A node sees the same change of a NIC as our own monitor does, under the same name.
  const auto same =
      std::unique(s.events.begin(), s.events.end(), [](const LinkEvent& a, const LinkEvent& b) {
        return a.nic == b.nic && a.from == b.from && a.to == b.to && b.at - a.at < 1s;
      });
  s.events.erase(same, s.events.end());
  return s;
}

class LocalSource : public LinkSource {
 public:
  LocalSource() : kernel_(std::nullopt) {}
  LinksSnapshot snapshot() override {
    std::vector<LiveLinks> live;
    std::string programs;
    for (const std::string& line : reader_.lines()) {
      const auto links = live_from_json(line);
      if (!links) continue;
      programs += (programs.empty() ? "" : ", ") + links->program + " (process " +
                  std::to_string(links->pid) + ")";
      live.push_back(*links);
    }
    LinksSnapshot s = snapshot_of(kernel_, live, events_);
    if (!programs.empty()) s.source = "measured by " + programs;
    expects_more_ = reader_.silent() > 0;
    return s;
  }
  bool expects_more() const override { return expects_more_; }

 private:
  KernelView kernel_;
  LiveReader reader_;
  std::vector<LinkEvent> events_;
  bool expects_more_ = false;
};

// A node in a thread of its own; what it measures is handed over as a value.
class PeerSource : public LinkSource {
 public:
  explicit PeerSource(const LinkSourceOptions& options)
      : peer_(options.links.empty() ? std::optional(settings::resolve_peer(options.peer))
                                    : std::nullopt),
        credentials_(options.keys, settings::Trusts::kThePeer),
        kernel_(peer_),
        node_(node_options(options)),
        journal_(node_, "links"),
        // This node computes nothing.
        time_(node_, credentials_, Queue::kComputation),
        trust_(node_, credentials_, Queue::kComputation) {
    for (const std::string& warning : credentials_.warnings()) spdlog::warn("{}", warning);
    for (const std::string& warning : node_.warnings()) spdlog::warn("{}", warning);
    node_.on_nic_changed([this](const NicChanged& e) { journal_.add(e); });
    node_.on_path_changed([this](const PathChanged& e) { journal_.add(e); });
    node_.on_peer_ready([this](PeerReady e) {
      answered_ = true;
      // Whoever asks wants to know, also of links that pay per byte.
      for (const LinkState& link : node_.links(e.peer)) node_.request_train(e.peer, link.id);
    });
    node_.on_statistics(kRefresh, [this](const Statistics& s) {
      LiveLinks live = journal_.live(s);
      const std::lock_guard lock(mutex_);
      live_ = std::move(live);
    });
    thread_ = std::thread([this] {
      try {
        node_.run();
      } catch (...) {
        const std::lock_guard lock(mutex_);
        failure_ = std::current_exception();
      }
    });
  }
  ~PeerSource() override {
    node_.stop();
    thread_.join();
  }

  LinksSnapshot snapshot() override {
    LiveLinks live;
    {
      const std::lock_guard lock(mutex_);
      if (failure_) std::rethrow_exception(failure_);
      live = live_;
    }
    LinksSnapshot s = snapshot_of(kernel_, {live}, events_);
    s.source = "measured towards " + text_;
    return s;
  }
  bool answered() const override { return answered_; }
  std::string peer_text() const override { return text_; }

 private:
  NodeOptions node_options(const LinkSourceOptions& options);

  std::optional<Address> peer_;
  settings::Credentials credentials_;
  KernelView kernel_;
  std::string text_;
  std::vector<LinkEvent> events_;
  Node node_;
  LinkJournal journal_;
  TimeKeeper time_;
  TrustKeeper trust_;
  std::atomic<bool> answered_{false};
  // Guards the members that follow.
  std::mutex mutex_;
  LiveLinks live_;
  std::exception_ptr failure_;
  std::thread thread_;
};

NodeOptions PeerSource::node_options(const LinkSourceOptions& options) {
  NodeOptions node;
  std::vector<std::string> links = options.links;
  if (peer_) {
    text_ = to_string(*peer_) + " over";
    std::vector<LinkEvent> ignored;
    for (const NicFacts& f : kernel_.facts(ignored)) {
      if (f.state != NicState::kReady) continue;
      if ((f.nic.kind == "loopback") != is_loopback(*peer_)) continue;
      links.push_back(f.nic.name + "=" + to_string(*peer_));
      text_ += (links.size() > 1 ? ", " : " ") + f.nic.name;
    }
    if (links.empty()) {
      throw process::Failure(process::kFailed,
                             "no network card has a route to " + to_string(*peer_) +
                                 "; `interneuron doctor` says why and what to do");
    }
  } else {
    for (const std::string& link : links) text_ += (text_.empty() ? "" : " ") + link;
  }
  settings::append_links(links, settings::LinkPeer::kNamed, node);
  credentials_.apply(node);
  return node;
}

}  // namespace

void add_source_options(CLI::App& command, LinkSourceOptions& options) {
  command.add_option(
      "--peer", options.peer,
      "HOST[:PORT] of a roadside unit: measure towards it, over every card that has a "
      "route (default: what a vehicle or road that runs here measures)");
  settings::add_link_option(command, "--link", options.links, settings::LinkPeer::kNamed)
      ->excludes("--peer");
  settings::add_key_options(command, options.keys, settings::Trusts::kThePeer);
}

std::unique_ptr<LinkSource> make_link_source(const LinkSourceOptions& options) {
  if (!measures(options)) {
    if (!settings::is_given(options.keys)) return std::make_unique<LocalSource>();
    throw process::Failure(process::kUsage,
                           "keys and --insecure are for measuring; add --peer HOST or --link");
  }
  return std::make_unique<PeerSource>(options);
}

}  // namespace interneuron::watch
