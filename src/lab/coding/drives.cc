#include "lab/coding/drives.h"

#include <algorithm>
#include <cmath>

#include "interneuron/sizes.h"
#include "lab/emu/random.h"
#include "lab/sim/duo.h"

namespace interneuron::coding {
namespace {

// The queue of a modem, at its mean rate: as that of profiles that name none.
constexpr Duration kQueue = emu::kDefaultQueueTime;
// Generated traces are so long and repeat.
constexpr std::int64_t kLengthMs = 120'000;
// The means of generated modems: the faster one's, and the part of it that the slower one has at
// least, Mbit/s. No measurement behind these values: they only have to lie in the range of LTE and
// 5G while driving.
constexpr double kLeastMean = 5;
constexpr double kMostMean = 45;
constexpr double kLeastPart = 0.3;
// Down is twice as fast as up, as in the profile generated-cellular.
constexpr double kDownPart = 2;
// One way, ms.
constexpr double kLeastOneWay = 15;
constexpr double kMostOneWay = 40;
// What is modelled, and where the figures come from: scripts/generate_rates.py.
constexpr double kShadowDeviation = 0.5;
constexpr double kShadowTau = 5'000;
constexpr double kFadeTau = 40;
constexpr double kFadeFloor = 0.2;
constexpr double kHandoverGap = 20'000;
constexpr double kLeastHandover = 40;
constexpr double kMostHandover = 300;

double between(emu::RandomStream& random, double least, double most) {
  return least + (most - least) * random.uniform();
}

// Box and Muller (1958).
double normal(emu::RandomStream& random) {
  const double radius = std::sqrt(random.exponential(2));
  return radius * std::cos(2 * M_PI * random.uniform());
}

// A stationary normal process of unit variance, one value a millisecond.
class Correlated {
 public:
  Correlated(double tau_ms, emu::RandomStream& random)
      : keep_(std::exp(-1 / tau_ms)), random_(random), value_(normal(random)) {}
  double next() {
    const double value = value_;
    value_ = keep_ * value_ + std::sqrt(1 - keep_ * keep_) * normal(random_);
    return value;
  }

