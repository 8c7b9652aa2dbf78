#include "tests/fuzz/reassembly.h"

#include <array>
#include <chrono>
#include <cstdlib>
#include <random>
#include <vector>

#include "core/code/blocks.h"
#include "core/code/erasure_code.h"
#include "core/flow/receiver.h"
#include "core/wire/packet.h"

namespace interneuron::flow {
namespace {

constexpr std::size_t kMessages = 8;

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

// Small ones, one of several blocks, and one whose symbols are as long as can be.
const std::array<Truth, kMessages>& truths() {
  static const std::array<Truth, kMessages> all{truth_of(0, 1, 1),       truth_of(1, 100, 40),
                                                truth_of(2, 3000, 1000), truth_of(3, 5000, 1358),
                                                truth_of(4, 2000, 8),    truth_of(5, 900, 2),
                                                truth_of(6, 64, 16),     truth_of(7, 40'000, 1358)};
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

}  // namespace

Reassembled reassemble_any(std::span<const std::uint8_t> input) {
  Reassembled done;
  Reassembler reassembler;
  TimePoint now{std::chrono::seconds(1)};
  std::array<bool, kMessages> lied{};
  std::array<std::size_t, kMessages> handed_out{};
  std::array<std::byte, kMaxPacketBytes> buffer{};
  for (; input.size() >= kOperationBytes; input = input.subspan(kOperationBytes)) {
    const std::uint8_t* op = input.data();
    const std::size_t number = op[0] % kMessages;
    const Truth& truth = truths()[number];
    const bool is_true = (op[0] & 0x80U) != 0;
    wire::FragmentHeader fragment = truth.fragment;
    Bytes bytes;
    if (is_true) {
      fragment.index = static_cast<std::uint16_t>(number_at(op + 1) % truth.packets.size());
      bytes = truth.packets[fragment.index];
    } else {
      // Each field true or any, so that some contradict in one field alone.
      fragment.index = number_at(op + 1);
      if ((op[0] & 0x40U) != 0) fragment.chunk = static_cast<std::uint16_t>(1 + op[3] * 6);
      if ((op[0] & 0x20U) != 0) fragment.size = 1U + number_at(op + 4) * (1U + op[6]);
      if ((op[0] & 0x10U) != 0) fragment.lifetime_us = op[6] * 1000U;
      bytes.assign(std::min<std::size_t>(fragment.bytes(), 1400), static_cast<std::byte>(op[7]));
    }
    if (bytes.empty() || bytes.size() + wire::kPacketOverhead + 64 > buffer.size()) continue;
    const std::size_t size = wire::write_data(
        buffer, {wire::PacketType::kData, LinkId{0}, 0, SessionId{1}, 1}, fragment, bytes);
    const auto packet = wire::parse(std::span(buffer).first(size));
    if (!packet || packet->header.type != wire::PacketType::kData) continue;
    ++done.packets;
    lied[number] = lied[number] || !is_true;
    const auto outcome = reassembler.add(now, packet->data, {});
    if (outcome.result == Reassembler::Result::kComplete) {
      ++done.complete;
      const std::size_t got = outcome.message.header.size() + outcome.message.payload.size();
      if (++handed_out[number] > 1 || (got != fragment.size)) std::abort();
      if (!lied[number] && !same(outcome.message, truth.whole)) std::abort();
    }
    if (reassembler.bytes() > Reassembler::kMaxBytes) std::abort();
    now += std::chrono::milliseconds(op[7] % 4);
    reassembler.expire(now);
    while (reassembler.poll_forgotten()) continue;
  }
  return done;
}

}  // namespace interneuron::flow
