#include "app/watch/trust_keeper.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <utility>

namespace interneuron::watch {
namespace {

using namespace std::chrono_literals;

// Between two looks at the age of the list, which counts in days.
constexpr Duration kTrustLook = 1min;

}  // namespace

TrustKeeper::TrustKeeper(Node& node, const settings::Credentials& credentials, Queue idle)
    : node_(node), credentials_(credentials), idle_(idle), issued_s_(credentials.list_issued_s()) {
  node_.on_revocations_changed([this](RevocationsChanged e) { take(std::move(e)); });
  node_.on_key_shared([](const KeyShared& e) {
    spdlog::warn(
        "two hosts use the key {}, and each takes the other's place; give one of them a key of its "
        "own with `interneuron keys gen`",
        to_base64(e.key));
  });
  look();
}

void TrustKeeper::take(RevocationsChanged event) {
  const settings::SignedList list = credentials_.read_list(event.list);
  issued_s_ = list.issued_s;
  told_stale_ = false;
  const settings::RevocationsFile* file = credentials_.revocations_file();
  spdlog::info("a list of revocations of {} has come from a peer, {} keys{}",
               settings::date_text(list.issued_s), list.keys,
               file == nullptr ? "; it is forgotten at the end, --revocations FILE keeps it" : "");
  if (file == nullptr) return;
  auto bytes = std::make_shared<const Bytes>(std::move(event.list));
  node_.compute(idle_, [file, bytes]() -> Node::Task {
    std::string problem = file->store(*bytes);
    if (problem.empty()) return {};
    return [problem = std::move(problem)] {
      spdlog::warn("{}; whom the new list revokes may come again after the next start", problem);
    };
  });
}

void TrustKeeper::look() {
  const std::string problem =
      credentials_.stale_list(issued_s_, node_.unix_time_ns() / 1'000'000'000);
  if (!problem.empty() && !told_stale_) spdlog::warn("{}", problem);
  told_stale_ = !problem.empty();
  node_.after(kTrustLook, [this] { look(); });
}

}  // namespace interneuron::watch
