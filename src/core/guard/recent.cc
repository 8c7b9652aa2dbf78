#include "core/guard/recent.h"

#include <algorithm>

namespace interneuron::guard {

std::int64_t wrapping_quantile(std::int64_t* values, std::size_t count, std::size_t eighths) {
  const std::int64_t origin = values[0];
  for (std::size_t i = 0; i < count; ++i) values[i] = wrapping_sub(values[i], origin);
  std::int64_t* wanted = values + (count * eighths + 7) / 8 - 1;
  std::nth_element(values, wanted, values + count);
  return wrapping_add(origin, *wanted);
}

template <std::size_t slots>
void LastValues<slots>::add(TimePoint now, std::uint8_t key, std::int64_t value) {
  ring_[next_] = {now, value, key};
  next_ = (next_ + 1) % slots;
  used_ = std::min(used_ + 1, slots);
}

template <std::size_t slots>
template <class Wanted>
std::optional<std::int64_t> LastValues<slots>::quantile_where(TimePoint now, std::size_t least,
                                                              std::size_t eighths,
                                                              const Wanted& wanted) const {
  std::array<std::int64_t, slots> values;
  std::size_t count = 0;
  for (std::size_t i = 0; i < used_; ++i) {
    if (now - ring_[i].at <= kRecent && wanted(ring_[i])) values[count++] = ring_[i].value;
  }
  if (count == 0 || count < least) return std::nullopt;
  return wrapping_quantile(values.data(), count, eighths);
}

template <std::size_t slots>
std::optional<std::int64_t> LastValues<slots>::median(TimePoint now, std::uint8_t key,
                                                      std::size_t least) const {
  return quantile_where(now, least, kMedian, [key](const Value& v) { return v.key == key; });
}

template <std::size_t slots>
std::optional<std::int64_t> LastValues<slots>::quantile(TimePoint now, std::uint8_t key,
                                                        std::size_t eighths) const {
  const auto own = quantile_where(now, 1, eighths, [key](const Value& v) { return v.key == key; });
  return own ? own : quantile_where(now, 1, eighths, [](const Value&) { return true; });
}

template <std::size_t slots>
std::optional<std::int64_t> LastValues<slots>::median_of_all(TimePoint now,
                                                             std::size_t least) const {
  return quantile_where(now, least, kMedian, [](const Value&) { return true; });
}

template class LastValues<64>;
template class LastValues<16>;

}  // namespace interneuron::guard
