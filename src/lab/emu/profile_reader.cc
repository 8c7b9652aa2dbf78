#include "lab/emu/profile_reader.h"

#include <algorithm>

namespace interneuron::emu {
namespace {

constexpr std::int64_t kSchema = 1;

}  // namespace

bool read_name(TomlReader& reader, const Section& section, std::size_t longest, std::string& out) {
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

bool read_schema(TomlReader& reader, const Section& root) {
  double schema = 0;
  const NumberKey key{"schema", "version of this format", 1, 1e6, ""};
  if (!reader.number(root, key, schema)) return false;
  if (schema == static_cast<double>(kSchema)) return true;
  return reader.fail_at(root, "schema",
                        "'schema' = " + number_text(schema) +
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

bool TraceFiles::load(TomlReader& reader, const Section& section, std::string_view key,
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

}  // namespace interneuron::emu
