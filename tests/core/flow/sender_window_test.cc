// Windows over small messages: a Sender and what its peer makes of them, over paths that lose.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <random>

#include "core/flow/reassembler.h"
#include "core/flow/windows.h"
#include "core/wire/plain_header.h"
#include "sender_support.h"

namespace interneuron::flow::sender_window_test {
namespace {

struct Setting {
  std::size_t bytes = 3000;
  Duration every = 10ms;
  Duration deadline = 60ms;
  Duration one_way = 39ms;
  double loss = 0.01;
  // Mean number of packets lost in a row, and geometric.
  double burst = 1;
  int messages = 4000;
  bool coded = true;
  bool windows = true;
  // The path that symbols may take as well; nothing: there is one path.
  std::optional<Duration> other{};
  // How much later than planned messages come, up to that.
  Duration wobble{};
  std::uint8_t importance = kUsualImportance;
};

struct Result {
  int missed = 0;
  // Packets that carry symbols: of messages, and of windows.
  int own = 0;
  int windows = 0;
  // Windows that left when they could help nothing any more.
  int useless = 0;
  int over_other = 0;
  // Bytes on the wire with IP headers for each byte of payload.
  double ratio = 0;
  std::size_t most_sources = 0;
};

class Drive {
 public:
  explicit Drive(const Setting& setting) : s_(setting) {
    sender_.set_windows(s_.windows);
    add(kA, s_.one_way);
    if (s_.other) add(kB, *s_.other);
  }

  Result operator()() {
    const TimePoint end = at(s_.every * s_.messages + 2 * s_.deadline);
    TimePoint next = at(0s);
    int sent = 0;
    for (now_ = at(0s); now_ < end; now_ += 100us) {
      if (sent < s_.messages && now_ >= next) {
        send();
        const auto wobble = static_cast<std::int64_t>(rng_() % 1000) * s_.wobble / 1000;
        next = at(s_.every * ++sent + wobble);
      }
      if (sender_.next_timeout() && *sender_.next_timeout() <= now_) sender_.handle_timeout(now_);
      for (const auto& [link, one_way] : delays_) {
        while (const auto piece = sender_.poll(now_, link)) leave(link, *piece);
      }
      arrive();
      report();
    }
    result_.missed = sent - static_cast<int>(in_time_);
    result_.ratio = static_cast<double>(bytes_) / (static_cast<double>(s_.bytes) * sent);
    return result_;
  }

 private:
  struct Packet {
    TimePoint at{};
    LinkId link{};
    std::uint64_t number = 0;
    wire::FragmentHeader fragment;
    std::optional<wire::WindowHeader> window;
    Bytes bytes;
  };
  struct Report {
    TimePoint at{};
    std::vector<wire::LinkReport> links;
    std::vector<MessageId> complete;
  };

