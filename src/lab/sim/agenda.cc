#include "lab/sim/agenda.h"

#include <algorithm>
#include <tuple>

namespace interneuron::sim {

Agenda::Source Agenda::add(std::uint64_t rank) {
  Entry entry{.rank = rank};
  sources_.push_back(entry);
  return static_cast<Source>(sources_.size() - 1);
}

bool Agenda::before(Source a, Source b) const {
  const Entry& x = sources_[a];
  const Entry& y = sources_[b];
  return std::tie(x.at, x.pass, x.rank) < std::tie(y.at, y.pass, y.rank);
}

void Agenda::set(Source source, std::optional<Duration> at) {
  if (!at) return remove(source);
  Entry& entry = sources_[source];
  entry.at = std::max(*at, now_);
  const bool gone_by = served_ && entry.rank <= *served_;
  entry.pass = entry.at > now_ ? 0 : pass_ + (gone_by ? 1U : 0U);
  if (entry.place == kNowhere) {
    heap_.push_back(source);
    entry.place = heap_.size() - 1;
  }
  rise(entry.place);
  sink(sources_[source].place);
}

std::uint64_t Agenda::take() {
  const Entry& entry = sources_[heap_[0]];
  now_ = entry.at;
  pass_ = entry.pass;
  served_ = entry.rank;
  remove(heap_[0]);
  return *served_;
}

void Agenda::finish() {
  ++pass_;
  served_.reset();
}

void Agenda::put(std::size_t place, Source source) {
  heap_[place] = source;
  sources_[source].place = place;
}

void Agenda::rise(std::size_t place) {
  const Source source = heap_[place];
  while (place > 0) {
    const std::size_t parent = (place - 1) / 2;
    if (!before(source, heap_[parent])) break;
    put(place, heap_[parent]);
    place = parent;
  }
  put(place, source);
}

void Agenda::sink(std::size_t place) {
  const Source source = heap_[place];
  for (;;) {
    std::size_t child = 2 * place + 1;
    if (child >= heap_.size()) break;
    if (child + 1 < heap_.size() && before(heap_[child + 1], heap_[child])) ++child;
    if (!before(heap_[child], source)) break;
    put(place, heap_[child]);
    place = child;
  }
  put(place, source);
}

void Agenda::remove(Source source) {
  const std::size_t place = sources_[source].place;
  if (place == kNowhere) return;
  sources_[source].place = kNowhere;
  const Source last = heap_.back();
  heap_.pop_back();
  if (last == source) return;
  put(place, last);
  rise(place);
  sink(sources_[last].place);
}

}  // namespace interneuron::sim
