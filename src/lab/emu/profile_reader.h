// The parts of a profile's parser. Private to src/lab/emu; pure. Each returns false when the reader
// has an error.
#pragma once

#include <string>
#include <string_view>

#include "app/toml/toml_reader.h"
#include "lab/emu/profile.h"

namespace interneuron::emu {

// Finds the trace files that a profile names.
class TraceFiles {
 public:
  explicit TraceFiles(const FileLoader& loader) : loader_(loader) {}

  // Reads the file that `key` names and hands its text to `parse`, which returns a trace or
  // "line N: what is wrong".
  template <class Trace>
  bool read(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& section,
            std::string_view key, std::variant<Trace, std::string> (*parse)(std::string_view),
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
  bool load(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& section,
            std::string_view key, std::string& name, std::string& text) const;

  const FileLoader& loader_;
};

// All keys of the root that some model has.
std::vector<std::string_view> delay_keys();

bool read_delay(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& root,
                const TraceFiles& files, DelayParams& out);
bool read_direction(toml_reader::TomlReader& reader,
                    const toml_reader::TomlReader::Section& section, const TraceFiles& files,
                    DirectionParams& out);
bool read_outages(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& root,
                  PeriodicOutage& out);
bool read_nat(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& root,
              NatParams& out);

// "schema", the same in all files of this kind; and "Paper, table 1" of line 1's "# Source: Paper,
// table 1".
bool read_schema(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& root);
std::string source_of(std::string_view text);
// A name of 1 to `longest` characters of A-Z a-z 0-9 _ -.
bool read_name(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& section,
               std::size_t longest, std::string& out);

}  // namespace interneuron::emu
