// Both sides of windows, symbols that cover several small messages (docs/wire_format.md, "Window
// (type 6)"): what the sender keeps for them, and how the receiver computes lost pieces from them.
// Pure; thread-compatible; never throws but std::bad_alloc.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/code/window.h"
#include "core/wire/packet.h"
#include "interneuron/few.h"
#include "interneuron/link.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// What a sender keeps of its small messages for windows: how soon one follows the other, which of
// them the next symbols are to cover, and symbols that wait to leave. Traffic holds one, and
// Executor fills and empties it as plan_windows.cc says. All small coded messages to a peer are one
// flow, whatever their channels: the more there are, the less each pays for a symbol.
//
// Plain values. Memory: symbols that wait keep theirs for the next ones, at most kMostSymbols of
// one packet each.
class WindowFlow {
 public:
  static constexpr std::size_t kMostSymbols = 8;

  // Whether the peer decodes windows.
  bool is_understood() const { return understood_; }
  void set_understood(bool understood) { understood_ = understood; }

  // --- how soon one follows the other
  // All of a small message has left.
  void note_left(TimePoint now);
  // When the next one will have left; nothing: not known.
  std::optional<TimePoint> next() const;

  // --- which ones are to be covered
  using Pending = Few<MessageId, wire::kMostWindowMessages>;
  const Pending& pending() const { return pending_; }
  // A symbol is to cover this one too, which has so many pieces; it has to leave at `latest`.
  void add(MessageId message, std::size_t pieces, TimePoint latest);
  // Whether one of so many pieces can be covered as well.
  bool has_room(std::size_t pieces) const {
    return pending_.size() < wire::kMostWindowMessages && pieces_ + pieces <= code::kMostSources;
  }
  void clear_pending();
  // When a symbol has to leave for what is pending.
  std::optional<TimePoint> due() const { return due_; }

  // --- symbols that wait to leave
  struct Symbol {
    LinkId path{};
    // Nobody wants it to leave later.
    TimePoint until{};
    wire::WindowHeader header;
    Bytes bytes;
    bool waits = false;
    std::size_t ip_bytes() const {
      return wire::window_header_bytes(header.messages.size()) + bytes.size() + kOverhead;
    }
  };
  // One to be filled in; the oldest makes room for it.
  Symbol& push();
  // The oldest that waits for this path, if there is one; nullptr.
  Symbol* front(LinkId path) {
    for (std::size_t i = 0; i < symbols_.size(); ++i) {
      Symbol& symbol = symbols_[(next_symbol_ + i) % kMostSymbols];
      if (symbol.waits && symbol.path == path) return &symbol;
    }
    return nullptr;
  }
  bool waits(LinkId path) const { return const_cast<WindowFlow*>(this)->front(path) != nullptr; }
  void remove_path(LinkId path) {
    while (Symbol* symbol = front(path)) symbol->waits = false;
  }
  // Successive symbols are different rows.
  std::uint8_t next_row();
  // The peer began a new life.
  void reset() { *this = {}; }

 private:
  // Header and tag of a packet, and those of IP and UDP.
  static constexpr std::size_t kOverhead = 36 + kIpUdpBytes;

  bool understood_ = false;
  std::optional<TimePoint> newest_;
  std::optional<Duration> gap_;
  Duration deviation_{};
  Pending pending_;
  std::size_t pieces_ = 0;
  std::optional<TimePoint> due_;
  std::vector<Symbol> symbols_;
  std::size_t next_symbol_ = 0;
  std::uint8_t row_ = 0;
};

// Keeps the pieces of small messages that may be covered by window symbols, and computes lost ones
// from these. Peer (src/core/peers) owns one, feeds it every piece and every window symbol that was
// accepted, and hands what poll() gives to the Reassembler like a piece that has come: all that is
// checked of a piece is checked of it, so that one that is late, refused or there already changes
// nothing.
//
// Memory: none before the first symbol. From then on copies of the newest kMostKept pieces of
// messages that have at most wire::kMostWindowPieces, and of the newest code::Equations::kMost
// symbols that cannot be solved yet. They count as kHeld bytes from the beginning, and are freed
// when no symbol has come for kIdle. Copies reuse memory, so that nothing is allocated for each. A
// symbol or piece takes some ten microseconds at most.
//
// What a hostile peer could try: symbols that cover what was never sent, or that lie. They only
// push out its own pieces and symbols. What they are solved to has the fields of a piece and zeros
// behind it, or is dropped; if it does, it is what a packet with the same fields could have brought
// as well.
class WindowReceiver {
 public:
  // All of one window and half as many of messages that no window covers.
  static constexpr std::size_t kMostKept = code::kMostSources * 3 / 2;
  // What it may hold, in bytes.
  static constexpr std::size_t kHeld =
      (kMostKept + code::Equations::kMost) * (wire::kSourceHeaderBytes + code::kMostBytes);
  // Windows cover what was sent in less than a second. No measurement behind this value: it only
  // has to be longer than pauses of a flow, of which each costs its first window.
  static constexpr Duration kIdle = std::chrono::seconds(10);

  // A piece has come.
  void piece(const wire::Data& data);
  // A symbol has come. `room`: how many bytes may be held more than now; where the first symbol
  // finds less than kHeld, it is dropped.
  void symbol(TimePoint now, const wire::Window& window, std::size_t room = SIZE_MAX);
  // The next piece that was computed; its bytes are valid until the next call of any function.
  std::optional<wire::Data> poll();

  // Call it at next_timeout(); frees the memory.
  void handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const { return idle_at_; }
  // Whether poll() may give something.
  bool has_computed() const { return handed_out_ < computed_.size(); }
  // What counts as held.
  std::size_t bytes() const { return idle_at_ ? kHeld : 0; }

 private:
  // Which piece a source is.
  struct Name {
    MessageId message{};
    std::uint8_t index = 0;
    friend bool operator==(const Name&, const Name&) = default;
  };
  struct Source {
    Name name;
    // What a symbol covers of it: its fields and bytes; empty: there is none.
    Bytes bytes;
  };
  struct Unknown {
    Name name;
    std::uint8_t factor = 0;
  };
  // A symbol from which all sources that are known were taken off.
  struct Equation {
    // Counts symbols; what is over has no unknown pieces.
    std::uint64_t number = 0;
    Few<Unknown, code::kMostSources> unknown;
    Bytes bytes;
  };
  // Symbols, and the pieces that they miss.
  struct System {
    Few<Equation*, code::Equations::kMost> rows;
    Few<Name, code::Equations::kMostUnknown> unknown;
    code::Equations equations;
  };
  const Source* find(const Name& name) const;
  void keep(const Name& name, ByteView head, ByteView bytes);
  // Takes a source off the symbols that cover it. False: there are none.
  bool take_off(const Name& name, ByteView source);
  Equation& place_for_symbol();
  System open_system();
  // Computes a piece that the symbols tell, or drops symbols that lie. False: there are none.
  bool solve();

  std::vector<Source> sources_;
  // The oldest one, once there are kMostKept.
  std::size_t next_source_ = 0;
  std::vector<Equation> equations_;
  std::uint64_t symbols_ = 0;
  // Sources that were computed, of which so many were handed out.
  Few<Name, kMostKept> computed_;
  std::size_t handed_out_ = 0;
  Bytes scratch_;
  // Nothing: no symbol has come.
  std::optional<TimePoint> idle_at_;
};

}  // namespace interneuron::flow
