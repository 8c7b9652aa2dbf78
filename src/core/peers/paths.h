// The paths of one peer: which there are, where they lead, which of them may be told first, and
// what has changed of them. Paths are few, so that they are looked up one by one.
//
// Owned by Peer, which sends over them and adds them. The peer names paths and says where it is
// seen at; nothing of that counts before it is proved (Peers). At most wire::kMaxReports paths, and
// as many changes as nobody has asked for. Pure; thread-compatible.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/peers/path.h"

namespace interneuron::peers {

class Paths {
 public:
  // `peer`: of whom changes are told.
  explicit Paths(PeerId peer) : peer_(peer) {}

  auto begin() { return paths_.begin(); }
  auto end() { return paths_.end(); }
  auto begin() const { return paths_.begin(); }
  auto end() const { return paths_.end(); }
  std::size_t size() const { return paths_.size(); }
  bool empty() const { return paths_.empty(); }
  const Path& operator[](std::size_t i) const { return paths_[i]; }
  Path* find(LinkId path);
  const Path* find(LinkId path) const;
  bool has(LinkId path) const { return find(path) != nullptr; }

  // There is no path of this name yet, and room for one.
  Path& add(TimePoint now, LinkId id, const Path::Nic& nic, const Address& address,
            const Path::Origin& origin) {
    return paths_.emplace_back(now, id, nic, address, origin);
  }
  void remove(LinkId path) {
    std::erase_if(paths_, [path](const Path& p) { return p.id() == path; });
  }
  void remove_nic(LinkId nic) {
    std::erase_if(paths_, [nic](const Path& p) { return p.nic().link == nic; });
  }

  // Whether this path leads over this NIC to this address.
  bool is_at(LinkId path, LinkId nic, const Address& address) const;
  // Whether the other address that a packet of this path comes from may be challenged now: only for
  // a packet that is newer than all before.
  bool may_challenge(TimePoint now, const wire::PacketHeader& header);
  // The peer wants to see this token before it believes the address that this path leaves from.
  // False: the path does not lead to where the challenge came from.
  bool challenged(LinkId path, LinkId nic, const Address& address, const wire::Token& token);
  // Measures the rate of a path now. False: there is no such path.
  bool request_train(TimePoint now, LinkId path);
  // Messages are sent or have come.
  void note_activity(TimePoint now);
  // A message is to be sent whose variants have so many bytes, the best one first, whether it sets
  // out or not.
  void asked(TimePoint now, std::span<const std::size_t> sizes, Duration deadline);
  // A better variant was withheld that a path with this rate could have carried.
  void want(TimePoint now, DataRate rate);

  // The fastest path that may carry feedback about all paths; of those but `first`, over which the
  // same is told, the fastest that may carry a copy.
  const Path* reporter(const Path* first = nullptr) const;

  // How far apart feedback leaves here at the least, and the peer's there: longer than at once only
  // where the way of either is slow (src/core/base/slow_link.h). Both sides know both rates, but
  // for what is just being told, so that each knows how long the other may hold back its feedback.
  Duration feedback_spacing() const;
  Duration peer_feedback_spacing() const;

  // Notes what the traffic of a path says of it since the last call. False: nothing new.
  bool note_changes(Path& path);
  // What has changed of a path; ask until nothing comes.
  std::optional<PathChanged> poll_change();

  // The state of each path, with scores relative to the others.
  Links states(TimePoint now, bool encrypted) const;

 private:
  PeerId peer_;
  std::vector<Path> paths_;
  std::deque<PathChanged> changes_;
};

}  // namespace interneuron::peers
