// What is known of a message when send() is called, as far as its chances depend on it. Plain
// values.
#pragma once

#include <cstddef>
#include <optional>

#include "interneuron/link.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron {

// An application could know all of it, too, by Endpoint::links() and SendResult: so predictions can
// be computed again outside, by other laws (src/lab/load/on_time_fit.h).
struct Outlook {
  PeerId peer{};
  TimePoint at{};
  Duration deadline{};
  // Of the best variant.
  std::size_t bytes = 0;
  // It will not be sent, because it is expected too late.
  bool refused = true;
  // When the first variant that sets out should be there (SendResult::expected); nothing: not
  // known.
  std::optional<Duration> expected{};
  // When its smallest variant would be there if our own sender sent nothing before it.
  std::optional<Duration> least{};
  // Of the link that is expected to bring it.
  PathState path = PathState::kOk;
  Duration rtt_min{};
  Duration rtt_p95{};
  Duration jitter{};
  Duration queue{};
  double loss = 0;
  DataRate rate{};
  DataRate share{};
  // Whether a link was considered.
  bool has_link = false;

  // Takes this way instead of the one before if it is sooner: of those that are not refused, or of
  // all while all are.
  void consider(const LinkState& way, std::optional<Duration> arrival,
                std::optional<Duration> soonest, bool is_refused);
};

}  // namespace interneuron
