// Carries datagrams from the endpoint, which decides what leaves next, to the transports, which
// take them in batches or not at all.
//
// Datagrams are collected per link, so that a batch can leave as few segmented sends. What a
// transport does not take is kept, in order, until it is writable. While one link's queue is full,
// nothing more is asked of the endpoint (which may still choose another link or drop what is too
// late), but not for longer than kStallPatience: a modem that takes nothing must not hold up the
// others. After that the oldest datagrams of the stalled link make room for new ones, and are
// counted. What the kernel refuses although the handle is writable is kept and offered again every
// kRefusedRetry; what it has refused for kStallPatience is dropped and counted the same way, so
// that one peer behind a rule of the firewall does not hold up the others. A transport that holds
// some of what it took is called every kRefusedRetry too, until it holds nothing.
//
// The bytes of messages are not copied on their way to the kernel. In the clear a datagram that
// leaves within the pump() that took it from the endpoint is given in parts; what has to wait is
// put together. Encrypted bytes are written by the encryption where the datagram lies, and stay
// there.
//
// Buffers are allocated by add(). Thread-compatible.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "interneuron/endpoint.h"
#include "interneuron/sizes.h"
#include "interneuron/transport.h"

namespace interneuron {

// Datagrams that wait per link: a raw frame of 512 KB is 375 of them.
inline constexpr std::size_t kQueueDatagrams = 512;
// Datagrams sent per pump(), so that receiving is not starved: they take about 100 us.
inline constexpr std::size_t kDatagramsPerTurn = 256;
// How long a full link may hold up the others. No measurement behind this value: it only has to be
// short against any deadline and long against the pauses of a busy link.
inline constexpr Duration kStallPatience = std::chrono::milliseconds(5);

// How soon what the kernel refused for now is offered again. No measurement behind this value: a
// queue of a NIC that is full has room for 12 full packets after it at 150 Mbit/s.
inline constexpr Duration kRefusedRetry = std::chrono::milliseconds(1);

class Outbox {
 public:
  // Where datagrams come from: Endpoint::poll_transmit_parts().
  class Source {
   public:
    virtual ~Source() = default;
    // The payload stays valid as long as nothing but poll() is called.
    virtual std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer) = 0;
  };

  enum class More {
    // The source has nothing for now.
    kNo,
    // The turn's share is used up: call pump() again after receiving.
    kNow,
    // Wait for a link of blocked() to become writable, or for next_timeout().
    kBlocked,
  };

  Outbox() : spare_(std::make_unique<Buffer>()) {}

  // `transport` must outlive its link here.
  void add(LinkId link, Transport& transport);
  void remove(LinkId link);

  // Takes what the source has, a turn's share of it, and sends what can be sent.
  More pump(TimePoint now, Source& source);
  // The same without sending, for use between two inputs of a batch.
  More collect(TimePoint now, Source& source);
  // The link's transport is writable again.
  void writable(TimePoint now, LinkId link);

  // Whether the link waits for its transport to become writable.
  bool blocked(LinkId link) const;
  // When there is reason to call pump() although nothing became writable: an instant after `now`,
  // or nothing for never.
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  // Links whose NIC vanished (errno), each reported once.
  std::vector<std::pair<LinkId, int>> take_gone();

  // Datagrams that wait.
  std::size_t queued(LinkId link) const;
  // Datagrams that were dropped because newer ones took their place, or the kernel refused them for
  // too long.
  std::uint64_t stalled(LinkId link) const;

 private:
  using Buffer = std::array<std::byte, kMaxDatagramBytes>;
  struct Slot {
    std::unique_ptr<Buffer> buffer;
    // As in TransmitParts; after pump() and collect() all of a datagram is in the buffer.
    std::size_t head = 0;
    ByteView payload;
    std::size_t tail = 0;
    Address to{};
    std::uint8_t ecn = 0;
    std::optional<RoundRef> round{};
  };
  // A ring of kQueueDatagrams slots.
  struct Link {
    LinkId id{};
    Transport* transport = nullptr;
    std::vector<Slot> slots;
    std::size_t first = 0;
    std::size_t count = 0;
    bool blocked = false;
    // When the transport last took something or, after that, when the queue began.
    TimePoint progress_at{};
    // The kernel takes nothing for now since then, and it is asked again then.
    std::optional<TimePoint> refused_since;
    TimePoint retry_at = TimePoint::min();
    // The transport holds some of what it took, and nothing waits here.
    bool held = false;
    // The errno of a send that found the NIC gone; 0: none.
    int gone = 0;
    std::uint64_t stalled = 0;

    // Whether there is something to call the transport for.
    bool pending() const { return count > 0 || held; }
    bool full() const { return count == slots.size(); }
    TimePoint patience_ends() const { return progress_at + kStallPatience; }
  };

  Link* find(LinkId link);
  const Link* find(LinkId link) const;
  More gather(TimePoint now, Source& source);
  void push(TimePoint now, Link& link, const TransmitParts& transmit);
  void keep_payloads();
  void flush(TimePoint now, Link& link);
  BatchResult offer(const Link& link);
  static void drop_oldest(Link& link);
  bool must_pause(TimePoint now);

  std::vector<Link> links_;
  // The source writes into this buffer, because only then the link is known; it then changes places
  // with the buffer of the link's next free slot.
  std::unique_ptr<Buffer> spare_;
  std::array<Outgoing, kQueueDatagrams> batch_;
};

}  // namespace interneuron
