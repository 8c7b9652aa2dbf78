#include "core/flow/overdue.h"

#include <algorithm>

namespace interneuron::flow {

void Overdue::add(TimePoint now, const SentPackets::Piece& missing, TimePoint deadline,
                  const Paths& copies) {
  if (copies.empty()) {
    incomplete_.push_back(missing.message);
    return;
  }
  std::erase_if(entries_, [now](const auto& e) { return e.second.deadline + kKept < now; });
  if (entries_.size() >= kMost) entries_.erase(entries_.begin());
  entries_[missing.message] = {missing.index, deadline, copies};
}

void Overdue::arrived(const SentPackets::Piece& piece) {
  const auto it = entries_.find(piece.message);
  if (it != entries_.end() && it->second.missing == piece.index) entries_.erase(it);
}

Overdue::Answer Overdue::answer(const Copies& copies, const Told& told, bool is_after) {
  if (copies.first < told.from || told.largest > copies.first + wire::kAckWindow) {
    return Answer::kUnsure;
  }
  return is_after ? Answer::kNotThere : Answer::kWaits;
}

void Overdue::report(const wire::LinkReport& report, std::optional<TimePoint> left) {
  Told& told = told_.try_emplace(report.link).first->second;
  if (report.largest >= told.largest && report.received_bytes < told.bytes) {
    told.from = report.largest;
  }
  if (report.largest >= told.largest) {
    told.largest = report.largest;
    told.bytes = report.received_bytes;
  }
  const Told now_told{report.largest, report.received_bytes, told.from};
  for (auto it = entries_.begin(); it != entries_.end();) {
    Entry& entry = it->second;
    Paths waiting;
    bool is_unsure = false;
    for (const Copies& copies : entry.copies) {
      const Answer said = copies.path == report.link
                              ? answer(copies, now_told, left && *left >= entry.deadline)
                              : Answer::kWaits;
      is_unsure = is_unsure || said == Answer::kUnsure;
      if (said == Answer::kWaits) waiting.push_back(copies);
    }
    entry.copies = waiting;
    if (waiting.empty() && !is_unsure) incomplete_.push_back(it->first);
    it = waiting.empty() || is_unsure ? entries_.erase(it) : std::next(it);
  }
}

void Overdue::remove_path(LinkId path) {
  if (const auto told = told_.find(path); told != told_.end()) told_.erase(told);
  std::erase_if(entries_, [path](const auto& e) {
    return std::ranges::find(e.second.copies, path, &Copies::path) != e.second.copies.end();
  });
}

void Overdue::clear() { *this = {}; }

}  // namespace interneuron::flow