 private:
  double keep_;
  emu::RandomStream& random_;
  double value_;
};

// The rate in each millisecond, in any unit.
std::vector<double> rates(emu::RandomStream& random) {
  Correlated shadow(kShadowTau, random);
  Correlated real(kFadeTau, random);
  Correlated imaginary(kFadeTau, random);
  double handover_at = random.exponential(kHandoverGap);
  double handover_until = -1;
  std::vector<double> out;
  for (std::int64_t ms = 0; ms < kLengthMs; ++ms) {
    const auto at = static_cast<double>(ms);
    if (at >= handover_at) {
      handover_until = at + between(random, kLeastHandover, kMostHandover);
      handover_at = handover_until + random.exponential(kHandoverGap);
    }
    const double re = real.next();
    const double im = imaginary.next();
    const double fading = kFadeFloor + (1 - kFadeFloor) * (re * re + im * im) / 2;
    const double rate = std::exp(kShadowDeviation * shadow.next()) * fading;
    out.push_back(at < handover_until ? 0 : rate);
  }
  return out;
}

std::shared_ptr<const emu::Opportunities> generated(double mean_mbit, std::uint64_t seed) {
  emu::RandomStream random(seed);
  const std::vector<double> all = rates(random);
  double sum = 0;
  for (const double rate : all) sum += rate;
  // Opportunities a millisecond.
  const double scale = mean_mbit * 1000 * static_cast<double>(kLengthMs) / sum /
                       (8 * static_cast<double>(emu::kOpportunityBytes));
  auto trace = std::make_shared<emu::Opportunities>();
  double credit = 0;
  for (std::int64_t ms = 0; ms < kLengthMs; ++ms) {
    for (credit += all[static_cast<std::size_t>(ms)] * scale; credit >= 1; --credit) {
      trace->at_ms.push_back(ms + 1);
    }
  }
  trace->at_ms.push_back(kLengthMs);
  return trace;
}

Modem generated_modem(std::string name, double mean_mbit, emu::RandomStream& random) {
  const std::uint64_t up = random.next();
  const std::uint64_t down = random.next();
  const double one_way = between(random, kLeastOneWay, kMostOneWay);
  return {std::move(name), generated(mean_mbit, up), generated(kDownPart * mean_mbit, down),
          std::chrono::duration_cast<Duration>(std::chrono::duration<double, std::milli>(one_way))};
}

emu::DirectionParams direction_of(const std::shared_ptr<const emu::Opportunities>& trace) {
  emu::DirectionParams out{.rate = emu::mean_rate(*trace), .trace = trace};
  out.queue_bytes = static_cast<std::size_t>(static_cast<double>(out.rate.bits_per_second) / 8 *
                                             to_seconds(kQueue));
  return out;
}

std::size_t clairvoyant(const Drive& drive, std::size_t bytes, std::size_t messages) {
  std::size_t missed = 0;
  std::vector<emu::Bottleneck> empty;
  for (const Modem& modem : drive.modems) empty.emplace_back(emu::RateTrace{modem.up});
  for (std::size_t i = 0; i < messages; ++i) {
    const Duration at = sim::Duo::kBegin + static_cast<std::int64_t>(i) * kDrivePeriod;
    bool in_time = false;
    for (std::size_t m = 0; m < empty.size() && !in_time; ++m) {
      in_time = brought(empty[m], at, bytes) + drive.modems[m].one_way <= at + kDriveDeadline;
    }
    if (!in_time) ++missed;
  }
  return missed;
}

}  // namespace

emu::LinkProfile profile_of(const Modem& modem) {
  emu::LinkProfile p;
  p.name = modem.name;
  p.delay = emu::constant_delay(2 * to_ms(modem.one_way), 0);
  p.up = direction_of(modem.up);
  p.down = direction_of(modem.down);
  return p;
}

Duration brought(const emu::Bottleneck& empty, Duration at, std::size_t bytes) {
  emu::Bottleneck modem = empty;
  Duration last{};
  while (bytes > 0) {
    const std::size_t piece = std::min(bytes, kMaxPieceBytes);
    last = modem.departure(at, piece + kPieceOverheadBytes + kIpUdpBytes);
    modem.send();
    bytes -= piece;
  }
  return last;
}

namespace {

std::string name_of(const Drive& drive, std::uint64_t seed) {
  return drive.modems[0].name + " + " + drive.modems[1].name + " " + std::to_string(seed);
}

// The modem from this instant of its traces on.
Modem begun_at(Modem modem, std::int64_t from_ms) {
  modem.up = std::make_shared<emu::Opportunities>(rotated(*modem.up, from_ms));
  modem.down = std::make_shared<emu::Opportunities>(rotated(*modem.down, from_ms));
  return modem;
}

}  // namespace

emu::Opportunities rotated(const emu::Opportunities& trace, std::int64_t from_ms) {
  const std::int64_t length = trace.at_ms.back();
  const std::int64_t from = from_ms % length;
  const auto first = std::ranges::upper_bound(trace.at_ms, from);
  emu::Opportunities out;
  for (auto it = first; it != trace.at_ms.end(); ++it) out.at_ms.push_back(*it - from);
  for (auto it = trace.at_ms.begin(); it != first; ++it) out.at_ms.push_back(*it + length - from);
  return out;
}

Drive generated_drive(std::uint64_t seed) {
  emu::RandomStream random(seed);
  const double fast = between(random, kLeastMean, kMostMean);
  const double slow = fast * between(random, kLeastPart, 1);
  Drive drive{"generated " + std::to_string(seed), {}};
  drive.modems.push_back(generated_modem("generated-a", fast, random));
  drive.modems.push_back(generated_modem("generated-b", slow, random));
  return drive;
}

Drive recorded_drive(std::span<const Modem> modems, std::uint64_t seed) {
  emu::RandomStream random(seed);
  Drive drive;
  for (std::size_t i = 0; i < 2; ++i) {
    const Modem& modem = modems[random.next() % modems.size()];
    drive.modems.push_back(begun_at(modem, static_cast<std::int64_t>(random.next() >> 1U)));
  }
  drive.name = name_of(drive, seed);
  return drive;
}

Drive paired_drive(std::span<const Modem> modems, std::uint64_t seed) {
  emu::RandomStream random(seed);
  const std::size_t first = random.next() % (modems.size() / 2) * 2;
  const auto from = static_cast<std::int64_t>(random.next() >> 1U);
  Drive drive;
  drive.modems = {begun_at(modems[first], from), begun_at(modems[first + 1], from)};
  drive.name = name_of(drive, seed);
  return drive;
}

std::size_t DriveRow::best_alone() const { return *std::ranges::min_element(alone); }

DriveRow run_drive(const Drive& drive, std::span<const std::string> policies, std::size_t messages,
                   std::uint64_t seed) {
  std::vector<emu::LinkProfile> links;
  DataRate slower{INT64_MAX};
  for (const Modem& modem : drive.modems) {
    links.push_back(profile_of(modem));
    slower = std::min(slower, links.back().up.rate);
  }
  const double period = to_seconds(kDrivePeriod);
  DriveRow row;
  row.drive = drive.name;
  row.messages = messages;
  row.message_bytes =
      static_cast<std::size_t>(static_cast<double>(slower.bits_per_second) / 8 / 2 * period);
  const auto sending = [&](const std::vector<emu::LinkProfile>& over, const std::string& policy) {
    sim::Duo out(over, {.policy = policy,
                        .variants = {row.message_bytes},
                        .deadline = kDriveDeadline,
                        .period = kDrivePeriod,
                        .seed = seed});
    out.send(sim::Duo::kBegin, messages);
    const std::uint64_t bytes = out.run_counting();
    return std::pair(out.missed(), bytes);
  };
  for (const emu::LinkProfile& link : links) {
    row.alone.push_back(sending({link}, "best_link").first);
  }
  row.clairvoyant = clairvoyant(drive, row.message_bytes, messages);
  for (const std::string& policy : policies) {
    const auto [missed, bytes] = sending(links, policy);
    row.policies.push_back(
        {policy, missed,
         static_cast<double>(bytes) / static_cast<double>(messages * row.message_bytes)});
  }
  return row;
}

}  // namespace interneuron::coding
