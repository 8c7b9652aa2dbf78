#include "tests/fuzz/reassembly.h"

#include <chrono>
#include <cstdlib>
#include <random>
#include <vector>

#include "core/code/blocks.h"
#include "core/code/erasure_code.h"
#include "core/flow/reassembler.h"
#include "core/wire/packet.h"

namespace interneuron::flow {
namespace {

// A message with all pieces and symbols that a sender could send of it.
struct Truth {
  wire::FragmentHeader fragment;
  Bytes whole;
  std::vector<Bytes> packets;
};

Truth truth_of(std::size_t number, std::size_t size, std::uint16_t chunk) {
  Truth t{{MessageId{static_cast<std::uint32_t>(number)}, 0, chunk,
           static_cast<std::uint32_t>(size), 200'000, wire::MessageKind::kPlain},
          Bytes(size),
          {}};
  std::mt19937 random(static_cast<std::uint32_t>(number));
  for (std::byte& b : t.whole) b = static_cast<std::byte>(random());
  const code::Blocks blocks(t.fragment.count());
  Bytes padded = t.whole;
  padded.resize(blocks.count() * std::size_t{chunk});
  t.packets.resize(blocks.end());
  for (std::size_t i = 0; i < blocks.count(); ++i) {
    const auto begin = t.whole.begin() + static_cast<std::ptrdiff_t>(i * chunk);
    t.packets[i].assign(begin, begin + std::min<std::ptrdiff_t>(chunk, t.whole.end() - begin));
  }
  for (std::size_t b = 0; b < blocks.blocks(); ++b) {
    std::vector<const std::byte*> in;
    std::vector<std::byte*> out;
    for (std::size_t c = 0; c < blocks.pieces(b); ++c) {
      in.push_back(padded.data() + blocks.piece_at(b, c) * chunk);
    }
    for (std::size_t r = 0; r < code::kMostRows; ++r) {
      t.packets[blocks.symbol_at(b, r)].resize(chunk);
      out.push_back(t.packets[blocks.symbol_at(b, r)].data());
    }
    code::encode(in, chunk, 0, out);
  }
  return t;
}

const std::array<Truth, kMessages>& truths() {
  constexpr auto kLongest = static_cast<std::uint16_t>(kMaxPieceBytes);
  static const std::array<Truth, kMessages> all{
      truth_of(0, 1, 1),           truth_of(1, 100, 40),          truth_of(2, 3000, 1000),
      truth_of(3, 5000, kLongest), truth_of(4, 2000, 8),          truth_of(5, 900, 2),
      truth_of(6, 64, 16),         truth_of(7, 300'000, kLongest)};
  return all;
}

std::uint16_t number_at(const std::uint8_t* at) {
  return static_cast<std::uint16_t>(at[0] | at[1] << 8U);
}

bool same(const wire::MessageBytes& message, const Bytes& whole) {
  Bytes out(message.header.begin(), message.header.end());
  out.insert(out.end(), message.payload.begin(), message.payload.end());
  return out == whole;
}

// Pieces that one operation brings.
constexpr std::size_t kMostAtOnce = 160;

// A fragment that differs from a true one in any fields, or in none, so that some contradict in one
// field alone.
wire::FragmentHeader lie_about(const Truth& truth, const std::uint8_t* op) {
  wire::FragmentHeader fragment = truth.fragment;
  fragment.index = number_at(op + 1);
  // Up to 32,000 bytes, of which one datagram brings 1,347.
  if ((op[0] & 0x40U) != 0) fragment.chunk = static_cast<std::uint16_t>(1 + op[3] * op[3] / 2);
  if ((op[0] & 0x20U) != 0) fragment.size = 1U + number_at(op + 4) * (1U + op[6]);
  if ((op[0] & 0x10U) != 0) fragment.lifetime_us = op[6] * 1000U;
  return fragment;
}

// A Reassembler, and what may come of what it is given.
class Run {
 public:
  void operation(const std::uint8_t* op) {
    const std::size_t number = op[0] % kMessages;
    const Truth& truth = truths()[number];
    if ((op[0] & 0x80U) != 0) {
      // From a piece or symbol on so many.
      const std::size_t first = number_at(op + 1) % truth.packets.size();
      const std::size_t end = std::min(first + 1 + op[3] % kMostAtOnce, truth.packets.size());
      for (std::size_t i = first; i < end; ++i) {
        wire::FragmentHeader fragment = truth.fragment;
        fragment.index = static_cast<std::uint16_t>(i);
        bring(number, fragment, truth.packets[i], true);
      }
    } else {
      const wire::FragmentHeader fragment = lie_about(truth, op);
      const std::size_t size = std::min<std::size_t>(fragment.bytes(), kRoom);
      bring(number, fragment, Bytes(size, static_cast<std::byte>(op[7])), false);
    }
    now_ += std::chrono::milliseconds(op[7] % 4);
    reassembler_.expire(now_);
    while (reassembler_.poll_forgotten()) continue;
  }
  const Reassembled& done() const { return done_; }

 private:
  // Bytes of a fragment for which there is room beside the headers in what a socket takes in.
  static constexpr std::size_t kDatagram = 64 * 1024;
  static constexpr std::size_t kRoom = kDatagram - kPieceOverheadBytes;

  void bring(std::size_t number, const wire::FragmentHeader& fragment, const Bytes& bytes,
             bool is_true) {
    if (bytes.empty()) return;
    const std::size_t size = wire::write_data(
        buffer_, {wire::PacketType::kData, LinkId{0}, 0, SessionId{1}, 1}, fragment, bytes);
    const auto packet = wire::parse(std::span(buffer_).first(size));
    if (packet && size > kMaxDatagramBytes) std::abort();
    // What is refused for its length alone must do no harm either.
    const bool is_long = size > kMaxDatagramBytes && bytes.size() == fragment.bytes() &&
                         fragment.size <= std::uint64_t{UINT16_MAX} * fragment.chunk &&
                         fragment.index < code::Blocks(fragment.count()).end();
    if (!packet && !is_long) return;
    ++done_.packets;
    lied_[number] = lied_[number] || !is_true;
    const wire::Data data{fragment, bytes};
    const auto outcome = reassembler_.add(now_, packet ? packet->data : data, {});
    if (outcome.result == Reassembler::Result::kComplete) {
      ++done_.complete[number];
      const std::size_t got = outcome.message.header.size() + outcome.message.payload.size();
      if (done_.complete[number] > 1 || got != fragment.size) std::abort();
      if (!lied_[number] && !same(outcome.message, truths()[number].whole)) std::abort();
    }
    if (reassembler_.bytes() > Reassembler::kMaxBytes) std::abort();
  }

  Reassembled done_;
  Reassembler reassembler_;
  TimePoint now_{std::chrono::seconds(1)};
  std::array<bool, kMessages> lied_{};
  Bytes buffer_ = Bytes(kDatagram);
};

}  // namespace

Reassembled reassemble_any(std::span<const std::uint8_t> input) {
  Run run;
  for (; input.size() >= kOperationBytes; input = input.subspan(kOperationBytes)) {
    run.operation(input.data());
  }
  return run.done();
}

}  // namespace interneuron::flow
