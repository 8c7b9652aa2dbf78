#include "node/loop/shards.h"

#include <algorithm>
#include <exception>
#include <string>

#include "node/io/socket_group.h"
#include "node/io/steady_clock.h"

namespace interneuron {

Node::Impl::Shards::Shards(Impl& front, const NodeOptions& options, const EndpointOptions& endpoint)
    : front_(front), encrypted_(options.security != nullptr) {
  posts_.push_back(std::make_unique<Post>());
  for (std::uint8_t shard = 1; shard <= endpoint.shard.count; ++shard) {
    EndpointOptions own = endpoint;
    own.shard.index = shard;
    if (endpoint.security) {
      auto security = std::make_shared<Security>(*endpoint.security);
      security->seed = random_key();
      own.security = std::move(security);
    }
    posts_.push_back(std::make_unique<Post>());
    members_.push_back(std::make_unique<Member>());
    members_.back()->impl = std::make_unique<Impl>(own, *this);
  }
}

// --- for the front

void Node::Impl::Shards::start() {
  for (const auto& member : members_) {
    member->thread = std::thread([this, &member = *member] { run(member); });
  }
}

void Node::Impl::Shards::run(Member& member) {
  io::name_this_thread("shard " + std::to_string(member.impl->shard_));
  try {
    member.impl->run();
  } catch (...) {
    front_.post([error = std::current_exception()] { std::rethrow_exception(error); });
  }
}

void Node::Impl::Shards::stop() {
  events_.close();
  for (const auto& member : members_) member->impl->stop();
  for (const auto& member : members_) {
    if (member->thread.joinable()) member->thread.join();
  }
}

void Node::Impl::Shards::open(const LinkSet::Link& link) {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const std::lock_guard lock(members_[i]->mutex);
    members_[i]->impl->open_port(link.options.id, *link.siblings.at(i), link.info);
  }
}

void Node::Impl::Shards::close(LinkId link) {
  for (const auto& member : members_) {
    const std::lock_guard lock(member->mutex);
    member->impl->close_port(link);
    member->impl->post_turn();
  }
}

std::uint8_t Node::Impl::Shards::of_round(const RoundRef& round) const {
  const auto peer = peers_.find(round.origin);
  return peer == peers_.end() ? std::uint8_t{0} : shard_of(peer->second, count());
}

SendId Node::Impl::Shards::known_as(std::uint8_t shard, SendId id) const {
  return id.value == 0 ? id : SendId{(id.value - 1) * count() + shard};
}

std::pair<std::uint8_t, SendId> Node::Impl::Shards::known_by(SendId id) const {
  if (id.value == 0) return {0, id};
  return {static_cast<std::uint8_t>((id.value - 1) % count() + 1),
          SendId{(id.value - 1) / count() + 1}};
}

// --- for any shard

std::unique_lock<std::mutex> Node::Impl::Shards::enter(std::uint8_t shard) {
  if (shard == 0) return {};
  events_.wait_for_room();
  return std::unique_lock(members_[shard - 1U]->mutex);
}

void Node::Impl::Shards::hand_up(std::uint8_t shard, Event&& event) {
  if (events_.put({shard, std::move(event)})) front_.post([this] { read_events(); });
}

void Node::Impl::Shards::read_events() {
  for (auto& [shard, event] : events_.take()) {
    if (front_.stopped_) return;
    const auto* list = std::get_if<RevocationsChanged>(&event);
    if (list != nullptr && !spread(shard, *list)) continue;
    note(shard, event);
    front_.tell(std::move(event));
  }
}

// What the front has to know of an event, or to change in it, before the application is told.
void Node::Impl::Shards::note(std::uint8_t shard, Event& event) {
  if (auto* fate = std::get_if<MessageFate>(&event)) {
    fate->id = known_as(shard, fate->id);
  } else if (const auto* delivered = std::get_if<Delivered>(&event)) {
    SessionId& origin = origins_[delivered->from];
    if (origin == delivered->round.origin) return;
    peers_.erase(origin);
    origin = delivered->round.origin;
    peers_[origin] = delivered->from;
  } else if (const auto* lost = std::get_if<PeerLost>(&event)) {
    const auto origin = origins_.find(lost->peer);
    if (origin == origins_.end()) return;
    const auto peer = peers_.find(origin->second);
    if (peer != peers_.end() && peer->second == lost->peer) peers_.erase(peer);
    origins_.erase(origin);
  }
}

bool Node::Impl::Shards::spread(std::uint8_t from, const RevocationsChanged& event) {
  const TimePoint now = io::now();
  const auto take = [&](Endpoint& endpoint) { return endpoint.take_revocations(now, event.list); };
  // Where another shard was told the same before, the application knows it.
  if (!take(front_.endpoint_)) return false;
  for (std::uint8_t shard = 1; shard <= count(); ++shard) {
    if (shard != from) ask(shard, take);
  }
  return true;
}

bool Node::Impl::Shards::pass(std::uint8_t shard, LinkId link, const Incoming& datagram) {
  const std::uint8_t to = io::shard_of_packet(datagram.bytes, count(), encrypted_);
  if (to == shard) return false;
  hand_on(
      {to, link, datagram.from, datagram.ecn, Bytes(datagram.bytes.begin(), datagram.bytes.end())},
      datagram.at);
  return true;
}

void Node::Impl::Shards::hand_on(HandedOn&& letter, TimePoint at) {
  const std::uint8_t to = letter.shard;
  const LinkId link = letter.link;
  Post& post = *posts_[to];
  bool wake = false;
  if (!post.letters.put_if_room({std::move(letter), at}, wake)) {
    const std::lock_guard lock(post.mutex);
    ++post.dropped[link];
  } else if (wake) {
    of(to).post([this, to] { read_letters(to); });
  }
}

void Node::Impl::Shards::read_letters(std::uint8_t shard) {
  Impl& impl = of(shard);
  for (const Letter& letter : posts_[shard]->letters.take()) {
    const HandedOn& d = letter.datagram;
    // The endpoint's time never goes back.
    impl.told_ = std::clamp(letter.at, impl.told_, std::max(impl.told_, io::now()));
    impl.endpoint_.handle_datagram(impl.told_, {d.link, d.from, d.bytes, d.ecn});
  }
  impl.tell_events();
}

void Node::Impl::Shards::lost(std::vector<std::pair<LinkId, int>> gone) {
  front_.post([this, gone = std::move(gone)] {
    for (const auto& [link, error] : gone) front_.links_.lost(link, error);
    front_.check_nics();
  });
}

std::uint64_t Node::Impl::Shards::dropped(std::uint8_t shard, LinkId link) {
  Post& post = *posts_[shard];
  const std::lock_guard lock(post.mutex);
  const auto it = post.dropped.find(link);
  return it == post.dropped.end() ? 0 : it->second;
}

}  // namespace interneuron
