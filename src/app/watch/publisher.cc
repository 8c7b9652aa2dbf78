#include "app/watch/publisher.h"

#include <spdlog/spdlog.h>

#include "app/watch/json.h"

namespace interneuron::cli {

namespace {

// How often a line is published: `top` shows two frames a second.
constexpr Duration kInterval = std::chrono::milliseconds(500);

template <class State>
void log_change(const std::string& nic, State from, State to, const std::string& reason,
                State fine) {
  spdlog::log(to == fine ? spdlog::level::info : spdlog::level::warn, "{}: {} -> {}: {}", nic,
              to_string(from), to_string(to), reason);
}

}  // namespace

LinkPublisher::LinkPublisher(Node& node, const std::string& program) : journal_(node, program) {
  if (!server_.problem().empty()) spdlog::warn("{}", server_.problem());
  node.on_nic_changed([this](const NicChanged& e) {
    journal_.add(e);
    log_change(e.nic, e.from, e.to, e.reason, NicState::kReady);
  });
  node.on_path_changed([this](const PathChanged& e) {
    journal_.add(e);
    log_change(journal_.name(e.link), e.from, e.to, e.reason, PathState::kOk);
  });
  node.on_statistics(kInterval, [this](const Statistics& s) {
    if (server_.wanted()) server_.publish(live_json(journal_.live(s)).dump());
  });
}

}  // namespace interneuron::cli
