#include "lab/emu/profile.h"

#include <algorithm>
#include <exception>
#include <string>

#include "lab/emu/profile_reader.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

namespace {

using Section = toml_reader::TomlReader::Section;

constexpr std::int64_t kSchema = 1;
constexpr std::size_t kLongestName = 64;
constexpr std::size_t kAmpleQueueBytes = 10'000'000;

bool read_profile(toml_reader::TomlReader& reader, std::string_view text, const TraceFiles& files,
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

bool read_name(toml_reader::TomlReader& reader, const Section& section, std::size_t longest,
               std::string& out) {
  if (!reader.text(section, "name", "5g", out)) return false;
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  if (!out.empty() && out.size() <= longest && std::all_of(out.begin(), out.end(), allowed)) {
    return true;
  }
  return reader.fail_at(section, "name",
                        "'name' = \"" + out + "\" must have 1 to " + std::to_string(longest) +
                            " characters of A-Z a-z 0-9 _ -");
}

bool read_schema(toml_reader::TomlReader& reader, const Section& root) {
  double schema = 0;
  const toml_reader::NumberKey key{"schema", "version of this format", 1, 1e6, ""};
  if (!reader.number(root, key, schema)) return false;
  if (schema == static_cast<double>(kSchema)) return true;
  return reader.fail_at(root, "schema",
                        "'schema' = " + toml_reader::number_text(schema) +
                            " is not known here; this program reads schema " +
                            std::to_string(kSchema));
}

std::string source_of(std::string_view text) {
  std::string_view line = text.substr(0, text.find('\n'));
  if (line.empty() || line[0] != '#') return "";
  const std::size_t start = line.find_first_not_of("# \t");
  if (start == std::string_view::npos) return "";
  line.remove_prefix(start);
  constexpr std::string_view kPrefix = "Source: ";
  if (line.substr(0, kPrefix.size()) == kPrefix) line.remove_prefix(kPrefix.size());
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  return std::string(line);
}

bool TraceFiles::load(toml_reader::TomlReader& reader, const Section& section, std::string_view key,
                      std::string& name, std::string& text) const {
  if (!reader.text(section, key, "traces/drive.rtt", name)) return false;
  std::string reason = "there is no such built-in trace";
  if (loader_) {
    auto loaded = loader_(name);
    if (auto* read = std::get_if<std::string>(&loaded)) {
      text = std::move(*read);
      return true;
    }
    reason = std::get<FileError>(loaded).reason;
  }
  for (const BuiltInTrace& trace : built_in_traces()) {
    if (trace.name != name) continue;
    text = trace.text;
    return true;
  }
  return reader.fail_at(section, key,
                        "trace \"" + name + "\" cannot be read: " + reason +
                            "; name it relative to this profile's folder");
}

std::variant<LinkProfile, ProfileError> parse_profile(std::string_view toml_text,
                                                      std::string_view origin,
                                                      const FileLoader& loader) {
  try {
    toml_reader::TomlReader reader(origin);
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
    const auto nearest = toml_reader::nearest_word(name, known);
    return ProfileError{
        "no profile '" + name + "'; " +
        (nearest ? "did you mean '" + std::string(*nearest) + "'?" : "there are " + list)};
  };
}

std::uint64_t link_seed(std::uint64_t testbed_seed, std::size_t link_index) {
  return split_mix(split_mix(testbed_seed) + link_index);
}

}  // namespace interneuron::emu
