#include "app/watch/publisher.h"

#include "app/watch/json.h"

namespace interneuron::watch {

namespace {

// How often a line is published: `top` shows two frames a second.
constexpr Duration kInterval = std::chrono::milliseconds(500);

template <class State>
void log_change(spdlog::level::level_enum level, const std::string& nic, State from, State to,
                const std::string& reason) {
  spdlog::log(level, "{}: {} -> {}: {}", nic, to_string(from), to_string(to), reason);
}

}  // namespace

spdlog::level::level_enum log_level(PathState from, PathState to) {
  const auto usable = [](PathState s) { return s == PathState::kOk || s == PathState::kSuspect; };
  if (!usable(to)) return spdlog::level::warn;
  return usable(from) ? spdlog::level::debug : spdlog::level::info;
}

LinkPublisher::LinkPublisher(Node& node, const std::string& program) : journal_(node, program) {
  if (!server_.problem().empty()) spdlog::warn("{}", server_.problem());
  node.on_nic_changed([this](const NicChanged& e) {
    journal_.add(e);
    if (e.is_warning) return spdlog::warn("{}", e.reason);
    const bool ready = e.to == NicState::kReady;
    log_change(ready ? spdlog::level::info : spdlog::level::warn, e.nic, e.from, e.to, e.reason);
  });
  node.on_path_changed([this](const PathChanged& e) {
    journal_.add(e);
    log_change(log_level(e.from, e.to), journal_.name(e.link), e.from, e.to, e.reason);
  });
  node.on_statistics(kInterval, [this](const Statistics& s) {
    if (server_.wanted()) publish(s);
  });
}

void LinkPublisher::publish(const Statistics& statistics) {
  LiveLinks live = journal_.live(statistics);
  if (work_) {
    for (LivePeer& peer : live.peers) peer.work = work_(PeerId{peer.peer});
  }
  server_.publish(live_json(live).dump());
}

}  // namespace interneuron::watch
