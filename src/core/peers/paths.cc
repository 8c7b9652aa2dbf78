#include "core/peers/paths.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include "core/base/slow_link.h"
#include "core/link/nature.h"

namespace interneuron::peers {

Path* Paths::find(LinkId path) {
  const auto it = std::ranges::find(paths_, path, &Path::id);
  return it == paths_.end() ? nullptr : &*it;
}

const Path* Paths::find(LinkId path) const {
  const auto it = std::ranges::find(paths_, path, &Path::id);
  return it == paths_.end() ? nullptr : &*it;
}

bool Paths::is_at(LinkId id, LinkId nic, const Address& address) const {
  const Path* path = find(id);
  return path != nullptr && path->nic().link == nic && path->address() == address;
}

bool Paths::may_challenge(TimePoint now, const wire::PacketHeader& header) {
  Path* path = find(header.link);
  if (path == nullptr) return true;
  return header.number > path->receiver.largest() && path->may_challenge(now);
}

bool Paths::challenged(LinkId id, LinkId nic, const Address& address, const wire::Token& token) {
  if (!is_at(id, nic, address)) return false;
  find(id)->challenged(token);
  return true;
}

bool Paths::request_train(TimePoint now, LinkId id) {
  Path* path = find(id);
  if (path == nullptr) return false;
  path->probes.request_train(now);
  return true;
}

void Paths::note_activity(TimePoint now) {
  for (Path& path : paths_) path.probes.active(now);
}

void Paths::asked(TimePoint now, std::span<const std::size_t> sizes, Duration deadline) {
  for (Path& path : paths_) path.asked(now, sizes, deadline);
}

void Paths::want(TimePoint now, DataRate rate) {
  for (Path& path : paths_) path.probes.want(now, rate);
}

const Path* Paths::reporter(const Path* first) const {
  const std::size_t size = wire::feedback_bytes(paths_.size()) + kIpUdpBytes;
  const Path* best = nullptr;
  // A path whose delay is not known yet ranks behind those that were measured, and so does one that
  // is suspected; and a slow path, over which less can be told, behind any that is not.
  const auto rank = [size](const Path& p) {
    const Duration d = p.estimator.one_way();
    return std::tuple(p.estimator.path() != PathState::kOk, spacing_over(p.slow_rate(), size),
                      d > Duration::zero() ? d : Duration::max());
  };
  for (const Path& path : paths_) {
    if (!path.estimator.up()) continue;
    if (first != nullptr && (&path == first || !path.may_copy(size))) continue;
    if (best == nullptr || rank(path) < rank(*best)) best = &path;
  }
  return best;
}

namespace {

// The spacing over the path that is the soonest to tell anything by it.
template <class RateOf>
Duration least_spacing(const Paths& paths, const RateOf& rate_of) {
  const std::size_t size = wire::feedback_bytes(paths.size()) + kIpUdpBytes;
  std::optional<Duration> least;
  for (const Path& path : paths) {
    if (!path.estimator.up()) continue;
    const Duration spacing = spacing_over(rate_of(path), size);
    if (!least || spacing < *least) least = spacing;
  }
  return least.value_or(Duration::zero());
}

}  // namespace

Duration Paths::feedback_spacing() const {
  return least_spacing(*this, [](const Path& path) { return path.slow_rate(); });
}

Duration Paths::peer_feedback_spacing() const {
  return least_spacing(*this, [](const Path& path) { return path.peer_slow_rate(); });
}

bool Paths::note_changes(Path& path) {
  bool changed = false;
  while (auto change = path.estimator.poll_change()) {
    changed = true;
    changes_.push_back({peer_, path.id(), change->from, change->to, std::move(change->reason)});
  }
  return changed;
}

std::optional<PathChanged> Paths::poll_change() {
  if (changes_.empty()) return std::nullopt;
  PathChanged change = std::move(changes_.front());
  changes_.pop_front();
  return change;
}

Links Paths::states(TimePoint now, bool encrypted) const {
  Links out;
  for (const Path& path : paths_) {
    LinkState state = path.state(now);
    state.encrypted = encrypted;
    out.push_back(std::move(state));
  }
  link::score(out);
  return out;
}

}  // namespace interneuron::peers
