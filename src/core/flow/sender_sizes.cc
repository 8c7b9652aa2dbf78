// How large the pieces of a message are, and what becomes of those that a path no longer carries.
#include <algorithm>

#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// A path that is only to repair has its say in the size of pieces where it carries at least 3/4 of
// what the paths of the plan carry: a message takes a third more packets then, and 2 % more bytes
// on the wire. No measurement behind this value.
constexpr std::size_t kWorthwhileParts = 3;
constexpr std::size_t kOfParts = 4;

}  // namespace

// The largest piece that all the paths of a plan carry, and those that may repair what they lose,
// as far as they are up and carry enough.
std::size_t Sender::piece_bytes(const std::vector<LinkId>& paths, const PathSet& repairs) const {
  std::size_t plan = SIZE_MAX;
  for (const LinkId path : paths) plan = std::min(plan, paths_.at(path).max_datagram);
  std::size_t datagram = plan;
  for (const auto& [link, path] : paths_) {
    const bool may_repair = options_.repair && path.view.up && repairs.contains(link);
    const bool worthwhile = path.max_datagram >= plan / kOfParts * kWorthwhileParts;
    if (may_repair && worthwhile) datagram = std::min(datagram, path.max_datagram);
  }
  return datagram - kPieceOverheadBytes;
}

void Sender::resize(TimePoint now, LinkId link, std::size_t max_datagram) {
  const auto it = paths_.find(link);
  if (it == paths_.end() || it->second.max_datagram == max_datagram) return;
  Path& path = it->second;
  path.max_datagram = max_datagram;
  for (const MessageId id : path.jobs.messages()) {
    if (path.jobs.find(id)->chunk + kPieceOverheadBytes > max_datagram) {
      hand_on(now, path.jobs, id);
    }
  }
  protect_touched(now);
}

std::uint64_t Sender::take_mtu_probe_number(TimePoint now, LinkId link, std::size_t ip_bytes) {
  return paths_.at(link).sent.add_mtu_probe(now, ip_bytes);
}

// A path sends no more of this message: what it still had to send goes over the others.
void Sender::hand_on(TimePoint now, JobQueue& jobs, MessageId id) {
  Message& message = *messages_.find(id);
  message.firsts_gone(jobs.find(id)->firsts());
  const std::vector<std::uint16_t> indices = jobs.take_all(*jobs.find(id));
  jobs.remove(id);
  for (const std::uint16_t index : indices) {
    message.copy_gone(index);
    const Message::PieceState& piece = message.pieces[index];
    if (!piece.acknowledged && piece.under_way == 0) repair(now, id, index);
  }
  touch(message);
}

}  // namespace interneuron::flow
