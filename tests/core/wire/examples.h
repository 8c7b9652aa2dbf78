// The examples of docs/wire_format.md: bytes (example_bytes.h) and what they mean.
#pragma once

#include <string_view>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "tests/core/wire/example_bytes.h"

namespace interneuron::wire {

inline RoundHeader example_round_header() {
  RoundHeader h;
  h.round = {SessionId{0x5eed0001}, PipelineId{1}, RoundId{42}};
  h.stage = 1;
  h.stages = 3;
  h.communication = 0b101;
  h.variant = 1;
  h.best_planned = 0;
  h.needs = {255, 64, 128, 0};
  h.policy = policy_id("down_sampling");
  h.t0 = PeerTime{Duration{1'234'567'890'123}};
  h.x_permille = 123;
  h.deadline_us = 130'000;
  h.period_us = 100'000;
  h.indicator[1] = RoundState::kOnTime;
  h.indicator[2] = RoundState::kMissed;
  h.indicator[3] = RoundState::kOnTime;
  h.guard = GuardKind::kBudget;
  h.level_used = 2;
  h.variant_used = 1;
  h.local_quality = 35;
  h.miss_price = 1000;
  h.excess = -1380;
  h.computed = 5670;
  h.e2e[1] = 14091;
  h.e2e[2] = kE2eNever;
  h.e2e[3] = 11359;
  return h;
}

inline Bytes example_message() {
  Bytes message(kRoundHeaderBytes);
  write_round_header(std::span(message).first<kRoundHeaderBytes>(), example_round_header());
  for (const char c : std::string_view("frame")) message.push_back(static_cast<std::byte>(c));
  return message;
}

inline Bytes example_plain_message() {
  PlainHeader h{.id = 5,
                .deadline_us = 100'000,
                .t0 = PeerTime{Duration{1'234'567'890'123}},
                .channel = 7,
                .importance = 200,
                .variant = 1,
                .newest_only = true};
  Bytes message(kPlainHeaderBytes);
  write_plain_header(std::span(message).first<kPlainHeaderBytes>(), h);
  for (const char c : std::string_view("hello")) message.push_back(static_cast<std::byte>(c));
  return message;
}

inline PacketHeader example_header(PacketType type, LinkId link, std::uint64_t number,
                                   std::uint32_t stamp_us = 0) {
  return {type, link, kClearEpoch, SessionId{0x5eed0001}, number, stamp_us};
}

inline constexpr std::uint32_t kExampleStamp = 1'234'567'890;

inline FragmentHeader example_fragment() {
  return {MessageId{9}, 0, 1347, 103, 130'000, MessageKind::kRound};
}

inline FragmentHeader example_plain_fragment() {
  return {MessageId{10}, 0, 1347, 25, 100'000, MessageKind::kPlain};
}

inline FragmentHeader example_repair_fragment() {
  return {MessageId{11}, 3, 8, 22, 100'000, MessageKind::kPlain};
}

inline WindowHeader example_window() {
  return WindowHeader{.row = 1, .messages = {{MessageId{10}, 0b1}, {MessageId{11}, 0b110}}};
}

inline Token example_token() {
  Token token;
  std::ranges::copy(from_hex("00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"), token.begin());
  return token;
}

inline Echo example_echo_request() {
  Echo echo;
  echo.hold = true;
  echo.train = 3;
  echo.index = 4;
  echo.count = 18;
  echo.request = {21, 0xe9000000'80000000, kStampUnsynchronised};
  echo.token = example_token();
  return echo;
}

inline Echo example_echo_reply() {
  Echo echo = example_echo_request();
  echo.is_reply = true;
  echo.reply = stamp_reply_to(echo.request, 0);
  echo.request = {};
  echo.reply.sequence = 20;
  echo.reply.received = 0xe9000000'80800000;
  echo.reply.sent = 0xe9000000'81000000;
  return echo;
}

inline Feedback example_feedback() {
  LinkReport report;
  report.link = LinkId{2};
  report.has_exchange = true;
  report.s = PeerTime{Duration{987'654'321}};
  report.h = std::chrono::milliseconds(5);
  report.largest = 100;
  report.bitmap = {~std::uint64_t{0b100}, 0x7'ffff'ffff, 0, 0};
  report.train_start = 69;
  report.train_packets = 31;
  report.train_rate = DataRate::mbit(30);
  report.rate = DataRate::mbit(50);
  report.loss = 1311;
  report.has_delays = true;
  report.newest_delay_us = 0x0051fbaa;
  report.largest_delay_us = 0x0052010a;
  report.ect0_packets = 1;
  report.ect1_packets = 90;
  report.ce_packets = 3;
  report.received_bytes = 123'456;
  return Feedback{.u = 1'234'600'000'000,
                  .echo = SessionId{0xcafe0002},
                  .reports = {report},
                  .complete = {{MessageId{9}, 1500}, {MessageId{10}, 200, true}},
                  .refused = {MessageId{8}}};
}

}  // namespace interneuron::wire