  void add(LinkId link, Duration one_way) {
    sender_.add_path(link, kDatagram);
    PathView v = view(one_way);
    v.losses = {s_.loss, s_.burst, -1};
    sender_.set_path(link, v);
    delays_[link] = one_way;
  }
  void send() {
    wire::MessageBytes message = any_message();
    Bytes whole = joined(message);
    const MessageId id = sender_.send(
        now_,
        {.deadline = now_ + s_.deadline, .lifetime = s_.deadline, .importance = s_.importance},
        std::move(message), {kA}, kEveryPath, wire::MessageKind::kPlain,
        {.symbols = s_.coded ? kEveryPath : PathSet{}});
    deadlines_[id] = now_ + s_.deadline;
    contents_[id] = std::move(whole);
  }
  // What an application sends: a plain header, and any bytes.
  wire::MessageBytes any_message() {
    wire::PlainHeader header{.deadline_us = static_cast<std::uint32_t>(s_.deadline / 1us),
                             .t0 = PeerTime{now_.time_since_epoch()}};
    std::array<std::byte, wire::kPlainHeaderBytes> head;
    wire::write_plain_header(head, header);
    Bytes payload(s_.bytes - head.size());
    for (std::byte& b : payload) b = static_cast<std::byte>(content_rng_());
    return {head, std::move(payload)};
  }
  static Bytes joined(const wire::MessageBytes& message) {
    Bytes out(message.header.begin(), message.header.end());
    out.insert(out.end(), message.payload.begin(), message.payload.end());
    return out;
  }
  void leave(LinkId link, const Sender::Piece& piece) {
    Packet p{now_ + delays_[link], link, piece.number, piece.fragment, std::nullopt, {}};
    p.bytes.assign(piece.bytes.header.begin(), piece.bytes.header.end());
    p.bytes.insert(p.bytes.end(), piece.bytes.payload.begin(), piece.bytes.payload.end());
    std::size_t size = kPieceOverheadBytes + p.bytes.size();
    if (piece.window != nullptr) {
      p.window = *piece.window;
      ++result_.windows;
      result_.over_other += link == kB ? 1 : 0;
      size = wire::kPacketOverhead + wire::window_header_bytes(p.window->messages.size()) +
             p.bytes.size();
      EXPECT_LE(size, kDatagram);
      note_use(p);
    } else if (piece.fragment.is_repair()) {
      ++result_.own;
    }
    bytes_ += size + kIpUdpBytes;
    if (is_lost()) return;
    const auto later = [](const Packet& a, const Packet& b) { return a.at < b.at; };
    air_.insert(std::upper_bound(air_.begin(), air_.end(), p, later), std::move(p));
  }
  // Gilbert's model.
  bool is_lost() {
    const double u = std::uniform_real_distribution<double>(0, 1)(rng_);
    if (s_.burst <= 1) return u < s_.loss;
    bad_ = bad_ ? u >= 1 / s_.burst : u < s_.loss / s_.burst / (1 - s_.loss);
    return bad_;
  }
  void note_use(const Packet& p) {
    result_.most_sources = std::max(result_.most_sources, p.window->sources());
    const bool helps = std::ranges::any_of(
        p.window->messages, [&](const auto& c) { return deadlines_.at(c.message) >= p.at; });
    result_.useless += helps ? 0 : 1;
  }
  void arrive() {
    while (!air_.empty() && air_.front().at <= now_) {
      const Packet p = std::move(air_.front());
      air_.pop_front();
      auto& numbers = arrived_[p.link];
      numbers.insert(p.number);
      if (numbers.size() > 300) numbers.erase(numbers.begin());
      if (!report_at_) report_at_ = now_ + 5ms;
      if (p.window) {
        windows_.symbol(now_, {*p.window, p.bytes});
      } else {
        take({p.fragment, p.bytes});
        windows_.piece({p.fragment, p.bytes});
      }
      while (const auto data = windows_.poll()) take(*data);
    }
    reassembler_.expire(now_);
  }
  void take(const wire::Data& data) {
    const auto outcome = reassembler_.add(now_, data, {});
    if (outcome.result != Reassembler::Result::kComplete) return;
    const MessageId id = data.fragment.message;
    const auto sent = contents_.find(id);
    ASSERT_NE(sent, contents_.end());
    EXPECT_TRUE(joined(outcome.message) == sent->second) << id.value;
    contents_.erase(sent);
    complete_.push_back(id);
    if (now_ <= deadlines_.at(id)) ++in_time_;
  }
  void report() {
    if (report_at_ && *report_at_ <= now_) {
      Report out{now_ + s_.one_way, {}, std::move(complete_)};
      for (const auto& [link, numbers] : arrived_) out.links.push_back(report_of(link, numbers));
      reports_.push_back(std::move(out));
      complete_.clear();
      report_at_.reset();
    }
    while (!reports_.empty() && reports_.front().at <= now_) {
      for (const MessageId id : reports_.front().complete) sender_.complete(now_, id);
      for (const auto& link : reports_.front().links) sender_.report(now_, link, 2 * s_.one_way);
      reports_.pop_front();
    }
  }

