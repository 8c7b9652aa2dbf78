#include "app/watch/time_keeper.h"

#include <spdlog/spdlog.h>

#include <chrono>

namespace interneuron::watch {
namespace {

using namespace std::chrono_literals;

// How far ahead is stored. No measurement behind it: a write every minute does not wear out a flash
// memory, and a host that is cut off from power every minute still gains no more than that on the
// clocks of others.
constexpr Duration kAhead = 2min;
// The time jumps when a host without a clock hears what time it is; this is how soon that is
// stored.
constexpr Duration kLook = 1s;

}  // namespace

TimeKeeper::TimeKeeper(Node& node, const settings::Credentials& credentials, Queue idle)
    : node_(node), file_(credentials.time_file()), idle_(idle) {
  if (file_ == nullptr) return;
  stored_ = node_.unix_time_ns() + kAhead.count();
  warn(file_->store(stored_));
  node_.after(kLook, [this] { look(); });
}

TimeKeeper::~TimeKeeper() {
  if (file_ != nullptr) warn(file_->store(node_.unix_time_ns()));
}

void TimeKeeper::look() {
  const std::int64_t time = node_.unix_time_ns();
  if (stored_ - time < kAhead.count() / 2) {
    stored_ = time + kAhead.count();
    node_.compute(idle_, [this, at = stored_]() -> Node::Task {
      std::string problem = file_->store(at);
      return [this, problem = std::move(problem)] { warn(problem); };
    });
  }
  node_.after(kLook, [this] { look(); });
}

void TimeKeeper::warn(const std::string& problem) {
  if (problem.empty() || warned_) return;
  warned_ = true;
  spdlog::warn("{}; if this host's clock goes back, peers refuse it for as long", problem);
}

}  // namespace interneuron::watch
