// Reads keys of one TOML document into numbers and strings, and says precisely what is wrong: file,
// line, column, key and remedy. The first error stays: every function returns false from then on,
// so that a reader may read all its keys and ask for error() once. Profiles, scenarios and the
// configuration file are read with it. Thread-compatible; pure.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace interneuron::toml_reader {

// A key whose value is a number within [min, max], in `unit` (part of the key's name; empty for a
// pure number).
struct NumberKey {
  std::string_view name;
  // What the key means, for the message that it is missing.
  std::string_view meaning;
  double min = 0;
  double max = 0;
  std::string_view unit;
  // The key may be absent; the target then keeps its value.
  bool optional = false;
  // Fractions are refused.
  bool whole = false;
};

// "0 to 60000 ms".
std::string range_text(const NumberKey& key);
// What is wrong with a value, as " = 70000 is out of range, must be 0 to 60000 ms"; nothing when it
// is within the range.
std::optional<std::string> range_error(const NumberKey& key, double value);

// One document. `origin` names it in errors. Functions that read a key return whether the document
// is right so far; an absent optional key is right and leaves the target as it is. The text may be
// anything: toml++ parses it, and every value is checked for its type and range.
class TomlReader {
 public:
  explicit TomlReader(std::string_view origin) : origin_(origin) {}

  // A table as it is called in the file: "" is the root, "state.stable" stands under
  // [state.stable].
  struct Section {
    const toml::table* table = nullptr;
    std::string path;
  };

  // Parses the text; the result belongs to the reader. nullptr on a syntax error.
  const toml::table* parse(std::string_view text);
  // Every key of the section must be one of `known`; the error suggests the nearest.
  bool only(const Section& section, const std::vector<std::string_view>& known);
  bool number(const Section& section, const NumberKey& key, double& target);
  // A string, which must be there; the error shows `example` as a value.
  bool text(const Section& section, std::string_view key, std::string_view example,
            std::string& target);
  // A number of 64 bits, which a double cannot hold; may be absent.
  bool seed(const Section& section, std::string_view key, std::uint64_t& target);
  // [[first, second], …], optional; each number within its key's range.
  bool pairs(const Section& section, std::string_view key, const NumberKey& first,
             const NumberKey& second, std::vector<std::pair<double, double>>& target);
  bool has(const Section& section, std::string_view key) const;
  // The sub-table `name`; without a table when it is missing or is no table.
  Section section(const Section& parent, std::string_view name);
  // The tables [[name]], none if there are none.
  std::vector<Section> sections(const Section& parent, std::string_view name);

  // Reports an error about the value of `key`, or about the section when the key is absent.
  bool fail_at(const Section& section, std::string_view key, const std::string& what);

  const std::optional<std::string>& error() const { return error_; }

 private:
  bool fail(const toml::source_region& where, const std::string& what);

  std::string origin_;
  toml::table document_;
  std::optional<std::string> error_;
};

// "22", "0.0001": shortest form, for messages.
std::string number_text(double value);

// What a message may show of a user's text: ends of lines, which would make two lines of it, and
// other control characters, which a terminal would obey, become '?'.
std::string one_line(std::string text);

// The member of `known` that is most like `word`, or nothing if none is like it.
std::optional<std::string_view> nearest_word(std::string_view word,
                                             const std::vector<std::string_view>& known);

}  // namespace interneuron::toml_reader