  Setting s_;
  Sender sender_{{.repair = true}};
  Reassembler reassembler_;
  WindowReceiver windows_;
  std::mt19937_64 rng_{11};
  std::mt19937 content_rng_{12};
  bool bad_ = false;
  TimePoint now_{};
  std::map<LinkId, Duration> delays_;
  std::map<MessageId, TimePoint> deadlines_;
  // What messages are made of that are not complete yet.
  std::map<MessageId, Bytes> contents_;
  std::map<LinkId, std::set<std::uint64_t>> arrived_;
  std::deque<Packet> air_;
  std::deque<Report> reports_;
  std::vector<MessageId> complete_;
  std::optional<TimePoint> report_at_;
  std::size_t bytes_ = 0;
  std::size_t in_time_ = 0;
  Result result_;
};

// How `setting` fares without symbols, with symbols of each message, and with windows.
struct Three {
  Result none, own, windows;
  explicit Three(Setting s) {
    windows = Drive(s)();
    s.windows = false;
    own = Drive(s)();
    s.coded = false;
    none = Drive(s)();
  }
  void show(const char* what) const {
    for (const auto& [name, r] : {std::pair{"none", none}, {"own", own}, {"windows", windows}}) {
      std::printf("%-22s %-8s missed %4d  ratio %.3f  own %5d  windows %5d (most %zu pieces)\n",
                  what, name, r.missed, r.ratio, r.own, r.windows, r.most_sources);
    }
  }
};

TEST(SenderWindow, OneSymbolForSomeMessagesReplacesOneForEach) {
  const Three r({});
  r.show("3 kB at 100 Hz");
  EXPECT_GE(r.none.missed, 80);
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
  EXPECT_LE(r.windows.ratio, 1.25);
  EXPECT_LE(r.windows.ratio, 1.25 * r.none.ratio);
  EXPECT_LT(r.windows.ratio, r.own.ratio - 0.1);
  EXPECT_EQ(r.windows.useless, 0);
  // At most those before the interval is known.
  EXPECT_LE(r.windows.own, 3);
}

TEST(SenderWindow, TheMoreTimeThereIsTheMoreMessagesOneCovers) {
  const Three r({.deadline = 82ms});
  r.show("3 kB, 82 ms");
  // Two for five messages are worth their bytes, where one for three was before.
  EXPECT_LE(r.windows.missed, r.none.missed / 20);
  EXPECT_LE(r.windows.ratio, 1.25);
  EXPECT_EQ(r.windows.most_sources, 15U);
}

TEST(SenderWindow, OnePieceEach) {
  const Three r({.bytes = 600, .every = 5ms, .messages = 8000});
  r.show("600 B at 200 Hz");
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
  EXPECT_LE(r.windows.ratio, 1.25 * r.none.ratio + 0.1);
}

TEST(SenderWindow, RareMessagesHaveSymbolsOfTheirOwn) {
  const Three r({.every = 200ms, .messages = 300});
  r.show("3 kB at 5 Hz");
  EXPECT_EQ(r.windows.windows, 0);
  EXPECT_EQ(r.windows.own, r.own.own);
  EXPECT_NEAR(r.windows.ratio, r.own.ratio, 0.15);
}

// Two blocks, in each of which a piece lies in the header or is shorter than the others.
TEST(SenderWindow, LargeMessagesHaveSymbolsOfTheirOwn) {
  const Three r({.bytes = 400'000, .every = 100ms, .deadline = 105ms, .messages = 40});
  r.show("400 kB at 10 Hz");
  EXPECT_EQ(r.windows.windows, 0);
  EXPECT_GT(r.windows.own, 40);
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
}

TEST(SenderWindow, NothingWhereThereIsTimeToAskAgain) {
  const Three r({.deadline = 200ms, .messages = 2000});
  EXPECT_EQ(r.windows.windows, 0);
  // Only what was sent again could not be asked for once more.
  EXPECT_LE(r.windows.own, 100);
  EXPECT_LE(r.windows.missed, 1);
}

TEST(SenderWindow, NothingWithoutLossOrWhereNobodyUnderstands) {
  EXPECT_EQ(Drive({.loss = 0, .messages = 300})().windows, 0);
  const Result old = Drive({.messages = 300, .windows = false})();
  EXPECT_EQ(old.windows, 0);
  EXPECT_GT(old.own, 0);
}

TEST(SenderWindow, IrregularMessagesAreCoveredInTime) {
  const Three r({.wobble = 9ms});
  r.show("3 kB, irregular");
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
  EXPECT_EQ(r.windows.useless, 0);
}

TEST(SenderWindow, WhatMattersLittleGetsNone) {
  const Result little = Drive({.messages = 300, .importance = 0})();
  EXPECT_EQ(little.windows, 0);
}

TEST(SenderWindow, SymbolsPreferThePathThatMessagesDoNotTake) {
  const Result r = Drive({.messages = 500, .other = 30ms})();
  EXPECT_GT(r.windows, 0);
  EXPECT_EQ(r.over_other, r.windows);
  // It would be too late.
  const Result far = Drive({.messages = 500, .other = 70ms})();
  EXPECT_GT(far.windows, 0);
  EXPECT_EQ(far.over_other, 0);
}

TEST(SenderWindow, BurstsOfLosses) {
  const Three r({.burst = 2, .messages = 8000});
  r.show("3 kB, bursts of 2");
  EXPECT_LE(r.windows.missed, r.own.missed * 5 / 4);
  EXPECT_LT(r.windows.ratio, r.own.ratio);
  EXPECT_LE(r.windows.missed, r.none.missed / 2);
}

// Pieces that fill their packets would leave no room for the fields of a symbol.
TEST(SenderWindow, SizesThatFillAllPacketsAreCoveredToo) {
  const Three r({.bytes = 2 * kChunk});
  r.show("two full packets");
  EXPECT_GT(r.windows.windows, 1000);
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
}

TEST(SenderWindow, MoreLossMoreSymbols) {
  const Three r({.loss = 0.05});
  r.show("3 kB, 5 % loss");
  EXPECT_LE(r.windows.missed, r.none.missed / 5);
}

}  // namespace
}  // namespace interneuron::flow::sender_window_test
