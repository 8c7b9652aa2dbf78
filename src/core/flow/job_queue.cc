#include "core/flow/job_queue.h"

#include <utility>

namespace interneuron::flow {

Job* JobQueue::find(MessageId message) {
  const auto slot = by_message_.find(message);
  return slot ? &slots_[*slot].job : nullptr;
}

const Job* JobQueue::find(MessageId message) const {
  return const_cast<JobQueue*>(this)->find(message);
}

std::vector<MessageId> JobQueue::messages() const {
  std::vector<Place> places(order_.begin(), order_.end());
  std::ranges::sort(places, {}, &Place::number);
  std::vector<MessageId> out;
  out.reserve(places.size());
  for (const Place& place : places) out.push_back(slots_[place.slot].job.message);
  return out;
}

Job& JobQueue::add(MessageId message, const Turn& turn, std::uint32_t next, std::uint16_t count,
                   std::uint16_t chunk) {
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(slots_.size()));
    slots_.emplace_back();
  }
  const Place place{turn, added_++, free_.back()};
  free_.pop_back();
  Slot& slot = slots_[place.slot];
  Job& job = slot.job;
  job = Job{message, turn.deadline, next, count, chunk, std::move(job.again)};
  bytes_ += job.bytes();
  by_message_.insert(message, place.slot);
  slot.place = spare_.insert(order_, place);
  return job;
}

void JobQueue::remove(MessageId message) {
  const auto slot = by_message_.find(message);
  if (!slot) return;
  Job& job = slots_[*slot].job;
  bytes_ -= job.bytes();
  job.again.clear();
  job.next = job.count;
  spare_.erase(order_, slots_[*slot].place);
  by_message_.erase(message);
  free_.push_back(*slot);
}

void JobQueue::clear() { *this = {}; }

std::optional<JobQueue::Taken> JobQueue::take(Job& job) {
  Taken taken;
  if (!job.again.empty()) {
    taken = {job.again.front(), true};
    job.again.pop_front();
  } else if (job.next < job.count) {
    taken.index = static_cast<std::uint16_t>(job.next++);
  } else {
    return std::nullopt;
  }
  bytes_ -= job.chunk;
  return taken;
}

std::vector<std::uint16_t> JobQueue::take_all(Job& job) {
  std::vector<std::uint16_t> out;
  out.reserve(job.pieces());
  while (const auto taken = take(job)) out.push_back(taken->index);
  return out;
}

std::size_t JobQueue::bytes_before(const Turn& turn) const {
  std::size_t before = 0;
  std::size_t all_but_after = bytes_;
  auto from = order_.begin();
  auto to = order_.end();
  while (from != to) {
    if (from->turn > turn) return before;
    before += slots_[from->slot].job.bytes();
    if (++from == to) break;
    --to;
    if (to->turn <= turn) return all_but_after;
    all_but_after -= slots_[to->slot].job.bytes();
  }
  return before;
}

}  // namespace interneuron::flow
