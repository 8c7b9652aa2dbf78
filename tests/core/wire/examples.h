// The examples of docs/wire_format.md: bytes and what they mean.
#pragma once

#include <cctype>
#include <string_view>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"

namespace interneuron::wire {

// Two hexadecimal digits per byte; everything else is skipped.
inline Bytes from_hex(std::string_view text) {
  const auto value = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  Bytes out;
  int high = -1;
  for (const char c : text) {
    if (std::isxdigit(static_cast<unsigned char>(c)) == 0) continue;
    if (high < 0) {
      high = value(c);
    } else {
      out.push_back(static_cast<std::byte>(high * 16 + value(c)));
      high = -1;
    }
  }
  return out;
}

inline constexpr std::string_view kDataExample =
    "21 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 07"
    "49 96 02 d2"
    "00 00 00 09 00 00 00 67 05 43 00 00 00 01 fb d0"
    "00"
    "03 00 00 01 01 03 00 05 01 00 00 7b ff 40 80 00"
    "5e ed 00 01 00 00 00 2a cd 5b d4 bf 00 01 fb d0"
    "00 01 86 a0 00 00 00 64 00 00 01 1f 71 fb 04 cb"
    "00 00 00 00 00 00 00 00 01 02 01 23 03 e8 fa 9c"
    "16 26 00 00 37 0b ff ff 2c 5f 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
    "00 00"
    "66 72 61 6d 65"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kPlainExample =
    "21 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 08"
    "49 96 02 d2"
    "00 00 00 0a 00 00 00 19 05 43 00 00 00 01 86 a0"
    "01"
    "00 00 00 05 00 01 86 a0 00 00 01 1f 71 fb 04 cb"
    "00 07 c8 09"
    "68 65 6c 6c 6f"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kRepairExample =
    "21 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 09"
    "49 96 02 d2"
    "00 00 00 0b 00 00 00 16 00 08 00 03 00 01 86 a0"
    "01"
    "00 c7 86 79 4c 94 ae fb"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kWindowExample =
    "26 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 0a"
    "49 96 02 d2"
    "01 02 00 00 00 0a 01 01 06"
    "00 00 00 99 7c f6 00 8f c5 f0 8f 00 8c 26 96 5a"
    "48 d2 fb 00 00 be ab 73 ee c2 9f 00 1d 40 27 7b"
    "9e b9 b9 66"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kChallengeExample =
    "27 00 00 01 ca fe 00 02 00 00 00 00 00 00 01 2c"
    "00 00 00 00"
    "5e ed 00 01"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kTokenExample =
    "28 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2f"
    "49 96 80 a4"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kFeedbackExample =
    "22 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2c"
    "49 96 80 40"
    "00 00 01 1f 73 e4 fa 00 ca fe 00 02 00 00 01 02"
    "01"
    "00 02 05 05 1f 00 00 00 1f"
    "00 00 00 00 3a de 68 b1 00 00 00 00 00 4c 4b 40"
    "00 00 00 00 00 00 00 64"
    "ff ff ff ff ff ff ff fb 00 00 00 07 ff ff ff ff"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 45 00 00 75 30 00 00 c3 50"
    "00 51 fb aa 00 52 01 0a"
    "00 00 00 5a 00 00 00 03 00 00 00 00 00 01 e2 40"
    "00 00 00 09 00 00 05 dc 00 00 00 0a 80 00 00 c8"
    "00 00 00 08"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kProbeExample =
    "23 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2d"
    "49 96 80 a4"
    "00 00 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kEchoRequestExample =
    "24 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2e"
    "00 00 00 00"
    "02 00 00 03 00 04 00 12"
    "00 00 00 15 e9 00 00 00 80 00 00 00 16 01 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kEchoReplyExample =
    "24 00 00 01 ca fe 00 02 00 00 00 00 00 00 00 15"
    "00 00 00 00"
    "03 00 00 03 00 04 00 12"
    "00 00 00 14 e9 00 00 00 81 00 00 00 16 01 00 00"
    "e9 00 00 00 80 80 00 00 00 00 00 15 e9 00 00 00"
    "80 00 00 00 16 01 00 00 00 00 00 00"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

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
  PlainHeader h;
  h.id = 5;
  h.deadline_us = 100'000;
  h.t0 = PeerTime{Duration{1'234'567'890'123}};
  h.channel = 7;
  h.importance = 200;
  h.variant = 1;
  h.newest_only = true;
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
  WindowHeader window;
  window.row = 1;
  window.messages = {{MessageId{10}, 0b1}, {MessageId{11}, 0b110}};
  return window;
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
  report.ect_packets = 90;
  report.ce_packets = 3;
  report.received_bytes = 123'456;
  Feedback feedback;
  feedback.u = 1'234'600'000'000;
  feedback.echo = SessionId{0xcafe0002};
  feedback.reports = {report};
  feedback.complete = {{MessageId{9}, 1500}, {MessageId{10}, 200, true}};
  feedback.refused = {MessageId{8}};
  return feedback;
}

}  // namespace interneuron::wire
