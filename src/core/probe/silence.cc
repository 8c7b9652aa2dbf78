#include "core/probe/silence.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "core/base/earliest.h"

namespace interneuron::probe {
namespace {

constexpr std::array kSilences{Silence{5},  Silence{10}, Silence{15},  Silence{20},
                               Silence{30}, Silence{60}, Silence{120}, Silence{240}};
static_assert(SilenceTest::kFlowsAtMost == kSilences.size() * SilenceTest::kFlowsPerSilence);
static_assert(kSilences.front() == kShortestSilence && kSilences.back() == kLongestSilence);

// Answered so often, a mapping is open in both directions. Linux gives it the longer time-out of a
// stream from a packet on that comes more than 2 s after the first.
constexpr std::ptrdiff_t kOpenings = 2;
constexpr Duration kOpeningInterval = std::chrono::milliseconds(1100);
// Echoes sent to open a mapping before it is given up: three of them may be lost.
constexpr std::size_t kOpeningsAtMost = kOpenings + 3;
// The two flows of a silence begin this far apart, so that an outage of less than 0.7 s does not
// hit both.
constexpr Duration kStagger = std::chrono::milliseconds(700);
// How much longer than the silence its reply is waited for. No measurement behind this value: it
// only has to be larger than a round trip with full queues.
constexpr Duration kPatience = std::chrono::seconds(2);
// How much earlier than asked a reply may seem to come, because two clocks run at different speeds:
// 100 ms are 400 ppm of the longest silence.
constexpr Duration kTolerance = std::chrono::milliseconds(100);

}  // namespace

SilenceTest::SilenceTest(Silence limit, SessionId session, TimePoint start) : session_(session) {
  assert(limit >= kShortestSilence && limit <= kLongestSilence && session.value != 0);
  const auto add = [&](Silence silence) {
    for (std::size_t i = 0; i < kFlowsPerSilence; ++i) {
      Flow flow;
      flow.silence = silence;
      flow.next_at = start + i * kStagger;
      flows_.push_back(std::move(flow));
    }
  };
  for (const Silence silence : kSilences) {
    if (silence < limit) add(silence);
  }
  add(limit);
}

// Changes the phase of a flow whose time has come. False when nothing is to be sent in the new
// phase.
bool SilenceTest::advance(TimePoint now, Flow& flow) const {
  if (flow.phase == Phase::kSilent) {
    flow.phase = Phase::kClosed;
    return false;
  }
  flow.next_at = now + kOpeningInterval;
  if (std::ranges::count(flow.requests, true, &Request::answered) >= kOpenings) {
    flow.phase = Phase::kSilent;
    flow.next_at = now + flow.silence + kPatience;
    return true;
  }
  if (flow.requests.size() < kOpeningsAtMost) return true;
  flow.phase = Phase::kUnanswered;
  return false;
}

std::optional<SilenceTest::Sending> SilenceTest::poll(TimePoint now, std::span<std::byte> buffer) {
  for (std::size_t i = 0; i < flows_.size(); ++i) {
    Flow& flow = flows_[i];
    if (is_over(flow) || now < flow.next_at || !advance(now, flow)) continue;
    wire::Echo echo;
    if (flow.phase == Phase::kSilent) echo.delay = static_cast<std::uint8_t>(flow.silence.count());
    echo.token = flow.token;
    echo.request.sequence = static_cast<std::uint32_t>(flow.requests.size());
    echo.request.sent = wire::to_stamp_time(now.time_since_epoch());
    flow.requests.push_back({.at = now});
    const wire::PacketHeader header{wire::PacketType::kEcho, LinkId{static_cast<std::uint8_t>(i)},
                                    wire::kClearEpoch, session_, flow.requests.size()};
    return Sending{i, wire::write_echo(buffer, header, echo, wire::kEchoBytes)};
  }
  return std::nullopt;
}

void SilenceTest::handle(TimePoint received, std::size_t index, ByteView datagram) {
  Flow& flow = flows_.at(index);
  const auto packet = wire::parse(datagram);
  if (!packet || packet->header.type != wire::PacketType::kEcho || !packet->echo.is_reply) return;
  const wire::StampReply& reply = packet->echo.reply;
  if (reply.request_sequence >= flow.requests.size()) return;
  Request& request = flow.requests[reply.request_sequence];
  if (reply.request_sent != wire::to_stamp_time(request.at.time_since_epoch())) return;
  request.answered = true;
  flow.token = packet->echo.token;
  const bool is_last = reply.request_sequence + 1 == flow.requests.size();
  if (flow.phase != Phase::kSilent || !is_last) return;
  flow.phase =
      received - request.at >= flow.silence - kTolerance ? Phase::kSurvived : Phase::kRefused;
}

std::optional<TimePoint> SilenceTest::next_timeout() const {
  std::optional<TimePoint> next;
  for (const Flow& flow : flows_) {
    if (!is_over(flow)) next = earliest(next, flow.next_at);
  }
  return next;
}

TimePoint SilenceTest::ends_at() const {
  TimePoint end = TimePoint::min();
  for (const Flow& flow : flows_) {
    if (is_over(flow)) continue;
    const auto sent = static_cast<std::ptrdiff_t>(flow.requests.size());
    const Duration opening =
        flow.phase == Phase::kSilent
            ? Duration::zero()
            : std::max<std::ptrdiff_t>(kOpenings - sent, 0) * kOpeningInterval + flow.silence +
                  kPatience;
    end = std::max(end, flow.next_at + opening);
  }
  return end;
}

bool SilenceTest::any(Silence silence, Phase phase) const {
  return std::ranges::any_of(
      flows_, [&](const Flow& f) { return f.silence == silence && f.phase == phase; });
}

SilenceResult SilenceTest::result() const {
  SilenceResult result;
  // The flows are in rising order of their silences.
  for (const Flow& flow : flows_) {
    result.answered |= std::ranges::any_of(flow.requests, &Request::answered);
    result.refused |= flow.phase == Phase::kRefused;
    if (any(flow.silence, Phase::kSurvived)) {
      result.survived = flow.silence;
      // A shorter silence that seemed to close the mapping did not: its reply was lost on the way.
      result.closed.reset();
    } else if (!result.closed && any(flow.silence, Phase::kClosed)) {
      result.closed = flow.silence;
    }
  }
  return result;
}

}  // namespace interneuron::probe
