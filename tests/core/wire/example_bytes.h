// The examples of docs/wire_format.md as bytes, in hexadecimal digits; examples.h has what they
// mean.
#pragma once

#include <cctype>
#include <string_view>

#include "interneuron/units.h"

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
    "31 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 07"
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
    "31 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 08"
    "49 96 02 d2"
    "00 00 00 0a 00 00 00 19 05 43 00 00 00 01 86 a0"
    "01"
    "00 00 00 05 00 01 86 a0 00 00 01 1f 71 fb 04 cb"
    "00 07 c8 09"
    "68 65 6c 6c 6f"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kRepairExample =
    "31 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 09"
    "49 96 02 d2"
    "00 00 00 0b 00 00 00 16 00 08 00 03 00 01 86 a0"
    "01"
    "00 c7 86 79 4c 94 ae fb"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kWindowExample =
    "36 00 00 02 5e ed 00 01 00 00 00 00 00 00 00 0a"
    "49 96 02 d2"
    "01 02 00 00 00 0a 01 01 06"
    "00 00 00 99 7c f6 00 8f c5 f0 8f 00 8c 26 96 5a"
    "48 d2 fb 00 00 be ab 73 ee c2 9f 00 1d 40 27 7b"
    "9e b9 b9 66"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kChallengeExample =
    "37 00 00 01 ca fe 00 02 00 00 00 00 00 00 01 2c"
    "00 00 00 00"
    "5e ed 00 01"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kTokenExample =
    "38 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2f"
    "49 96 80 a4"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kFeedbackExample =
    "32 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2c"
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
    "00 01 00 00 00 5a 00 00 00 03 00 00 00 00 00 01 e2 40"
    "00 00 00 09 00 00 05 dc 00 00 00 0a 80 00 00 c8"
    "00 00 00 08"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kProbeExample =
    "33 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2d"
    "49 96 80 a4"
    "00 00 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kEchoRequestExample =
    "34 00 00 01 5e ed 00 01 00 00 00 00 00 00 01 2e"
    "00 00 00 00"
    "02 00 00 03 00 04 00 12"
    "00 00 00 15 e9 00 00 00 80 00 00 00 16 01 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

inline constexpr std::string_view kEchoReplyExample =
    "34 00 00 01 ca fe 00 02 00 00 00 00 00 00 00 15"
    "00 00 00 00"
    "03 00 00 03 00 04 00 12"
    "00 00 00 14 e9 00 00 00 81 00 00 00 16 01 00 00"
    "e9 00 00 00 80 80 00 00 00 00 00 15 e9 00 00 00"
    "80 00 00 00 16 01 00 00 00 00 00 00"
    "00 11 22 33 44 55 66 77 88 99 aa bb cc dd ee ff"
    "00 00 00 00"
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";

}  // namespace interneuron::wire
