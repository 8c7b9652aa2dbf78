#include "lab/bench/command.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "app/process/failure.h"
#include "app/process/progress.h"
#include "app/process/signals.h"
#include "app/records/json_file.h"
#include "interneuron/policy.h"
#include "lab/bench/reports.h"
#include "lab/coding/drives.h"
#include "lab/coding/image_drives.h"

namespace interneuron::bench {
namespace {

using bench::json_of;
using bench::print_table;
using coding::DriveRow;

constexpr const char* kDrivesSchema = "interneuron.drives/1";
constexpr std::size_t kMostDrives = 10'000;
constexpr std::size_t kMostDriveMessages = 100'000;
// What a recorded modem takes one way where nothing else is said: traces tell of rates alone. About
// that of the profile generated-cellular.
constexpr Duration kRecordedOneWay = std::chrono::milliseconds(20);

struct DrivesOptions {
  std::vector<std::string> traces;
  std::vector<std::string> policies{"stripe"};
  std::size_t drives = 12;
  std::size_t messages = 1000;
  std::uint64_t seed = 1;
  // Each two traces that follow each other were recorded at the same time.
  bool in_step = false;
  bool images = false;
  // Where the drives are written instead; empty: they are run.
  std::string profiles;
  bool json = false;
};

std::shared_ptr<const emu::Opportunities> trace_of(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    throw process::Failure(process::kConfiguration,
                           file + ": cannot be read; name a trace of Mahimahi's format");
  }
  auto parsed = emu::parse_opportunities(text.str());
  if (const auto* error = std::get_if<std::string>(&parsed)) {
    throw process::Failure(process::kConfiguration, file + ": " + *error);
  }
  return std::make_shared<emu::Opportunities>(std::move(std::get<emu::Opportunities>(parsed)));
}

// Half the round trip that a trace names.
Duration one_way_of(const std::string& round_trip_ms) {
  constexpr double kMostMs = 10'000;
  double ms = 0;
  const char* const end = round_trip_ms.data() + round_trip_ms.size();
  const auto [last, error] = std::from_chars(round_trip_ms.data(), end, ms);
  if (error == std::errc{} && last == end && ms >= 0 && ms <= kMostMs) return from_ms(ms / 2);
  throw process::Failure(
      process::kUsage, fmt::format("'{}' is no round trip in ms, 0 to {}", round_trip_ms, kMostMs));
}

// "UP,DOWN,ROUND_TRIP_MS", "UP,DOWN", or one trace for both directions.
coding::Modem modem_of(const std::string& named) {
  std::vector<std::string> parts;
  std::istringstream text(named);
  for (std::string part; std::getline(text, part, ',');) parts.push_back(part);
  if (parts.empty() || parts.size() > 3) {
    throw process::Failure(process::kUsage, "'" + named + "': a modem is UP,DOWN,ROUND_TRIP_MS");
  }
  coding::Modem modem;
  modem.name = std::filesystem::path(parts[0]).filename().string();
  modem.up = trace_of(parts[0]);
  modem.down = parts.size() == 1 ? modem.up : trace_of(parts[1]);
  modem.one_way = parts.size() == 3 ? one_way_of(parts[2]) : kRecordedOneWay;
  return modem;
}

std::vector<std::string> drive_policy_names() {
  std::vector<std::string> out;
  for (const auto& policy : builtin_policies()) out.emplace_back(policy->name());
  return out;
}

bool is_judged(const DriveRow& row) {
  return static_cast<double>(row.best_alone()) >=
         coding::kJudged * static_cast<double>(row.messages);
}

records::Json json_of(const std::vector<DriveRow>& rows, std::uint64_t seed) {
  records::Json out{{"schema", kDrivesSchema}, {"seed", seed}, {"rows", records::Json::array()}};
  for (const DriveRow& row : rows) {
    records::Json policies = records::Json::array();
    for (const coding::DrivePolicy& p : row.policies) {
      policies.push_back({{"policy", p.policy},
                          {"missed", p.missed},
                          {"wire_ratio", std::round(p.wire_ratio * 10000) / 10000}});
    }
    out["rows"].push_back({{"drive", row.drive},
                           {"messages", row.messages},
                           {"message_bytes", row.message_bytes},
                           {"alone_missed", row.alone},
                           {"clairvoyant_missed", row.clairvoyant},
                           {"judged", is_judged(row)},
                           {"policies", std::move(policies)}});
  }
  return out;
}

void print_sum(const std::vector<DriveRow>& rows, std::size_t policy) {
  double missed = 0;
  double alone = 0;
  double clairvoyant = 0;
  std::size_t judged = 0;
  for (const DriveRow& row : rows) {
    if (!is_judged(row)) continue;
    ++judged;
    missed += static_cast<double>(row.policies[policy].missed);
    alone += static_cast<double>(row.best_alone());
    clairvoyant += static_cast<double>(row.clairvoyant);
  }
  if (judged == 0) return;
  fmt::print("{}: over the {} drives on which the best modem alone misses {:.0f} % or more, {:.0f}",
             rows.front().policies[policy].policy, judged, 100 * coding::kJudged, missed);
  fmt::print(" missed, {:.1f} % fewer than it", 100 - 100 * missed / alone);
  if (clairvoyant > 0) fmt::print("; {:.2f} times the clairvoyant's", missed / clairvoyant);
  fmt::print("\n");
}

void print_table(const std::vector<DriveRow>& rows) {
  std::size_t widest = 0;
  for (const DriveRow& row : rows) widest = std::max(widest, row.drive.size());
  fmt::print(
      "{} messages every {:.0f} ms, deadline {:.0f} ms; missed by each modem alone, by a "
      "clairvoyant, and by each policy over both:\n\n{:{}}{:>9}{:>8}{:>8}{:>13}",
      rows.front().messages, to_ms(coding::kDrivePeriod), to_ms(coding::kDriveDeadline), "drive",
      widest, "bytes", "first", "second", "clairvoyant");
  for (const auto& p : rows.front().policies) fmt::print("{:>16}{:>7}", p.policy, "wire");
  fmt::print("\n");
  for (const DriveRow& row : rows) {
    fmt::print("{:{}}{:>9}{:>8}{:>8}{:>13}", row.drive, widest, row.message_bytes, row.alone[0],
               row.alone[1], row.clairvoyant);
    for (const auto& p : row.policies) fmt::print("{:>16}{:>7.3f}", p.missed, p.wire_ratio);
    fmt::print("\n");
  }
  fmt::print("\n");
  for (std::size_t p = 0; p < rows.front().policies.size(); ++p) print_sum(rows, p);
}

std::vector<coding::Modem> recorded_modems(const DrivesOptions& o) {
  std::vector<coding::Modem> out;
  for (const std::string& named : o.traces) out.push_back(modem_of(named));
  return out;
}

coding::Drive drive_of(const DrivesOptions& o, const std::vector<coding::Modem>& recorded,
                       std::uint64_t seed) {
  if (recorded.empty()) return coding::generated_drive(seed);
  return o.in_step ? coding::paired_drive(recorded, seed) : coding::recorded_drive(recorded, seed);
}

// Runs and shows the drives; `run` makes the row of one.
template <class Row>
int show_drives(const DrivesOptions& o,
                const std::function<Row(const coding::Drive&, std::uint64_t)>& run) {
  const std::vector<coding::Modem> recorded = recorded_modems(o);
  std::vector<Row> rows(o.drives);
  process::Progress progress;
  progress.for_each("bench drives", o.drives, [&](std::size_t i) {
    const std::uint64_t seed = o.seed + i;
    rows[i] = run(drive_of(o, recorded, seed), seed);
  });
  if (o.json) {
    fmt::print("{}\n", json_of(rows, o.seed).dump(2));
  } else {
    print_table(rows);
  }
  return process::kFine;
}

int write_drives(const DrivesOptions& o) {
  const std::vector<coding::Modem> recorded = recorded_modems(o);
  for (std::uint64_t seed = o.seed; seed < o.seed + o.drives; ++seed) {
    process::SignalWatch::check();
    write_profiles(drive_of(o, recorded, seed), seed,
                   fmt::format("written by interneuron bench drives --seed {} {}", seed,
                               fmt::join(o.traces, " ")),
                   o.profiles);
  }
  fmt::print("{} drives written to {}; the first: demo --link {}/{}-1.toml --link {}/{}-2.toml\n",
             o.drives, o.profiles, o.profiles, o.seed, o.profiles, o.seed);
  return process::kFine;
}

int run_drives(const DrivesOptions& o) {
  if (o.in_step && (o.traces.empty() || o.traces.size() % 2 != 0)) {
    throw process::Failure(process::kUsage, "--in-step: name the modems in pairs");
  }
  const process::SignalWatch signals;
  if (!o.profiles.empty()) return write_drives(o);
  if (o.images) {
    return show_drives<coding::ImageDriveRow>(
        o, [&](const coding::Drive& drive, std::uint64_t seed) {
          return coding::run_image_drive(drive, o.messages, seed);
        });
  }
  return show_drives<DriveRow>(o, [&](const coding::Drive& drive, std::uint64_t seed) {
    return coding::run_drive(drive, o.policies, o.messages, seed);
  });
}

}  // namespace

