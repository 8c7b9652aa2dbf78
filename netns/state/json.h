// Reads values from JSON that another process wrote (the state file, requests). Any of it may be
// wrong: what is not as expected throws a std::exception, whose text becomes part of the line that
// the user sees. Pure; thread-safe.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

namespace interneuron::netns {

using Json = nlohmann::ordered_json;

// The value as an integer of this type. Throws std::runtime_error for anything but an integer, and
// for one that the type does not hold, where nlohmann's own get() would cut off what does not fit.
template <class Integer>
Integer integer(const Json& value) {
  if (value.is_number_unsigned()) {
    const auto number = value.get<std::uint64_t>();
    if (std::in_range<Integer>(number)) return static_cast<Integer>(number);
  } else if (value.is_number_integer()) {
    const auto number = value.get<std::int64_t>();
    if (std::in_range<Integer>(number)) return static_cast<Integer>(number);
  }
  throw std::runtime_error("no whole number that fits");
}

// The value, which must be an array: nlohmann would iterate over anything.
inline const Json& array(const Json& value) {
  if (!value.is_array()) throw std::runtime_error("no array");
  return value;
}

}  // namespace interneuron::netns
