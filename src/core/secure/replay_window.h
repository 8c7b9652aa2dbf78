// Which numbers of packets have come under one key: each is taken once. A bitmap in the manner of
// RFC 6479: numbers fall into words of 64 bits that follow each other in a ring, and the whole word
// that becomes the newest one is cleared, so that nothing is shifted.
//
// Links of a vehicle differ by up to a second, but each has a window of its own: only what one link
// reorders has to fit. 8,128 numbers are 0.8 s at 10,000 packets a second. Ask before a packet is
// opened and take its number after: a number that was never proved must not move the window.
// 1 KB. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace interneuron::crypto {

class ReplayWindow {
 public:
  static constexpr std::size_t kBits = 8192;
  static constexpr std::size_t kWordBits = 64;
  // How far behind the largest number one may be.
  static constexpr std::uint64_t kReach = kBits - kWordBits;

  // Whether this number has neither come nor is too old to tell.
  bool is_new(std::uint64_t number) const;
  // It has come, in a packet that was authentic and whose number is new.
  void take(std::uint64_t number);
  std::uint64_t largest() const { return largest_; }

 private:
  static constexpr std::size_t kWords = kBits / kWordBits;

  // No number has come yet: even 0 may.
  bool is_empty_ = true;
  std::uint64_t largest_ = 0;
  std::array<std::uint64_t, kWords> words_{};
};

}  // namespace interneuron::crypto
