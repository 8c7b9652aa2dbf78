#include "lab/emu/profile.h"

#include <algorithm>
#include <exception>

#include "lab/emu/profile_reader.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

namespace {

constexpr std::size_t kLongestName = 64;
constexpr std::size_t kAmpleQueueBytes = 10'000'000;

bool read_profile(TomlReader& reader, std::string_view text, const TraceFiles& files,
                  LinkProfile& out) {
  const Section root{reader.parse(text), ""};
  // The keys of all models first, so that a slip in 'model' itself is named as such.
  return reader.only(root, delay_keys()) && read_schema(reader, root) &&
         read_delay(reader, root, files, out.delay) &&
         read_name(reader, root, kLongestName, out.name) &&
         reader.text(root, "description", "5G while driving", out.description) &&
         read_direction(reader, reader.section(root, "up"), files, out.up) &&
         read_direction(reader, reader.section(root, "down"), files, out.down) &&
         read_outages(reader, root, out.outages) && read_nat(reader, root, out.nat);
}

}  // namespace

LinkProfile constant_link(std::string name, double rtt_ms, double up_mbit, double down_mbit,
                          double loss) {
  LinkProfile out;
  out.name = std::move(name);
  out.delay = constant_delay(rtt_ms, loss);
  out.up.rate = DataRate::mbit(up_mbit);
  out.down.rate = DataRate::mbit(down_mbit);
  out.up.queue_bytes = out.down.queue_bytes = kAmpleQueueBytes;
  return out;
}

std::variant<LinkProfile, ProfileError> parse_profile(std::string_view toml_text,
                                                      std::string_view origin,
                                                      const FileLoader& loader) {
  try {
    TomlReader reader(origin);
    LinkProfile profile;
    profile.source = source_of(toml_text);
    if (read_profile(reader, toml_text, TraceFiles(loader), profile)) return profile;
    return ProfileError{reader.error().value_or(std::string(origin) + ": cannot be read")};
  } catch (const std::exception& error) {
    // toml++ is out of memory, or the loader has thrown.
    return ProfileError{std::string(origin) + ": cannot be read: " + error.what()};
  }
}

std::optional<LinkProfile> built_in_profile(std::string_view name) {
  for (const BuiltInProfile& candidate : built_in_profiles()) {
    if (candidate.name != name) continue;
    auto parsed = parse_profile(candidate.text, candidate.origin);
    if (auto* profile = std::get_if<LinkProfile>(&parsed)) return std::move(*profile);
  }
  return std::nullopt;
}

ProfileResolver built_in_resolver() {
  return [](const std::string& name) -> std::variant<LinkProfile, ProfileError> {
    if (auto profile = built_in_profile(name)) return std::move(*profile);
    std::vector<std::string_view> known;
    std::string list;
    for (const BuiltInProfile& candidate : built_in_profiles()) {
      known.push_back(candidate.name);
      list += (list.empty() ? "" : ", ") + std::string(candidate.name);
    }
    const auto nearest = nearest_word(name, known);
    return ProfileError{
        "no profile '" + name + "'; " +
        (nearest ? "did you mean '" + std::string(*nearest) + "'?" : "there are " + list)};
  };
}

std::uint64_t link_seed(std::uint64_t testbed_seed, std::size_t link_index) {
  return split_mix(split_mix(testbed_seed) + link_index);
}

}  // namespace interneuron::emu
