// The earliest of several instants (or the shortest of several durations) each of which may be
// missing. A machine made of parts answers next_timeout() with it. Pure.
#pragma once

#include <optional>
#include <type_traits>

namespace interneuron {

// Nothing when all of them are missing. Any of them may also be given as a plain T, except the
// first, whose type names T.
template <class T, class... More>
constexpr std::optional<T> earliest(const std::optional<T>& first,
                                    const std::type_identity_t<std::optional<T>>& second,
                                    const More&... more) {
  const std::optional<T>& sooner = second && (!first || *second < *first) ? second : first;
  if constexpr (sizeof...(more) == 0) {
    return sooner;
  } else {
    return earliest(sooner, more...);
  }
}

}  // namespace interneuron
