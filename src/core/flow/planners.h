// What is to be done for the messages under way, decided from what is known of the traffic and told
// as orders: plain values, which Executor carries out.
//
// The planners are free functions, a file for each purpose. They change nothing and keep nothing.
// An order names paths that exist, and holds until something of the traffic changes; one that names
// no path asks for nothing. Sizes are in bytes. Pure; thread-compatible; never throw but
// std::bad_alloc.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/flow/traffic.h"
#include "core/wire/window.h"
#include "interneuron/link.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// What else may be done for a message than to send it and to repair what is lost.
struct Protection {
  // Its paths divide it among them, so that the last part is there as soon as possible.
  bool divided = false;
  // Paths that may carry repair symbols of it: as many as are worth it
  // (src/core/code/redundancy.h) for what nobody can ask for again. They leave when all of the
  // message has left, or at once where that would be too late for them.
  PathSet symbols{};
  // Paths over which what is missing of it goes when it seems late (plan_rescue.cc).
  PathSet rescue{};
};

// --- shares of a message that its paths divide (plan_striping.cc)

// The pieces that each path of a message carries, in the order of its paths; 0 for those that would
// only delay it.
using Shares = std::array<std::uint16_t, kMaxLinks>;
Shares plan_shares(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                   const PathList& paths);
// The path of whose next message this one, which has nothing to send, brings the last piece sooner.
std::optional<LinkId> slower_path(const Traffic& traffic, LinkId idle);

// --- what is lost is sent again (plan_repair.cc)

// What tells of a loss: the peer's report of later packets, or that it reports nothing.
enum class Evidence : std::uint8_t { kReport, kSilence };
// The paths over which a lost fragment is queued again. No first one: a copy that is under way will
// be there sooner, or no path may carry it in time.
struct RepairOrder {
  std::optional<LinkId> first;
  std::optional<LinkId> second;
  bool is_too_late = false;
};
RepairOrder plan_repair(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                        std::uint16_t index, Evidence evidence);

// --- repair symbols (plan_coding.cc) and window symbols (plan_windows.cc)

// What doubling the bytes of a message of usual importance is worth in messages lost: symbols are
// added as long as a share x of the bytes saves more than x times this many. With 1 % of loss
// that is five symbols for the last 60 of 98 pieces.
inline constexpr double kPriceOfBytes = 0.02;
// Proactive symbols take at most this part of a message, and one more: bursts are geometric at
// best, and what covers nearly all of them costs more bytes than a copy on another path is worth.
inline constexpr std::size_t kMostPart = 7;
// By how many times what its delay varies a path that the message does not take must be sooner than
// symbols are needed: as in the timeouts of RFC 6298.
inline constexpr int kSureDeviations = 4;
// How many times a byte of a message of this importance is worth one of usual importance.
inline double value_of(std::int16_t importance) {
  return (1.0 + std::max<std::int16_t>(importance, 0)) / (1.0 + kUsualImportance);
}

// For what symbols are sent: for what is under way and last, or for all that is under way.
enum class Protect : std::uint8_t { kLast, kAll };
// `count` further symbols of a block go over this path.
struct SymbolOrder {
  LinkId path{};
  std::size_t count = 0;
};
std::optional<SymbolOrder> plan_symbols(const Traffic& traffic, TimePoint now,
                                        const OutgoingMessage& m, std::size_t block, Protect what);
// Whether symbols are in time if they wait for all of the message to leave.
bool symbols_can_wait(const Traffic& traffic, TimePoint now, const OutgoingMessage& m);

// The size of the pieces of a message of so many bytes of which one has at most `chunk`.
std::size_t even_chunk(const Traffic& traffic, std::size_t bytes, std::size_t chunk,
                       const Protection& protection);
// Whether windows may cover a message.
bool is_for_windows(const OutgoingMessage& m);
// The latest that a symbol may leave, over whichever path, to help a message by `target`.
std::optional<TimePoint> window_latest(const Traffic& traffic, const OutgoingMessage& m,
                                       TimePoint target);
// `count` symbols with this header, each with a row of its own, go over this path and leave by
// `until`. The longest piece that they cover has `longest` bytes.
struct WindowOrder {
  LinkId path{};
  std::size_t count = 0;
  wire::WindowHeader header;
  std::size_t longest = 0;
  TimePoint until{};
};
// The symbols that are worth their bytes for these messages, those of them that there are.
std::optional<WindowOrder> plan_window(const Traffic& traffic, TimePoint now,
                                       WindowFlow::Pending pending);

// --- what is done for a message that seems late (plan_rescue.cc)

// What rescues a message has to be there so much before the deadline. No measurement behind this
// value: it only has to be more than a turn of an event loop.
inline constexpr Duration kRescueMargin = std::chrono::milliseconds(2);
// The latest that something may begin to leave over a path to be there in time.
struct LastDeparture {
  LinkId path{};
  TimePoint at{};
};
// The path of `over`, other than `except`, that may begin latest to bring so many bytes (with IP
// headers) of a message by `target`.
std::optional<LastDeparture> last_departure(const Traffic& traffic, const OutgoingMessage& m,
                                            const PathSet& over, std::optional<LinkId> except,
                                            std::size_t ip_bytes, TimePoint target);
// Whether nothing lost is sent again, because an alternative stands by and all that is missing
// cannot be in time elsewhere.
bool gives_way(const Traffic& traffic, TimePoint now, const OutgoingMessage& m, Evidence evidence);
// What is missing of the message goes over this path as well, or its alternative does.
struct RescueOrder {
  LinkId path{};
  bool by_alternative = false;
};
std::optional<RescueOrder> plan_rescue(const Traffic& traffic, TimePoint now,
                                       const OutgoingMessage& m);
// When plan_rescue() is to be asked for a message, later than `from`; nothing: never.
std::optional<TimePoint> next_look(const Traffic& traffic, TimePoint from,
                                   const OutgoingMessage& m);
// The pieces that are not acknowledged and that this path neither has in flight nor is to send.
std::vector<std::uint16_t> missing_on(const SendPath& path, const OutgoingMessage& m);

// --- what becomes of messages on a path that cannot be relied on any more (plan_rescue.cc)

// How many pieces of which messages a path has in flight or is to send.
std::map<MessageId, std::size_t> owed_by(const Traffic& traffic, const SendPath& path);
// What is missing of a message goes over `rescue` as well; or all that the path owes of it moves.
struct MoveOrder {
  std::optional<LinkId> rescue;
  bool moves = false;
};
MoveOrder plan_move(const Traffic& traffic, TimePoint now, LinkId from, const OutgoingMessage& m,
                    std::size_t owed_pieces);

}  // namespace interneuron::flow
