// Records of the packets that one path has sent, and what they tell of the train whose dispersion
// the peer reports.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/ring.h"
#include "core/link/policed_rate.h"
#include "core/link/rate_estimator.h"
#include "core/wire/feedback.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Numbers packets without a gap and keeps what is remembered of each, the oldest first, until its
// user drops it. SentPackets owns one per path, and alone decides how many it keeps.
//
// 16 bytes for a small packet and 48 for one of data; nothing is allocated per packet once the
// rings have grown. References are valid until the next add. Pure; thread-compatible.
class PacketLog {
 public:
  // The fragment that a packet carried. Packets without a fragment are never repaired.
  struct Piece {
    MessageId message{};
    std::uint16_t index = 0;
    friend auto operator<=>(const Piece&, const Piece&) = default;
  };
  enum class Fate : std::uint8_t { kOpen, kArrived, kLost };
  struct Packet {
    TimePoint at{};
    // Which data-sized packet it is, modulo 2^32, if it is one.
    std::uint32_t data = 0;
    bool has_piece : 1 = false;
    bool data_sized : 1 = false;
    bool mtu_probe : 1 = false;
    // A report has told that it has not arrived.
    bool covered : 1 = false;
    // It left with ECT.
    bool ect : 1 = false;
    // See link::DeliveryStamp.
    bool app_limited : 1 = false;
    Fate fate = Fate::kOpen;
    // Whether it may bring a fragment yet.
    bool is_open_piece() const { return fate == Fate::kOpen && has_piece; }
  };
  // What is kept of a data-sized packet alone. Counts of bytes are modulo 2^32: what is kept lies
  // less than that apart.
  struct Data {
    // These belong to its link::DeliveryStamp, beside what Packet holds.
    TimePoint first_sent_at{};
    TimePoint delivered_at{};
    std::uint32_t delivered = 0;
    // Bytes of all data-sized packets up to and with this one.
    std::uint32_t train_bytes = 0;
    MessageId message{};
    std::uint16_t index = 0;
    // With IP headers.
    std::uint16_t bytes = 0;
    Piece piece() const { return {message, index}; }
  };

  explicit PacketLog(std::uint64_t first_number) : next_(first_number) {}

  // The number of the next packet.
  std::uint64_t next() const { return next_; }
  // The number of the oldest packet that is kept; next() while there is none.
  std::uint64_t oldest() const { return next_ - packets_.size(); }
  std::size_t size() const { return packets_.size(); }
  bool keeps(std::uint64_t number) const { return number >= oldest() && number < next_; }
  Packet& at(std::uint64_t number) { return packets_[number - oldest()]; }
  const Packet& at(std::uint64_t number) const { return packets_[number - oldest()]; }
  // `packet` is data-sized.
  const Data& data_of(const Packet& packet) const {
    return data_[packet.data - (next_data_ - static_cast<std::uint32_t>(data_.size()))];
  }

  // A packet leaves; it is a small one until add_data() is called for it.
  Packet& add(TimePoint now) {
    ++next_;
    packets_.push_back({.at = now});
    return packets_.back();
  }
  void add_data(Packet& packet, const Data& data) {
    packet.data_sized = true;
    packet.data = next_data_++;
    data_.push_back(data);
  }
  // Drops the oldest one.
  void drop() {
    if (packets_.front().data_sized) data_.pop_front();
    packets_.pop_front();
  }

 private:
  Ring<Packet> packets_;
  Ring<Data> data_;
  std::uint32_t next_data_ = 0;
  std::uint64_t next_ = 1;
};

// Tells what became of data-sized packets in the order in which they left: of each once, when it
// and all before it have arrived or are lost. SentPackets owns one and asks it with each report.
// Pure; thread-compatible; memory is that of the most that were told of at once.
class PassedPackets {
 public:
  // Valid until the next call.
  std::span<const link::Passage> told(const PacketLog& log);

 private:
  // All packets before this number were told of.
  std::uint64_t first_untold_ = 0;
  std::vector<link::Passage> passed_;
};

// The receiver of a train knows how far apart its packets came, but not whether a pause was the
// link's or the sender's own: this adds how fast the train left, and the longest time in which
// nothing was there to be sent. SentPackets owns one and asks it with each report, after the
// report's arrivals are noted. Follows the newest train that the peer has told of, whose packets'
// records may be gone meanwhile; each packet is looked at once. A train has no more packets than
// left since its first, whatever the peer says. Constant memory. Pure; thread-compatible.
class SentTrain {
 public:
  // The report's train; nothing when it has none, or when its packets are forgotten already.
  std::optional<link::Train> told(const PacketLog& log, const wire::LinkReport& report);

 private:
  void follow(const PacketLog& log, std::uint64_t last);

  // Its first packet: its number, when it left, and its train_bytes.
  std::uint64_t number_ = 0;
  TimePoint at_{};
  std::uint32_t from_ = 0;
  // The packets up to this one were looked at; how many of them are data-sized, and what counts
  // of the last of these.
  std::uint64_t seen_ = 0;
  std::uint32_t left_ = 1;
  TimePoint last_at_{};
  bool last_waited_ = false;
  bool last_is_probe_ = false;
  Duration pause_{};
};

}  // namespace interneuron::flow
