#include <algorithm>
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <utility>

#include "core/base/earliest.h"
#include "node/io/steady_clock.h"
#include "node/loop/node_impl.h"
#include "node/loop/shards.h"

namespace interneuron {

namespace {

using boost::asio::posix::stream_descriptor;
using boost::system::error_code;

// Batches received per turn, up to 8 MiB; what is left makes the socket readable again.
constexpr int kReceivesPerTurn = 8;
// No batch follows one after which receiving has taken so long, so that what is due and what is to
// be sent waits for one batch of packets that are costly to take, not for eight. No measurement
// behind this value: it only has to be short against the deadlines of rounds.
constexpr Duration kReceiveTime = std::chrono::milliseconds(2);
// The endpoint is asked for output after so many datagrams, because an acknowledgement tells of a
// bounded number of packets (kAckWindow of src/core/wire/feedback.h) while a batch may hold 2000.
// An eighth of that window.
constexpr int kInputsPerCollect = 32;
// Passes per turn over sending, telling and time-outs; a turn that is not done then is followed by
// another, so that sockets and tasks get their share.
constexpr int kPassesPerTurn = 16;
// How soon what is due is tried again while a full link holds it up. No measurement behind this
// value: it only has to be short against kStallPatience.
constexpr Duration kBlockedRetry = std::chrono::microseconds(200);
// Datagrams that follow others within this time, one by one, are read together once in so long:
// each wake-up costs as much as several of them. The kernel's stamps tell when they came. No
// measurement behind this value: it is little beside the time that a message has, and half a dozen
// packets at 60 Mbit/s.
constexpr Duration kGather = std::chrono::milliseconds(1);
// So many datagrams at a time are worth a wake-up. No measurement behind this value.
constexpr std::size_t kEnough = 16;
// A timer that fires so much later than it was armed for is late: what has arrived meanwhile is
// older than what is due. No measurement behind this value: it is ten times what a timer of an idle
// kernel is late by.
constexpr Duration kLate = std::chrono::milliseconds(1);
// So much too early the timer may fire: to arm it anew costs about as much as to wake up in vain.
constexpr Duration kEarly = std::chrono::milliseconds(1);
// TimePoint and steady_clock both read CLOCK_MONOTONIC. Far instants are cut, because the clock
// arithmetic of timers may overflow; waking up early is harmless.
std::chrono::steady_clock::time_point as_expiry(TimePoint time) {
  const TimePoint latest = io::now() + std::chrono::hours(1);
  return std::chrono::steady_clock::time_point(std::min(time, latest).time_since_epoch());
}

}  // namespace

void Node::Impl::at(TimePoint time, Task task) {
  auto timer = std::make_shared<boost::asio::steady_timer>(context_, as_expiry(time));
  auto& waiting = *timer;
  waiting.async_wait(
      [this, time, task = std::move(task), timer = std::move(timer)](const error_code& error) {
        if (error) return;
        // The instant was too far away for one wait.
        if (io::now() < time) return at(time, task);
        run_task(task);
      });
}

void Node::Impl::compute(Queue queue, Job job) {
  Workers& workers = queue == Queue::kLocalBackup ? backup_ : computation_;
  workers.submit([this, job = std::move(job)] {
    try {
      Task then = job();
      if (then) post(std::move(then));
    } catch (...) {
      post([error = std::current_exception()] { std::rethrow_exception(error); });
    }
  });
}

void Node::Impl::post(Task task) {
  boost::asio::post(context_, [this, task = std::move(task)] { run_task(task); });
}

void Node::Impl::run_task(const Task& task) {
  const auto shift = Shards::enter(crew_, shard_);
  if (gathers_until_) read_sockets();
  run_work(task);
  turn();
}

void Node::Impl::wait_for_sockets() {
  if (!socket_watcher_.is_open() || std::exchange(waits_for_sockets_, true)) return;
  socket_watcher_.async_wait(stream_descriptor::wait_read, [this](const error_code& error) {
    if (error) return;
    const auto shift = Shards::enter(crew_, shard_);
    waits_for_sockets_ = false;
    read_sockets();
    turn();
  });
}

// Datagrams that have arrived come before time-outs of the same instant. Sockets that are ready
// when the timer fires are read before its handler is called, so that only a late one looks again.
void Node::Impl::on_timer() {
  const auto shift = Shards::enter(crew_, shard_);
  const TimePoint now = io::now();
  // Sockets that were ready at the same instant came before, and have armed it anew.
  if (armed_ && now < *armed_) return;
  const bool is_late = armed_ && now > *armed_ + kLate;
  armed_.reset();
  if (is_late || gathers_until_) read_sockets();
  for (const Port& port : ports_) {
    if (!port.transport->drained()) receive(port);
  }
  turn();
}

// Where few datagrams come shortly after others, those that follow gather a little. What wakes the
// loop meanwhile, whatever it is, reads them first.
void Node::Impl::read_sockets() {
  const TimePoint now = io::now();
  const std::size_t count = receive_ready();
  const bool is_stream = count > 0 && count < kEnough && now - kGather < read_at_;
  const bool must_wait = waits_for_sockets_ || std::ranges::any_of(ports_, &Port::waits_for_write);
  gathers_until_.reset();
  if (is_stream && !must_wait) gathers_until_ = now + kGather;
  if (count > 0) read_at_ = now;
}

// Returns how many datagrams came.
std::size_t Node::Impl::receive_ready() {
  std::size_t count = 0;
  for (const io::Poller::Ready& ready : poller_.poll()) {
    const auto port =
        std::ranges::find(ports_, ready.name, [](const Port& p) { return p.link.value; });
    if (port == ports_.end()) continue;
    if (ready.readable) count += receive(*port);
    if (!ready.writable) continue;
    port->waits_for_write = false;
    poller_.set_wants_write(port->transport->native_handle(), ready.name, false);
    outbox_.writable(io::now(), port->link);
  }
  return count;
}

void Node::Impl::wait_writable(Port& port) {
  if (std::exchange(port.waits_for_write, true)) return;
  poller_.set_wants_write(port.transport->native_handle(), port.link.value, true);
}

// Datagrams arrive when the kernel says that they did, but not before what the endpoint was told
// already. Returns how many there were.
std::size_t Node::Impl::receive(const Port& port) {
  const TimePoint began = io::now();
  std::size_t count = 0;
  for (int i = 0; i < kReceivesPerTurn; ++i) {
    const auto batch = port.transport->receive();
    if (batch.empty()) break;
    count += batch.size();
    const TimePoint now = io::now();
    int inputs = 0;
    for (const Incoming& datagram : batch) {
      if (crew_ != nullptr && crew_->pass(shard_, port.link, datagram)) continue;
      // The endpoint's time never goes back.
      const bool stamped = datagram.at != TimePoint::min();
      told_ = stamped ? std::clamp(datagram.at, told_, now) : now;
      endpoint_.handle_datagram(told_, {port.link, datagram.from, datagram.bytes, datagram.ecn});
      if (++inputs % kInputsPerCollect == 0) outbox_.collect(told_, *this);
    }
    tell_events();
    told_ = io::now();
    if (port.transport->drained() || told_ - began > kReceiveTime) break;
  }
  return count;
}

std::optional<TransmitParts> Node::Impl::poll(TimePoint now, std::span<std::byte> buffer) {
  return endpoint_.poll_transmit_parts(now, buffer);
}

void Node::Impl::turn() {
  Outbox::More more = settle();
  if (context_.stopped()) return;
  if (lose_gone_links()) more = Outbox::More::kNow;
  for (Port& port : ports_) {
    if (outbox_.blocked(port.link)) wait_writable(port);
  }
  if (more == Outbox::More::kNow) post_turn();
  if (!gathers_until_) wait_for_sockets();
  arm(more);
  told_ = io::now();
}

void Node::Impl::post_turn() {
  if (std::exchange(turn_posted_, true)) return;
  boost::asio::post(context_, [this] {
    const auto shift = Shards::enter(crew_, shard_);
    turn_posted_ = false;
    turn();
  });
}

void Node::Impl::check_nics() {
  const auto next = links_.update(io::now());
  if (!next || (recheck_at_ && *recheck_at_ <= *next)) return;
  recheck_at_ = next;
  at(*next, [this, due = *next] {
    // A check for an earlier time was asked for meanwhile and has replaced this one.
    if (recheck_at_ != due) return;
    recheck_at_.reset();
    check_nics();
  });
}

// Closes the links whose NIC a send has found gone, which may be before the kernel's event arrives.
// True when there were any.
bool Node::Impl::lose_gone_links() {
  const auto gone = outbox_.take_gone();
  if (shard_ != 0 && !gone.empty()) {
    crew_->lost(gone);
    return false;
  }
  for (const auto& [id, error] : gone) links_.lost(id, error);
  if (!gone.empty()) check_nics();
  return !gone.empty();
}

// Sends, tells events and handles time-outs until there is nothing left to do or the turn's share
// is used up.
Outbox::More Node::Impl::settle() {
  for (int pass = 1;; ++pass) {
    const Outbox::More more = outbox_.pump(io::now(), *this);
    const bool told = tell_events();
    const bool handled = handle_due();
    if (context_.stopped() || (!told && !handled)) return more;
    if (more == Outbox::More::kBlocked && pass > 1) return more;
    if (more == Outbox::More::kNow || pass == kPassesPerTurn) return Outbox::More::kNow;
  }
}

bool Node::Impl::handle_due() {
  const TimePoint now = io::now();
  const auto next = endpoint_.next_timeout();
  const bool due = next && *next <= now;
  if (due) endpoint_.handle_timeout(now);
  return due;
}

bool Node::Impl::tell_events() {
  bool told = false;
  while (auto letter = endpoint_.poll_handed_on()) crew_->hand_on(std::move(*letter), told_);
  while (!context_.stopped()) {
    auto event = endpoint_.poll_event();
    if (!event) break;
    tell(std::move(*event));
    told = true;
  }
  return told;
}

void Node::Impl::tell(Event&& event) {
  if (shard_ != 0) return crew_->hand_up(shard_, std::move(event));
  const auto call = [](const auto& handler, auto&& argument) {
    if (handler) handler(std::forward<decltype(argument)>(argument));
  };
  struct Visitor {
    const Handlers& to;
    decltype(call)& with;
    void operator()(Delivered&& e) const { with(to.delivered, std::move(e)); }
    void operator()(RoundDone&& e) const { with(to.round_done, std::move(e)); }
    void operator()(PeerReady&& e) const { with(to.peer_ready, e); }
    void operator()(PeerRestarted&& e) const { with(to.peer_restarted, e); }
    void operator()(PeerLost&& e) const { with(to.peer_lost, e); }
    void operator()(Planned&& e) const { with(to.planned, std::move(e)); }
    void operator()(PathChanged&& e) const { with(to.path_changed, std::move(e)); }
    void operator()(OtherVersion&& e) const { with(to.other_version, std::move(e)); }
    void operator()(PeerLimited&& e) const { with(to.peer_limited, e); }
    void operator()(RevocationsChanged&& e) const { with(to.revocations_changed, std::move(e)); }
    void operator()(KeyShared&& e) const { with(to.key_shared, e); }
    void operator()(Message&& e) const { with(to.message, std::move(e)); }
    void operator()(MessageFate&& e) const { with(to.fate, std::move(e)); }
    void operator()(CanSend&& e) const { with(to.can_send, std::move(e)); }
  };
  run_work([&] { std::visit(Visitor{handlers, call}, std::move(event)); });
}

void Node::Impl::arm(Outbox::More more) {
  const TimePoint now = io::now();
  auto next = endpoint_.next_timeout();
  if (next && more == Outbox::More::kBlocked) next = std::max(*next, now + kBlockedRetry);
  next = earliest(next, outbox_.next_timeout(now), gathers_until_);
  if (!next) return;
  // The timer may stay armed for an instant that is a little earlier: to wake up then is harmless.
  if (armed_ && *armed_ <= *next && *next - *armed_ <= kEarly) return;
  armed_ = next;
  timer_.expires_at(as_expiry(*next));
  timer_.async_wait([this](const error_code& error) {
    if (!error) on_timer();
  });
}

}  // namespace interneuron
