// Drives with two modems whose rates change from one millisecond to the next, as traces of
// Mahimahi's format say: what each modem alone, a clairvoyant and policies over both miss.
//
// The messages load half the mean rate of the slower modem. The clairvoyant sends each message over
// whichever modem brings it in time, knows all rates beforehand, loses nothing and is never in its
// own way; so nobody who sends a message over one modem misses fewer. Dividing messages may. Pure
// functions; the same arguments give the same rows. Errors: std::invalid_argument for a policy that
// there is not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/bottleneck.h"
#include "lab/emu/profile.h"

namespace interneuron::coding {

struct Modem {
  // For people: the name of its trace.
  std::string name;
  std::shared_ptr<const emu::Opportunities> up;
  std::shared_ptr<const emu::Opportunities> down;
  Duration one_way{};
};

struct Drive {
  std::string name;
  std::vector<Modem> modems;
};

// A trace that begins at `from` of this one, which repeats.
emu::Opportunities rotated(const emu::Opportunities& trace, std::int64_t from_ms);

// Two modems whose rates are modelled as scripts/generate_rates.py does, with other means for each
// seed.
Drive generated_drive(std::uint64_t seed);
// Two of these modems, which may be the same, each from an instant of its trace on that the seed
// chooses. There is at least one.
Drive recorded_drive(std::span<const Modem> modems, std::uint64_t seed);
// One of these pairs (the first and the second modem, the third and the fourth, …) that were
// recorded at the same time: both from one instant of their traces on, which the seed chooses.
// There is at least one pair.
Drive paired_drive(std::span<const Modem> modems, std::uint64_t seed);

// The modem as a link.
emu::LinkProfile profile_of(const Modem& modem);
// When the last byte of a message that is handed over at `at`, since the begin of the drive, leaves
// a modem with this rate that carries nothing else.
Duration brought(const emu::Bottleneck& empty, Duration at, std::size_t bytes);

struct DrivePolicy {
  std::string policy;
  std::size_t missed = 0;
  // As Row::wire_ratio.
  double wire_ratio = 0;
};
struct DriveRow {
  std::string drive;
  std::size_t messages = 0;
  std::size_t message_bytes = 0;
  // What each modem alone misses, with best_link.
  std::vector<std::size_t> alone;
  std::size_t clairvoyant = 0;
  std::vector<DrivePolicy> policies;

  std::size_t best_alone() const;
};

inline constexpr Duration kDriveDeadline = std::chrono::milliseconds(150);
inline constexpr Duration kDrivePeriod = std::chrono::milliseconds(100);
// A drive is judged where the best modem alone misses at least this share: elsewhere a second one
// has nothing to do.
inline constexpr double kJudged = 0.05;

DriveRow run_drive(const Drive& drive, std::span<const std::string> policies, std::size_t messages,
                   std::uint64_t seed);

}  // namespace interneuron::coding
