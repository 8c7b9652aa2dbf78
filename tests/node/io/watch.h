// A monitor in a test: what it tells after something was done to a network card, and how soon.
#pragma once

#include <poll.h>

#include <chrono>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "namespace.h"
#include "node/io/steady_clock.h"
#include "node/monitor/link_monitor.h"
#include "support.h"

namespace interneuron::io {

inline constexpr std::chrono::milliseconds kSeenWithin{200};
inline const Address kPeer = *parse_address("10.99.0.2:9");

class Watch {
 public:
  // Tells of the events until `nic` is in this state; nothing if that takes too long.
  std::optional<NicEvent> until(std::string_view nic, NicState state,
                                Duration patience = kPatience) {
    return until(patience,
                 [&](const NicEvent& event) { return event.nic == nic && event.to == state; });
  }

  // Runs a command and returns the event that follows, if it comes soon enough.
  std::optional<NicEvent> after(const std::string& command, std::string_view nic, NicState state) {
    return after([&] { return shell(command); }, command, nic, state);
  }
  std::optional<NicEvent> after(const std::function<bool()>& act, const std::string& name,
                                std::string_view nic, NicState state) {
    if (!act()) {
      std::printf("failed: %s\n", name.c_str());
      return std::nullopt;
    }
    const TimePoint done = now();
    auto event = until(nic, state, kSeenWithin);
    const auto took = std::chrono::duration<double, std::milli>(now() - done);
    if (!event) {
      std::printf("no %s of %s %.0f ms after %s; it is %s: %s\n", to_string(state).data(),
                  std::string(nic).c_str(), took.count(), name.c_str(),
                  to_string(monitor.state(nic)).data(), std::string(monitor.reason(nic)).c_str());
    } else {
      std::printf("%6.2f ms after %s: %s\n", took.count(), name.c_str(), event->reason.c_str());
    }
    return event;
  }

  LinkMonitor monitor;

 private:
  template <class Predicate>
  std::optional<NicEvent> until(Duration patience, const Predicate& wanted) {
    const TimePoint end = now() + patience;
    for (;;) {
      for (NicEvent& event : monitor.update()) {
        if (wanted(event)) return std::move(event);
      }
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - now());
      if (left.count() < 0) return std::nullopt;
      pollfd item{.fd = monitor.native_handle(), .events = POLLIN, .revents = 0};
      ::poll(&item, 1, static_cast<int>(left.count()) + 1);
    }
  }
};

inline void expect_event(const std::optional<NicEvent>& event, NicState from, bool new_incarnation,
                         const std::string& reason) {
  ASSERT_TRUE(event);
  EXPECT_EQ(event->from, from) << "from " << to_string(from);
  EXPECT_EQ(event->new_incarnation, new_incarnation);
  EXPECT_EQ(event->reason, reason);
}

// `va` is ready as soon as there is carrier: veth carriers take a moment.
inline bool wait_until_ready(Watch& watch) {
  watch.monitor.require_route("va", kPeer);
  return watch.monitor.state("va") == NicState::kReady ||
         watch.until("va", NicState::kReady).has_value();
}

}  // namespace interneuron::io
