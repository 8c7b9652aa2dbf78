// A message under way at its sender: what is sent, and what became of each piece.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/code/blocks.h"
#include "core/flow/job_queue.h"
#include "core/flow/path_set.h"
#include "core/wire/message_bytes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// The importance of messages that do not say otherwise (SendOptions::importance), and of rounds.
inline constexpr std::int16_t kUsualImportance = 128;
// That of bulk (SendOptions::bulk): less than any.
inline constexpr std::int16_t kBulkImportance = -1;

// A plain value of MessageStore's. An index is that of a fragment or, from
// `count` on, of a repair symbol (code::Blocks); a block is complete at the peer once as many of
// either have arrived as it has fragments.
struct OutgoingMessage {
  MessageId id{};
  wire::MessageBytes bytes;
  TimePoint deadline{};
  // See Sender::Times; not after the deadline.
  TimePoint aim{};
  Duration doubt{};
  std::uint32_t lifetime_us = 0;
  std::int16_t importance = kUsualImportance;
  wire::MessageKind kind{};
  // The round that it is a part of, as its header says.
  std::optional<RoundRef> round;
  std::uint16_t count = 0;
  std::uint16_t chunk = 0;
  // Fragments or symbols that have to arrive yet, in all blocks together.
  std::uint16_t unacknowledged = 0;
  // First copies that have not left yet, over all paths.
  std::uint32_t to_leave = 0;
  // How many paths it was queued on.
  std::uint8_t paths = 0;
  // The paths that it was queued on.
  PathSet taken;
  // The paths that it is divided among, also those that have no share of it at first; none when
  // each path that it was queued on carries all of it.
  PathSet divided;
  // The paths over which lost fragments may be sent again.
  PathSet repairs;
  // What takes its place when it is given up (Sender::add_alternative()), and whether it may take
  // another's.
  std::optional<MessageId> alternative;
  bool is_alternative = false;
  // What is of no use once this one is whole at the peer (Sender::supersede()).
  std::optional<MessageId> inferior;
  // The paths over which it, or what is missing of it, goes when it or what it is to stand in for
  // seems late (plan_rescue.cc).
  PathSet rescue;
  // The paths that may carry repair symbols of it; none: it is not coded.
  PathSet symbol_paths;
  // Window symbols cover it, in place of its own (plan_windows.cc).
  bool in_window = false;
  // What each path was given at first: the fragments from … to - 1, how many of them nothing is
  // known of yet, and when they should be there, after so long on the air.
  struct Share {
    LinkId path{};
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    std::uint32_t open = 0;
    TimePoint eta{};
    Duration air{};
  };
  std::vector<Share> shares;
  struct PieceState {
    bool acknowledged = false;
    // It is under way, and too late to be sent once more when its loss is known.
    bool last = false;
    // A copy has left.
    bool left = false;
    // Copies that are queued or in flight.
    std::uint8_t under_way = 0;
  };
  // By index; symbols that were not made yet have no place here.
  std::vector<PieceState> pieces;
  // By index - count; empty where there is none.
  std::vector<Bytes> symbols;
  struct Block {
    std::uint16_t acknowledged = 0;
    // Not acknowledged, and at least one copy is under way; and those of them that are last.
    std::uint16_t under_way = 0;
    std::uint16_t last = 0;
    std::uint8_t rows = 0;
    // How many have a copy that has left.
    std::uint16_t left = 0;
  };
  std::vector<Block> blocks;

  code::Blocks division() const { return code::Blocks(count); }
  Block& block_of(std::size_t index) { return blocks[division().block_of(index)]; }
  // How many more of a block have arrived or are under way than the peer needs.
  int spare(std::size_t block) const {
    return blocks[block].acknowledged + blocks[block].under_way -
           static_cast<int>(division().pieces(block));
  }
  // The size of a packet with a full piece, IP headers included; and what all that is missing
  // takes.
  std::size_t ip_bytes_of_piece() const { return flow::ip_bytes_of_piece(chunk); }
  std::size_t missing_ip_bytes() const { return unacknowledged * ip_bytes_of_piece(); }
  // What a packet tells of a fragment or symbol, and its bytes.
  wire::FragmentHeader fragment(std::size_t index) const;
  wire::MessageBytes::Part part(std::size_t index) const;
  // Makes so many further symbols of a block; `scratch` is room for copies of pieces. There are
  // indices for all of them.
  void make_symbols(std::size_t block, std::size_t how_many, Bytes& scratch);
  // The bytes of memory that it holds.
  std::size_t held() const {
    std::size_t sum = bytes.size();
    for (const Bytes& symbol : symbols) sum += symbol.size();
    return sum;
  }

  // Becomes the message with these bytes.
  void take(wire::MessageBytes all, wire::MessageKind its_kind) {
    bytes = std::move(all);
    kind = its_kind;
    if (kind != wire::MessageKind::kRound) return;
    if (const auto header = wire::parse_round_header(bytes.header_view())) round = header->round;
  }
  // A piece is no longer this path's, which learns from the others alone.
  void leave_out(LinkId path, std::uint32_t index) {
    for (Share& share : shares) {
      if (share.path != path || index < share.from || index >= share.to) continue;
      share.to = index;
      if (share.open > 0) --share.open;
    }
  }
  // `firsts` first copies have left, or will not.
  void firsts_gone(std::uint32_t firsts) { to_leave -= std::min(to_leave, firsts); }
  void copy_left(std::size_t index) {
    if (!pieces[index].left) ++block_of(index).left;
    pieces[index].left = true;
  }
  // Whether so little has left that the peer cannot have all of it.
  bool is_surely_incomplete() const {
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (blocks[b].left < division().pieces(b)) return true;
    }
    return false;
  }
  void copy_added(std::size_t index) {
    PieceState& piece = pieces[index];
    if (piece.under_way++ == 0 && !piece.acknowledged) ++block_of(index).under_way;
  }
  void copy_gone(std::size_t index) {
    PieceState& piece = pieces[index];
    if (piece.under_way == 0 || --piece.under_way > 0 || piece.acknowledged) return;
    --block_of(index).under_way;
    set_last(index, false);
  }
  // It cannot be sent again, or it can after all.
  void set_last(std::size_t index, bool last) {
    PieceState& piece = pieces[index];
    if (piece.last == last) return;
    piece.last = last;
    Block& block = block_of(index);
    block.last = static_cast<std::uint16_t>(block.last + (last ? 1 : -1));
  }
  // It has arrived; told once for each index.
  void acknowledge(std::size_t index) {
    PieceState& piece = pieces[index];
    Block& block = block_of(index);
    set_last(index, false);
    if (piece.under_way > 0) --block.under_way;
    piece.acknowledged = true;
    if (block.acknowledged++ < division().pieces(division().block_of(index))) --unacknowledged;
  }
};

// Places move when there are more of them; to copy one would be to copy the whole message.
static_assert(std::is_nothrow_move_constructible_v<OutgoingMessage>);

}  // namespace interneuron::flow
