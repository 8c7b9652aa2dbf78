// What the tests of src/lab/emu share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "lab/emu/delay_trace.h"
#include "lab/emu/link.h"

namespace interneuron::emu {

// Sanitizers slow the long runs tenfold; they find their errors in the first seconds of them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

inline constexpr std::size_t kMegabyte = 1'000'000;
inline constexpr Duration kEver = std::chrono::hours(1000);

inline LinkProfile profile_of(const std::string& name) {
  const auto profile = built_in_profile(name);
  EXPECT_TRUE(profile.has_value()) << name;
  return profile.value_or(LinkProfile{});
}

inline LinkModel constant_link(const DirectionParams& direction, double rtt_ms, double loss = 0,
                               std::uint64_t seed = 1) {
  auto process = std::make_shared<DelayProcess>(constant_delay(rtt_ms, loss), seed);
  return {direction, std::make_shared<Channel>(std::move(process)), Direction::kUp, seed};
}

inline DirectionParams rate_of_mbit(double mbit, std::size_t queue_bytes = kMegabyte) {
  return DirectionParams{.rate = DataRate::mbit(mbit), .queue_bytes = queue_bytes};
}

// A profile with a constant delay, and 100 Mbit/s both ways.
inline LinkProfile constant_profile(double rtt_ms, double loss = 0) {
  LinkProfile profile;
  profile.name = "constant";
  profile.delay = constant_delay(rtt_ms, loss);
  profile.up = profile.down = rate_of_mbit(100);
  return profile;
}

// All that is inside, in the order in which it leaves.
inline std::vector<LinkModel::Packet> drain(LinkModel& model, Duration until = kEver) {
  std::vector<LinkModel::Packet> out;
  while (const auto packet = model.dequeue(until)) out.push_back(*packet);
  return out;
}

inline std::vector<std::uint64_t> tags(const std::vector<LinkModel::Packet>& packets) {
  std::vector<std::uint64_t> out;
  for (const LinkModel::Packet& packet : packets) out.push_back(packet.tag);
  return out;
}

// Packets of `bytes` every `gap`, each taken out as soon as it is due. Returns how many came out.
inline std::uint64_t stream(LinkModel& model, int packets, Duration gap, std::size_t bytes = 100) {
  for (int i = 0; i < packets; ++i) {
    const Duration now = gap * i;
    model.enqueue(now, bytes, static_cast<std::uint64_t>(i));
    while (model.dequeue(now)) {
    }
  }
  drain(model);
  return model.stats().delivered;
}

template <class Value>
std::string error_in(const std::variant<Value, ProfileError>& result) {
  const auto* error = std::get_if<ProfileError>(&result);
  return error == nullptr ? "no error" : error->what;
}

template <class Value>
Value value_of(std::variant<Value, ProfileError> result) {
  EXPECT_EQ(error_in(result), "no error");
  auto* value = std::get_if<Value>(&result);
  return value == nullptr ? Value{} : std::move(*value);
}

}  // namespace interneuron::emu
