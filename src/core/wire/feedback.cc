#include "core/wire/feedback.h"

#include <algorithm>

namespace interneuron::wire {
namespace {

// Flags of a link report.
constexpr std::uint8_t kHasExchange = 0x01;
constexpr std::uint8_t kMetered = 0x02;
constexpr std::uint8_t kHasDelays = 0x04;
// A complete message was dropped, or is kept; the other bits are the time since it was complete.
constexpr std::uint32_t kDropped = 0x8000'0000;
constexpr std::uint32_t kKept = 0x4000'0000;
static_assert((kDropped | kKept | kLongestAgo) == UINT32_MAX);
constexpr std::int64_t kBitsPerKilobit = 1000;

void put_rate(Writer& w, DataRate rate) {
  w.put(static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(rate.bits_per_second / kBitsPerKilobit, 0, UINT32_MAX)));
}

DataRate get_rate(Reader& r) {
  return {static_cast<std::int64_t>(r.get<std::uint32_t>()) * kBitsPerKilobit};
}

void put_report(Writer& w, const LinkReport& report) {
  w.put(report.link.value);
  w.put(static_cast<std::uint8_t>((report.has_exchange ? kHasExchange : 0) |
                                  (report.metered ? kMetered : 0) |
                                  (report.has_delays ? kHasDelays : 0)));
  w.put(report.loss);
  w.put(report.train_packets);
  w.put(report.s.time_since_epoch().count());
  w.put(report.h.count());
  w.put(report.largest);
  for (const std::uint64_t word : report.bitmap) w.put(word);
  w.put(report.train_start);
  put_rate(w, report.train_rate);
  put_rate(w, report.rate);
  w.put(report.newest_delay_us);
  w.put(report.largest_delay_us);
  w.put(report.ect0_packets);
  w.put(report.ect1_packets);
  w.put(report.ce_packets);
  w.put(report.received_bytes);
}

bool get_report(Reader& r, LinkReport& report) {
  report.link = LinkId{r.get<std::uint16_t>()};
  const auto flags = r.get<std::uint8_t>();
  report.loss = r.get<std::uint16_t>();
  report.train_packets = r.get<std::uint32_t>();
  report.s = PeerTime{Duration{r.get<std::int64_t>()}};
  report.h = Duration{r.get<std::int64_t>()};
  report.largest = r.get<std::uint64_t>();
  for (std::uint64_t& word : report.bitmap) word = r.get<std::uint64_t>();
  report.train_start = r.get<std::uint64_t>();
  report.train_rate = get_rate(r);
  report.rate = get_rate(r);
  report.newest_delay_us = r.get<std::uint32_t>();
  report.largest_delay_us = r.get<std::uint32_t>();
  report.ect0_packets = r.get<std::uint16_t>();
  report.ect1_packets = r.get<std::uint32_t>();
  report.ce_packets = r.get<std::uint32_t>();
  report.received_bytes = r.get<std::uint64_t>();
  report.has_exchange = (flags & kHasExchange) != 0;
  report.metered = (flags & kMetered) != 0;
  report.has_delays = (flags & kHasDelays) != 0;
  return r.ok() && (flags & ~(kHasExchange | kMetered | kHasDelays)) == 0 && report.h.count() >= 0;
}

}  // namespace

void put_feedback(Writer& w, const Feedback& feedback) {
  w.put(feedback.u);
  w.put(feedback.echo.value);
  w.put(feedback.features);
  w.put(static_cast<std::uint8_t>(feedback.reports.size()));
  w.put(static_cast<std::uint8_t>(feedback.complete.size()));
  w.put(static_cast<std::uint8_t>(feedback.refused.size()));
  for (const LinkReport& report : feedback.reports) put_report(w, report);
  for (const auto& [message, ago_us, dropped, kept] : feedback.complete) {
    w.put(message.value);
    w.put(std::min(ago_us, kLongestAgo) | (dropped ? kDropped : 0) | (kept ? kKept : 0));
  }
  for (const MessageId message : feedback.refused) w.put(message.value);
}

bool get_feedback(Reader& r, Feedback& f) {
  f.u = r.get<std::int64_t>();
  f.echo = SessionId{r.get<std::uint32_t>()};
  f.features = r.get<std::uint16_t>();
  const auto reports = r.get<std::uint8_t>();
  const auto complete = r.get<std::uint8_t>();
  const auto refused = r.get<std::uint8_t>();
  if (!r.ok() || reports > kMaxReports || complete > kMaxComplete || refused > kMaxRefused) {
    return false;
  }
  for (std::uint8_t i = 0; i < reports; ++i) {
    LinkReport report;
    if (!get_report(r, report)) return false;
    f.reports.push_back(report);
  }
  for (std::uint8_t i = 0; i < complete; ++i) {
    const MessageId message{r.get<std::uint32_t>()};
    const auto when = r.get<std::uint32_t>();
    if ((when & kDropped) != 0 && (when & kKept) != 0) return false;
    f.complete.push_back(
        {message, when & kLongestAgo, (when & kDropped) != 0, (when & kKept) != 0});
  }
  for (std::uint8_t i = 0; i < refused; ++i) f.refused.push_back({r.get<std::uint32_t>()});
  return r.ok() && r.at_end();
}

}  // namespace interneuron::wire