void add_drives(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<DrivesOptions>();
  CLI::App* c = bench.add_subcommand(
      "drives", "What is missed while the rates of two modems change, in virtual time");
  c->add_option("TRACE", o->traces,
                "Rates of modems, in Mahimahi's format: FILE, or UP,DOWN, or UP,DOWN,ROUND_TRIP_MS "
                "(default: generated)");
  c->add_flag("--in-step", o->in_step,
              "Each two modems that follow each other were recorded at the same time: a drive has "
              "such a pair, both from the same instant on");
  CLI::Option* policy = c->add_option("--policy", o->policies, "Once per policy, or with commas");
  policy->delimiter(',')->take_all()->allow_extra_args(false)->capture_default_str()->check(
      CLI::IsMember(drive_policy_names()));
  c->add_option("--drives", o->drives, "How many drives, each with a seed of its own")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{1}, kMostDrives));
  c->add_option("--messages", o->messages, "How many in each drive")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{1}, kMostDriveMessages));
  c->add_option("--seed", o->seed, "Seed of the first drive")->capture_default_str();
  CLI::Option* images = c->add_flag(
      "--images", o->images,
      "Rounds of a camera instead of messages: the paper's bitmaps with down_sampling, and JPEGs "
      "with joint");
  images->excludes(policy);
  CLI::Option* json = c->add_flag(
      "--json", o->json, "The rows as JSON on stdout (docs/schema/drives.json, image_drives.json)");
  c->add_option("--profiles", o->profiles,
                "Folder to which the drives are written, as profiles of links for `demo` and "
                "`testbed`; nothing is run")
      ->excludes(images, json, policy);
  c->footer(
      "Two of the modems, which may be the same, each from a random instant of its trace on.\n"
      "Examples:\n  interneuron bench drives\n"
      "  interneuron bench drives --policy stripe,coded --drives 30 --seed 100\n"
      "  interneuron bench drives --images --messages 300\n"
      "  interneuron bench drives lte.up,lte.down other.up,other.down --json\n"
      "  interneuron bench drives --seed 2 --drives 1 --profiles out/drive && "
      "interneuron demo --link out/drive/2-1.toml --link out/drive/2-2.toml --deadline-ms 250");
  c->callback([&run, o] { run = [o] { return run_drives(*o); }; });
}

}  // namespace interneuron::bench
