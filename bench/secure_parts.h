// What secure_bench is made of: the table of figures, keys that follow from numbers, and
// a vehicle that asks for a session.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/cpu_time.h"
#include "core/secure/entropy.h"
#include "core/secure/handshake.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::bench {

inline constexpr LinkId kNic{1};

// What `work` takes.
template <typename Work>
double us_of(Work&& work) {
  const double begin = thread_us();
  work();
  return thread_us() - begin;
}

inline void expect(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

// A figure for each round, in the order in which they were first told.
class Table {
 public:
  void add(const std::string& name, double value) {
    const auto it = std::ranges::find(rows_, name, &Row::name);
    Row& row = it == rows_.end() ? rows_.emplace_back(Row{name, {}}) : *it;
    row.values.push_back(value);
  }
  void print(const std::string& heading) {
    fmt::print("{:<58}{:>10}{:>10}\n", heading, "least", "median");
    for (Row& row : rows_) {
      std::ranges::sort(row.values);
      fmt::print("  {:<56}{:10.3f}{:10.3f}\n", row.name, row.values.front(),
                 row.values[row.values.size() / 2]);
    }
  }

 private:
  struct Row {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Row> rows_;
};

inline SecretKey key_of(std::uint32_t number) {
  std::array<std::byte, kKeyBytes> bytes{};
  for (std::size_t i = 0; i < sizeof(number); ++i) {
    bytes[i] = static_cast<std::byte>(number >> (8 * i));
  }
  // Zero means that there is none.
  bytes.back() = std::byte{1};
  return SecretKey(bytes);
}

inline Address address_of_host(std::uint32_t host) {
  Address a{.size = sizeof(host)};
  for (std::size_t i = 0; i < sizeof(host); ++i) a.raw[i] = static_cast<std::byte>(host >> (8 * i));
  return a;
}

inline Bytes packet(std::size_t bytes, LinkId path, std::uint64_t number) {
  Bytes out(bytes);
  wire::write_probe(out, {wire::PacketType::kProbe, path, wire::kClearEpoch, SessionId{7}, number},
                    bytes);
  return out;
}

// A vehicle that asks for a session; its keys follow from its number.
class Vehicle {
 public:
  Vehicle(std::uint32_t number, const PublicKey& road)
      : number_(number),
        initiator_(crypto::key_pair_of(key_of(number)), {road, {}}, SessionId{number}),
        entropy_(key_of(~number)) {}

  // Begins anew, and draws what a new message is made of.
  void begin(TimePoint now) {
    initiator_.stop();
    initiator_.begin(now);
    fresh_ = {entropy_.draw_index(), entropy_.draw_key(), now.time_since_epoch().count()};
  }
  void ask(TimePoint now) {
    expect(initiator_.make_message(now, fresh_), "no message was made");
    initiator_.write(LinkId{0}, initiation_);
  }
  std::optional<crypto::Initiator::Answer> take(ByteView response) {
    return initiator_.take_response(response);
  }

  wire::PacketHeader header() const { return *wire::peek(initiation_); }
  Datagram datagram() const { return {kNic, address_of_host(number_), initiation_}; }
  Bytes& initiation() { return initiation_; }

 private:
  std::uint32_t number_;
  crypto::Initiator initiator_;
  crypto::Entropy entropy_;
  crypto::Initiator::Fresh fresh_;
  Bytes initiation_ = Bytes(crypto::kInitiationBytes);
};

}  // namespace interneuron::bench
