// The parts of the parsers of profiles, changes and scenarios, and what these have in common.
// Private to src/lab/emu; pure. Each part returns false when the reader has an error.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/toml/toml_reader.h"
#include "lab/emu/link_change.h"
#include "lab/emu/profile.h"

namespace interneuron::emu {

using toml_reader::nearest_word;
using toml_reader::number_text;
using toml_reader::NumberKey;
using toml_reader::TomlReader;
using Section = TomlReader::Section;

// Keys that profiles, changes and scenarios share: names, meanings and ranges, once. Ranges are
// wide: they are to catch typing errors and wrong units, not unlikely networks. A round trip is a
// minute at most, a length of time a day, an instant 116 days from the start, and a queue holds one
// Ethernet packet at least. A radio sleeps after an hour at most and wakes up within the time for
// which a packet may wait (LinkModel::kLongestWait).
inline constexpr double kMaxRttMs = 60'000;
inline constexpr double kMaxSeconds = 86'400;
inline constexpr double kMaxInstantS = 1e7;
inline constexpr double kMinQueueKbyte = 1.5;
inline constexpr double kMinRateMbit = 0.001;
inline constexpr double kMaxRateMbit = 100'000;
inline constexpr double kMaxGrantMs = 1000;
// Grants that are closer than this in microseconds count as none: such a radio sends at any time.
inline constexpr double kLeastGrantUs = 10;
inline constexpr double kMaxSleepMs = 3'600'000;
inline constexpr double kMaxWakeMs = 9000;

inline constexpr NumberKey kRttKey{"rtt_ms", "round-trip time", 0, kMaxRttMs, "ms"};
inline constexpr NumberKey kLossKey{"loss", "probability that a packet is lost", 0, 1, ""};
inline constexpr NumberKey kRateKey{"rate_mbit", "rate of IP packets", kMinRateMbit, kMaxRateMbit,
                                    "Mbit/s"};

inline Duration seconds(double s) { return from_ms(s * 1e3); }

// A key of [up] and [down], and of changes. All are optional.
struct DirectionKey {
  NumberKey key;
  void (*set)(DirectionChange& change, double value);
};
std::span<const DirectionKey> direction_keys();

// Finds the trace files that a profile names.
class TraceFiles {
 public:
  explicit TraceFiles(const FileLoader& loader) : loader_(loader) {}

  // Reads the file that `key` names and hands its text to `parse`, which returns a trace or
  // "line N: what is wrong".
  template <class Trace>
  bool read(TomlReader& reader, const Section& section, std::string_view key,
            std::variant<Trace, std::string> (*parse)(std::string_view),
            std::shared_ptr<const Trace>& out) const {
    std::string name;
    std::string text;
    if (!load(reader, section, key, name, text)) return false;
    auto parsed = parse(text);
    if (const auto* wrong = std::get_if<std::string>(&parsed)) {
      return reader.fail_at(section, key, "trace \"" + name + "\": " + *wrong);
    }
    out = std::make_shared<const Trace>(std::get<Trace>(std::move(parsed)));
    return true;
  }

 private:
  bool load(TomlReader& reader, const Section& section, std::string_view key, std::string& name,
            std::string& text) const;

  const FileLoader& loader_;
};

// All keys of the root that some model has.
std::vector<std::string_view> delay_keys();

bool read_delay(TomlReader& reader, const Section& root, const TraceFiles& files, DelayParams& out);
bool read_direction(TomlReader& reader, const Section& section, const TraceFiles& files,
                    DirectionParams& out);
bool read_outages(TomlReader& reader, const Section& root, PeriodicOutage& out);
bool read_nat(TomlReader& reader, const Section& root, NatParams& out);

// "schema", the same in all files of this kind; and "Paper, table 1" of line 1's "# Source: Paper,
// table 1".
bool read_schema(TomlReader& reader, const Section& root);
std::string source_of(std::string_view text);
// A name of 1 to `longest` characters of A-Z a-z 0-9 _ -.
bool read_name(TomlReader& reader, const Section& section, std::size_t longest, std::string& out);

// Reads the keys of a change from `section`, in which the keys `others` may stand as well.
bool read_change(TomlReader& reader, const Section& section,
                 const std::vector<std::string_view>& others, const ProfileResolver& resolver,
                 LinkChange& out);

}  // namespace interneuron::emu
