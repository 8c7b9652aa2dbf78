// The computations of a roadside unit: inputs of many vehicles wait for one worker, which the
// vehicles share fairly (docs/computing.md).
//
// A driver (the program `road` on a Node, the simulation in sim::World) calls add() when an input
// may be computed, and after that, after each end of a computation and at next_timeout() asks
// next(). If that names a job, the driver determines its level, by the guard of the job's round
// among levels(peer, now) or by a rule of its own, calls begin() and gives the job to its worker;
// when the worker is done it calls end() or, if the input could not be read, fail(). After each of
// these calls it drains poll_unanswered() and tells the vehicles. The level is determined only when
// the worker takes the job, because the time that the job has waited is lost for the computation.
//
// Each job ends exactly once: computed, or told by poll_unanswered(). Each peer has a line of its
// own, from which the job that is due first is computed. Between peers the worker's time is divided
// by FairTurns, and what one job may take by ShareOfTime. At most one job is computed at a time, so
// a detector needs no lock.
//
// Bounds and attacks: deadlines, inputs and their number come from peers. A peer holds at most
// UnitRules::waiting_per_peer jobs, and deadlines beyond kLongestBelieved are cut, so that whoever
// sends too much crowds out itself alone; what its inputs cost, decoding and nonsense included, is
// charged to it, and run times are learnt for each peer by itself. What remains is that an honest
// job waits for the one that runs. Memory is bounded by the number of peers, which the endpoint
// bounds; the driver must call forget() when one is lost.
//
// `Input` is what the driver's worker needs; it is moved, never looked at. Thread-compatible; pure.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "app/computing/jobs.h"
#include "app/computing/peer_accounts.h"
#include "interneuron/round.h"

namespace interneuron::computing {

template <class Input>
class RoadsideUnit {
 public:
  struct Job {
    // What was handed over. Its payload is not used here and may be empty.
    Delivered message;
    TimePoint delivered{};
    // The level that the guard steps down from.
    std::size_t top = 0;
    Input input;
  };

  // `levels` is not empty. With a `top_level`, no level above it is ever offered; one beyond the
  // last means the last.
  explicit RoadsideUnit(std::vector<LevelProfile> levels,
                        std::optional<std::size_t> top_level = std::nullopt, UnitRules rules = {})
      : peers_(std::move(levels), top_level), rules_(rules) {}

  // The levels that begin() takes: all, or those up to the given top level.
  std::span<const LevelProfile> levels() const { return peers_.levels(); }
  // Those of them that fit into what a job of this peer may take now: at least the lowest.
  std::span<const LevelProfile> levels(PeerId peer, TimePoint now) {
    return peers_.levels(peer, now);
  }
  // The level for a vehicle that can afford `budget` for the computation: the given top level, else
  // the highest that is quick enough here.
  std::size_t top_level(PeerId peer, Duration budget) const {
    return peers_.top_level(peer, budget);
  }

  // The job waits from now on. If its peer has as many waiting as it may, its oldest ends.
  void add(Job job) {
    const PeerId peer = job.message.from;
    peers_.came(peer, job.delivered);
    Line& line = lines_[peer];
    if (line.size() >= rules_.waiting_per_peer) {
      drop(peer, line.oldest().id, NoAnswer::kCrowdedOut);
    }
    TimePoint due{};
    if (rules_.minds_deadlines) {
      due = job.delivered + std::min(job.message.deadline, kLongestBelieved);
    }
    const TimePoint chance = due - peers_.least(peer);
    ++jobs_;
    if (rules_.minds_deadlines) chances_.emplace(chance, jobs_, peer);
    lines_[peer].add({std::move(job), jobs_, due, chance});
    ++waiting_;
    peers_.waits(peer, true);
  }
  // What this message brought is no job: it is counted and told like one that could not be read,
  // and takes nothing of the time of others.
  void reject(const Delivered& message) {
    peers_.know(message.from);
    peers_.tell({message.round, message.from, NoAnswer::kUnreadable});
  }

  // Ends the jobs that cannot be answered in time any more. Then the job whose turn it is, valid
  // until the next call; nullptr while the worker is busy or nothing waits.
  const Job* next(TimePoint now) {
    while (!chances_.empty() && std::get<TimePoint>(*chances_.begin()) < now) {
      const auto [chance, id, peer] = *chances_.begin();
      drop(peer, id, NoAnswer::kTooLate);
    }
    const auto turn = peers_.turn();
    return busy() || !turn ? nullptr : &lines_.at(*turn).first_due().job;
  }
  // When next() has a job to end, if nothing else happens.
  std::optional<TimePoint> next_timeout() const {
    if (chances_.empty()) return std::nullopt;
    return std::get<TimePoint>(*chances_.begin()) + Duration{1};
  }

  // The worker takes the job that next() has just named, to compute it at this level.
  Job begin(TimePoint now, std::size_t level) {
    assert(!busy() && peers_.turn() && level < levels().size());
    const PeerId peer = *peers_.turn();
    Job job = take(peer, lines_.at(peer).first_due().id);
    const Delivered& m = job.message;
    peers_.begin({m.round, m.from, m.variant, level, m.degraded, job.delivered, now, {}});
    return job;
  }
  // The worker is done and free. `took` is the run time to be learnt for the level; nothing if the
  // levels' times are known and stay.
  Computed end(TimePoint now, std::optional<Duration> took = std::nullopt) {
    return peers_.end(now, took);
  }
  // The worker is free again: the input was none. What that took is charged all the same.
  void fail(TimePoint now) { peers_.fail(now); }

  // The peer is lost: its jobs are gone, and nobody is told.
  void forget(PeerId peer) {
    for (Line& line = lines_[peer]; !line.empty();) take(peer, line.oldest().id);
    lines_.erase(peer);
    peers_.forget(peer);
  }

  // The next job that has ended without a result.
  std::optional<Unanswered> poll_unanswered() { return peers_.poll_unanswered(); }

  bool busy() const { return peers_.busy(); }
  std::size_t waiting() const { return waiting_; }
  // The work of all peers, those that are lost included.
  PeerWork total() const {
    PeerWork work = peers_.total();
    work.waiting = waiting_;
    return work;
  }
  // The work of one peer; zeros for one that has sent nothing.
  PeerWork work(PeerId peer) const {
    PeerWork work = peers_.work(peer);
    const auto line = lines_.find(peer);
    if (line != lines_.end()) work.waiting = line->second.size();
    return work;
  }

 private:
  using Line = WaitingLine<Job>;

  // Takes a waiting job out of everything that knows it.
  Job take(PeerId peer, std::uint64_t id) {
    Line& line = lines_.at(peer);
    auto entry = line.take(id);
    chances_.erase({entry.chance, id, peer});
    --waiting_;
    if (line.empty()) peers_.waits(peer, false);
    return std::move(entry.job);
  }
  void drop(PeerId peer, std::uint64_t id, NoAnswer why) {
    const Job job = take(peer, id);
    peers_.tell({job.message.round, peer, why});
  }

  PeerAccounts peers_;
  UnitRules rules_;
  std::map<PeerId, Line> lines_;
  // When each waiting job has its last chance, the earliest first.
  std::set<std::tuple<TimePoint, std::uint64_t, PeerId>> chances_;
  std::size_t waiting_ = 0;
  // Jobs that were ever added; each is named by its number.
  std::uint64_t jobs_ = 0;
};

}  // namespace interneuron::computing
