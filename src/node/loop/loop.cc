#include <algorithm>
#include <utility>

#include "core/base/earliest.h"
#include "node/io/steady_clock.h"
#include "node/loop/node_impl.h"

namespace interneuron {

namespace {

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
// Pieces of messages that follow others within this time, one by one, are read together once in so
// long: each wake-up costs as much as a dozen of them. The kernel's stamps tell when they came. No
// measurement behind this value: it is as long as the batches in which they leave
// (src/core/flow/traffic.cc).
constexpr Duration kGather = std::chrono::milliseconds(2);
// So many datagrams at a time are worth a wake-up. No measurement behind this value.
constexpr std::size_t kEnough = 16;
// Nor is longer slept than half the time that the rest of a message takes, if it comes as what has
// been read, so that it is delivered when its last piece comes; a rest of so few pieces is not
// slept through.
constexpr std::int64_t kNearlyWhole = 4;

}  // namespace

void Node::Impl::at(TimePoint time, Task task) { due_.emplace(time, std::move(task)); }

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
  if (posted_.put(std::move(task))) poller_.wake();
}

// Datagrams that have arrived come before time-outs of the same instant.
void Node::Impl::wake_up(Ready ready) {
  turn_posted_ = false;
  read_sockets(ready);
  run_due();
  for (const Task& task : posted_.take()) {
    if (stopped_) return;
    run_task(task);
  }
  const Outbox::More more = turn();
  if (!stopped_) plan_wait(more);
}

// Tasks for times that have passed, each once, in the order of these.
void Node::Impl::run_due() {
  const TimePoint now = io::now();
  for (std::size_t most = due_.size(); most > 0 && !due_.empty() && !stopped_; --most) {
    if (due_.begin()->first > now) return;
    run_task(due_.extract(due_.begin()).mapped());
  }
}

void Node::Impl::run_task(const Task& task) {
  run_work(task);
  turn();
}

// Where few pieces of messages come shortly after others, those that follow gather a little. What
// wakes the loop meanwhile, whatever it is, reads them first.
void Node::Impl::read_sockets(Ready ready) {
  const bool gathered = std::exchange(gathers_until_, std::nullopt).has_value();
  if (gathered) {
    poller_.prepare(io::Poller::For::kAnything);
    ready = poller_.wait(TimePoint::min());
  }
  const TimePoint now = io::now();
  Reading reading;
  bool nics_changed = false;
  for (const io::Poller::Ready& it : ready) {
    nics_changed = nics_changed || it.name == kNics;
    const auto port =
        std::ranges::find(ports_, it.name, [](const Port& p) { return p.link.value; });
    if (port == ports_.end()) continue;
    if (it.readable) receive(*port, reading);
    if (it.writable) writable(*port);
  }
  // A transport that does not know is asked now and then.
  for (const Port& port : ports_) {
    if (now >= wakes_at_ && !port.transport->drained()) receive(port, reading);
  }
  if (gathered || now - kGather < read_at_) gather(now, reading);
  if (reading.datagrams > 0) read_at_ = now;
  if (nics_changed) check_nics();
}

// What was read has come since the reading before.
void Node::Impl::gather(TimePoint now, const Reading& reading) {
  if (reading.datagrams == 0 || reading.datagrams >= kEnough) return;
  const auto missing = static_cast<std::int64_t>(reading.missing);
  if (missing < kNearlyWhole || std::ranges::any_of(ports_, &Port::waits_for_write)) return;
  const Duration spacing = (now - read_at_) / static_cast<std::int64_t>(reading.datagrams);
  gathers_until_ = now + std::min<Duration>(kGather, spacing * missing / 2);
}

void Node::Impl::wait_writable(Port& port) {
  if (std::exchange(port.waits_for_write, true)) return;
  poller_.set_wants_write(port.transport->native_handle(), true);
}

void Node::Impl::writable(Port& port) {
  port.waits_for_write = false;
  poller_.set_wants_write(port.transport->native_handle(), false);
  outbox_.writable(io::now(), port.link);
}

// Datagrams arrive when the kernel says that they did, but not before what the endpoint was told
// already.
void Node::Impl::receive(const Port& port, Reading& reading) {
  const TimePoint began = io::now();
  for (int i = 0; i < kReceivesPerTurn; ++i) {
    const auto batch = port.transport->receive();
    if (batch.empty()) break;
    reading.datagrams += batch.size();
    const TimePoint now = io::now();
    int inputs = 0;
    for (const Incoming& datagram : batch) {
      if (crew_ != nullptr && crew_->pass(shard_, port.link, datagram)) {
        reading.missing = 0;
        continue;
      }
      // The endpoint's time never goes back.
      const bool stamped = datagram.at != TimePoint::min();
      told_ = stamped ? std::clamp(datagram.at, told_, now) : now;
      endpoint_.handle_datagram(told_, {port.link, datagram.from, datagram.bytes, datagram.ecn});
      reading.missing = std::min(reading.missing, endpoint_.missing_pieces());
      if (++inputs % kInputsPerCollect == 0) outbox_.collect(told_, *this);
    }
    tell_events();
    told_ = io::now();
    if (port.transport->drained() || told_ - began > kReceiveTime) break;
  }
}

std::optional<TransmitParts> Node::Impl::poll(TimePoint now, std::span<std::byte> buffer) {
  return endpoint_.poll_transmit_parts(now, buffer);
}

Outbox::More Node::Impl::turn() {
  Outbox::More more = settle();
  if (stopped_) return more;
  if (lose_gone_links()) more = Outbox::More::kNow;
  for (Port& port : ports_) {
    if (outbox_.blocked(port.link)) wait_writable(port);
  }
  told_ = io::now();
  return more;
}

// For another thread, which has the shard's lock: whatever wakes the loop is followed by a turn.
void Node::Impl::post_turn() {
  if (!std::exchange(turn_posted_, true)) poller_.wake();
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
    if (stopped_ || (!told && !handled)) return more;
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
  while (!stopped_) {
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

void Node::Impl::plan_wait(Outbox::More more) {
  const TimePoint now = io::now();
  auto next = endpoint_.next_timeout();
  if (next && more == Outbox::More::kBlocked) next = std::max(*next, now + kBlockedRetry);
  next = earliest(next, outbox_.next_timeout(now), gathers_until_);
  if (!due_.empty()) next = earliest(next, due_.begin()->first);
  wakes_at_ = more == Outbox::More::kNow ? now : next.value_or(TimePoint::max());
  poller_.prepare(gathers_until_ ? io::Poller::For::kWake : io::Poller::For::kAnything);
}

}  // namespace interneuron
