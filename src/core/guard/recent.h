// Quantiles of what was seen lately: the last `slots` values of the last 10 s, by key. Values may
// contain the clock offset, since only their differences are compared; they must lie within half of
// the range of 64-bit integers. Nothing is allocated. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::guard {

// Values that contain the offset of two clocks are compared within so long, because clocks drift: 1
// ms at 100 ppm.
inline constexpr Duration kRecent = std::chrono::seconds(10);

// The least of these values that at least so many eighths of them are not above: of four eighths
// the median, the lower of two. They must lie within half of the range of 64-bit integers; `count`
// > 0, `eighths` of 1 to 8; `values` is reordered.
std::int64_t wrapping_quantile(std::int64_t* values, std::size_t count, std::size_t eighths);
// The median in eighths.
inline constexpr std::size_t kMedian = 4;

// `slots`: values of all keys together.
template <std::size_t slots>
class LastValues {
 public:
  void add(TimePoint now, std::uint8_t key, std::int64_t value);
  // The median of the values with this key; nothing where they are fewer than `least`.
  std::optional<std::int64_t> median(TimePoint now, std::uint8_t key, std::size_t least = 1) const;
  // The value that so many eighths of those with this key are not above; without any, of all.
  std::optional<std::int64_t> quantile(TimePoint now, std::uint8_t key, std::size_t eighths) const;
  std::optional<std::int64_t> median_of_all(TimePoint now, std::size_t least = 1) const;
  void clear() { used_ = next_ = 0; }

 private:
  struct Value {
    TimePoint at{};
    std::int64_t value = 0;
    std::uint8_t key = 0;
  };
  template <class Wanted>
  std::optional<std::int64_t> quantile_where(TimePoint now, std::size_t least, std::size_t eighths,
                                             const Wanted& wanted) const;

  std::array<Value, slots> ring_{};
  std::size_t used_ = 0;
  std::size_t next_ = 0;
};

// 6.4 s at 10 rounds per second, so that the number and not the age bounds the memory.
using Recent = LastValues<64>;
extern template class LastValues<64>;
// 1.6 s at 10 rounds per second.
using VeryRecent = LastValues<16>;
extern template class LastValues<16>;

}  // namespace interneuron::guard
