// The shards of a Node that serves its peers on several threads (NodeOptions::shards; shard.h says
// what a shard is). Each is a Node::Impl of its own, with an endpoint, a socket of each link and a
// thread, but with no links or workers to look after: those, the timers and the handlers of the
// application stay with the front, the Node's own Impl, whose endpoint is the door and whose thread
// is the loop thread.
//
// What crosses between threads:
//   - commands and questions of the application: the front locks the shard for their time (ask());
//   - events: they wait for the front (hand_up()), and where many do, the shard rests until the
//     front has read some, as a node of one thread rests while a handler runs;
//   - packets that came to another shard's socket or to the door (hand_on()): at most kMostLetters
//     wait for a shard, what is more is dropped and counted as a socket's buffer that is full.
//
// A shard holds its own lock while it does anything but wait, and no other; the front holds one at
// a time, and none while a handler runs. So nobody waits in a circle.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "node/io/steady_clock.h"
#include "node/loop/mailbox.h"
#include "node/loop/node_impl.h"

namespace interneuron {

class Node::Impl::Shards final : public Node::Impl::Crew {
 public:
  // Events that wait for the front before a shard rests. No measurement behind this value: some
  // milliseconds of a handler's work.
  static constexpr std::size_t kMostEvents = 4096;
  // Packets that wait for a shard: those of a tenth of a second of a flood of handshakes that the
  // door lets through, and what a burst brings to the wrong socket.
  static constexpr std::size_t kMostLetters = 2048;

  // `endpoint`: the door's options. Throws IoError where there are no random bytes.
  Shards(Impl& front, const NodeOptions& options, const EndpointOptions& endpoint);
  ~Shards() override { stop(); }
  Shards(const Shards&) = delete;
  Shards& operator=(const Shards&) = delete;

  std::uint8_t count() const { return static_cast<std::uint8_t>(members_.size()); }

  // --- for the front
  void start() override;
  void stop() override;
  void open(const LinkSet::Link& link) override;
  void close(LinkId link) override;
  // Runs a command or a question on the endpoint of a shard; 0: the door's.
  template <class Command>
  auto ask(std::uint8_t shard, const Command& command) {
    if (shard == 0) return command(front_.endpoint_);
    Member& member = *members_[shard - 1U];
    const std::lock_guard lock(member.mutex);
    auto answer = command(member.impl->endpoint_);
    member.impl->told_ = io::now();
    member.impl->post_turn();
    return answer;
  }
  // The sum of what `of` says of each shard and of the door, by `add`.
  template <class Value, class Of, class Add>
  Value sum(const Of& of, const Add& add) {
    Value out = of(front_, std::uint8_t{0});
    for (std::uint8_t shard = 1; shard <= count(); ++shard) {
      Member& member = *members_[shard - 1U];
      const std::lock_guard lock(member.mutex);
      add(out, of(*member.impl, shard));
    }
    return out;
  }
  // Where a round came from that was delivered here; 0: nowhere that is known.
  std::uint8_t of_round(const RoundRef& round) const;
  // Messages of shards have numbers of their own; the application knows them by others.
  SendId known_as(std::uint8_t shard, SendId id) const;
  std::pair<std::uint8_t, SendId> known_by(SendId id) const;

  // --- for any shard; 0: the door
  std::unique_lock<std::mutex> enter(std::uint8_t shard) override;
  void hand_up(std::uint8_t shard, Event&& event) override;
  bool pass(std::uint8_t shard, LinkId link, const Incoming& datagram) override;
  void hand_on(HandedOn&& letter, TimePoint at) override;
  void lost(std::vector<std::pair<LinkId, int>> gone) override;
  // The newest list of revocations that a peer of this shard has brought is everybody's.
  bool spread(std::uint8_t from, const RevocationsChanged& event);
  // Letters to this one that were dropped.
  std::uint64_t dropped(std::uint8_t shard, LinkId link);

 private:
  struct Letter {
    HandedOn datagram;
    TimePoint at{};
  };
  struct Member {
    // Guards what belongs to the shard's thread; the front has none.
    std::mutex mutex;
    std::unique_ptr<Impl> impl;
    std::thread thread;
  };
  struct Post {
    Mailbox<Letter> letters{kMostLetters};
    std::mutex mutex;
    std::map<LinkId, std::uint64_t> dropped;
  };
  Impl& of(std::uint8_t shard) { return shard == 0 ? front_ : *members_[shard - 1U]->impl; }
  void run(Member& member);
  void read_events();
  void read_letters(std::uint8_t shard);
  void note(std::uint8_t shard, Event& event);

  Impl& front_;
  const bool encrypted_;
  std::vector<std::unique_ptr<Member>> members_;
  // The door's, then the shards'.
  std::vector<std::unique_ptr<Post>> posts_;
  Mailbox<std::pair<std::uint8_t, Event>> events_{kMostEvents};
  // Whose rounds were delivered here: of each peer those of one origin, itself.
  std::map<PeerId, SessionId> origins_;
  std::map<SessionId, PeerId> peers_;
};

}  // namespace interneuron
