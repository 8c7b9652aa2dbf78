#include "app/watch/screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace interneuron::watch {
namespace {

std::uint64_t strikes_of(const LivePeer& peer) {
  return std::accumulate(peer.ledger.strikes.begin(), peer.ledger.strikes.end(), std::uint64_t{0});
}

bool is_worth_a_line(const LivePeer& peer) {
  const PeerLedger& l = peer.ledger;
  const bool has_computed = peer.work && peer.work->computed + peer.work->unanswered() > 0;
  return has_computed || strikes_of(peer) > 0 ||
         l.contexts + l.held_messages + l.reassembly_messages > 0;
}

std::string work_text(const computing::PeerWork& work) {
  return fmt::format("  {} computed, {} not, {} waiting, {:.1f} s", work.computed,
                     work.unanswered(), work.waiting, to_ms(work.busy) / 1e3);
}

Line peer_line(const LivePeer& peer) {
  const PeerLedger& l = peer.ledger;
  std::string struck;
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    if (l.strikes[i] == 0) continue;
    struck += fmt::format("{}{} {}", struck.empty() ? "  limited: " : ", ",
                          to_string(static_cast<PeerLimit>(i)), l.strikes[i]);
  }
  return {{fmt::format("  peer {}", peer.peer), Style::kBold},
          {fmt::format("  {} rounds, {} held ({} KB), {} incomplete ({} KB)", l.contexts,
                       l.held_messages, l.held_bytes / 1000, l.reassembly_messages,
                       l.reassembly_bytes / 1000)},
          {peer.work ? work_text(*peer.work) : ""},
          {struck, Style::kWarn}};
}

}  // namespace

std::vector<Line> ledger_lines(const std::vector<LiveProgram>& programs) {
  std::vector<Line> lines;
  for (const LiveProgram& program : programs) {
    if (program.peers.empty()) continue;
    lines.push_back(
        {{fmt::format("  {} (process {}): {} peers, longest stall of its loop {:.1f} ms",
                      program.program, program.pid, program.peers.size(),
                      to_ms(program.loop_stall)),
          Style::kDim}});
    std::vector<const LivePeer*> shown;
    for (const LivePeer& peer : program.peers) {
      if (is_worth_a_line(peer)) shown.push_back(&peer);
    }
    std::ranges::stable_sort(shown, std::ranges::greater(),
                             [](const LivePeer* peer) { return strikes_of(*peer); });
    shown.resize(std::min(shown.size(), kPeersShown));
    for (const LivePeer* peer : shown) lines.push_back(peer_line(*peer));
  }
  return lines;
}

}  // namespace interneuron::watch
