// What a World does next: each source of events (a direction of a link, a cell, a host) has at most
// one instant at which it wants to be served, and may change it at any time. O(log n) for each
// change, n being the number of sources with an instant.
//
// At one instant sources are served in the order of their ranks, each at most once a pass. A source
// that sets the present instant while that instant is being served has its turn in the same pass if
// its rank is still to come, else in the next pass; so a run does not depend on when sources were
// added. Memory: 32 bytes per source. Pure; thread-compatible; no errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::sim {

class Agenda {
 public:
  using Source = std::uint32_t;

  // A new source, without an instant. No two have the same rank.
  Source add(std::uint64_t rank);
  // When the source wants to be served; one that is past counts as the present one.
  void set(Source source, std::optional<Duration> at);

  // The instant of the first source, if any has one.
  std::optional<Duration> next() const {
    if (heap_.empty()) return std::nullopt;
    return sources_[heap_[0]].at;
  }
  // Takes the first source out, which must be there, and gives its rank. Its instant is the present
  // one from now on.
  std::uint64_t take();
  // All sources of the present instant have been served: what is set for it later begins a pass.
  void finish();

 private:
  static constexpr std::size_t kNowhere = SIZE_MAX;
  struct Entry {
    Duration at{};
    std::uint64_t pass = 0;
    std::uint64_t rank = 0;
    // In the heap.
    std::size_t place = kNowhere;
  };

  bool before(Source a, Source b) const;
  void put(std::size_t place, Source source);
  void rise(std::size_t place);
  void sink(std::size_t place);
  void remove(Source source);

  std::vector<Entry> sources_;
  // A binary heap of sources, the first one to be served at its top.
  std::vector<Source> heap_;
  Duration now_{};
  std::uint64_t pass_ = 0;
  // The rank served last in this pass; empty: none.
  std::optional<std::uint64_t> served_;
};

}  // namespace interneuron::sim
