#include "app/toml/toml_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <sstream>

namespace interneuron::toml_reader {

namespace {

// Levenshtein distance: insertions, deletions and substitutions.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({substituted, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

std::string quoted(std::string_view word) { return "'" + std::string(word) + "'"; }

std::string in_section(const std::string& path) { return path.empty() ? "" : " in [" + path + "]"; }

std::string list_of(const std::vector<std::string_view>& words) {
  std::string out;
  for (const std::string_view word : words) {
    if (!out.empty()) out += ", ";
    out += word;
  }
  return out;
}

std::string type_name(const toml::node& node) {
  std::ostringstream out;
  out << node.type();
  return out.str();
}

}  // namespace

std::string number_text(double value) {
  if (std::trunc(value) == value && std::abs(value) < 1e15) {
    return std::to_string(static_cast<std::int64_t>(value));
  }
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, result.ptr};
}

std::string range_text(const NumberKey& key) {
  std::string out = number_text(key.min) + " to " + number_text(key.max);
  if (!key.unit.empty()) out += " " + std::string(key.unit);
  return out;
}

std::optional<std::string> range_error(const NumberKey& key, double value) {
  if (!std::isfinite(value) || value < key.min || value > key.max) {
    return " = " + number_text(value) + " is out of range, must be " + range_text(key);
  }
  if (key.whole && std::trunc(value) != value) {
    return " = " + number_text(value) + " must be a whole number, " + range_text(key);
  }
  return std::nullopt;
}

std::optional<std::string_view> nearest_word(std::string_view word,
                                             const std::vector<std::string_view>& known) {
  std::optional<std::string_view> best;
  std::size_t best_distance = 0;
  bool best_beginning = false;
  // A candidate from which more than a third of the letters differ is another word and no typing
  // error, unless the word is its beginning.
  const std::size_t limit = std::max<std::size_t>(2, word.size() / 3);
  for (const std::string_view candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    const bool beginning = word.size() >= 3 && candidate.substr(0, word.size()) == word;
    if ((distance > limit || best_beginning) && !beginning) continue;
    if (best && distance >= best_distance && beginning == best_beginning) continue;
    best_distance = distance;
    best_beginning = beginning;
    best = candidate;
  }
  return best;
}

std::string one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return text;
}

const toml::table* TomlReader::parse(std::string_view text) {
  try {
    document_ = toml::parse(text, std::string_view(origin_));
  } catch (const toml::parse_error& error) {
    fail(error.source(), "is no valid TOML: " + std::string(error.description()));
    return nullptr;
  }
  return &document_;
}

bool TomlReader::only(const Section& section, const std::vector<std::string_view>& known) {
  if (error_ || section.table == nullptr) return false;
  for (const auto& [key, value] : *section.table) {
    if (std::find(known.begin(), known.end(), key.str()) != known.end()) continue;
    const auto nearest = nearest_word(key.str(), known);
    return fail(key.source(), "unknown key " + quoted(key.str()) + in_section(section.path) + "; " +
                                  (nearest ? "did you mean " + quoted(*nearest) + "?"
                                           : "known keys: " + list_of(known)));
  }
  return true;
}

bool TomlReader::number(const Section& section, const NumberKey& key, double& target) {
  if (error_ || section.table == nullptr) return false;
  const toml::node* node = section.table->get(key.name);
  if (node == nullptr) {
    if (key.optional) return true;
    return fail(section.table->source(), "missing key " + quoted(key.name) +
                                             in_section(section.path) + ": add the " +
                                             std::string(key.meaning) + ", " + range_text(key));
  }
  if (!node->is_integer() && !node->is_floating_point()) {
    return fail(node->source(), quoted(key.name) + in_section(section.path) + " is a " +
                                    type_name(*node) + ", must be a number without quotes, " +
                                    range_text(key));
  }
  const double value = *node->value<double>();
  if (const auto wrong = range_error(key, value)) {
    return fail(node->source(), quoted(key.name) + in_section(section.path) + *wrong);
  }
  target = value;
  return true;
}

bool TomlReader::text(const Section& section, std::string_view key, std::string_view example,
                      std::string& target) {
  if (error_ || section.table == nullptr) return false;
  const toml::node* node = section.table->get(key);
  const std::string remedy = "write " + std::string(key) + " = \"" + std::string(example) + "\"";
  if (node == nullptr) {
    return fail(section.table->source(),
                "missing key " + quoted(key) + in_section(section.path) + ": " + remedy);
  }
  const std::optional<std::string> value = node->value_exact<std::string>();
  if (!value) {
    return fail(node->source(), quoted(key) + in_section(section.path) + " is a " +
                                    type_name(*node) + ", must be a string: " + remedy);
  }
  target = *value;
  return true;
}

bool TomlReader::seed(const Section& section, std::string_view key, std::uint64_t& target) {
  if (error_ || section.table == nullptr) return false;
  const toml::node* node = section.table->get(key);
  if (node == nullptr) return true;
  const std::optional<std::int64_t> value = node->value_exact<std::int64_t>();
  if (!value || *value < 0) {
    return fail(node->source(), quoted(key) + in_section(section.path) +
                                    " must be a whole number, 0 to 9223372036854775807");
  }
  target = static_cast<std::uint64_t>(*value);
  return true;
}

bool TomlReader::pairs(const Section& section, std::string_view key, const NumberKey& first,
                       const NumberKey& second, std::vector<std::pair<double, double>>& target) {
  if (error_ || section.table == nullptr) return false;
  const toml::node* node = section.table->get(key);
  if (node == nullptr) return true;
  const std::string form =
      "[[" + std::string(first.name) + ", " + std::string(second.name) + "], ...]";
  const auto malformed = [&](const toml::node& at) {
    return fail(at.source(), quoted(key) + in_section(section.path) + " must be a list " + form);
  };
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty()) return malformed(*node);
  for (const toml::node& element : *list) {
    const toml::array* pair = element.as_array();
    if (pair == nullptr || pair->size() != 2) return malformed(element);
    const auto one = (*pair)[0].value<double>();
    const auto two = (*pair)[1].value<double>();
    if (!one || !two || !(*pair)[0].is_number() || !(*pair)[1].is_number()) {
      return malformed(element);
    }
    for (const auto& [limits, value] : {std::pair{&first, *one}, std::pair{&second, *two}}) {
      if (const auto wrong = range_error(*limits, value)) {
        return fail(element.source(), quoted(key) + in_section(section.path) + ": " +
                                          std::string(limits->name) + *wrong);
      }
    }
    target.emplace_back(*one, *two);
  }
  return true;
}

bool TomlReader::has(const Section& section, std::string_view key) const {
  return section.table != nullptr && section.table->contains(key);
}

std::vector<TomlReader::Section> TomlReader::sections(const Section& parent,
                                                      std::string_view name) {
  if (error_ || parent.table == nullptr) return {};
  const toml::node* node = parent.table->get(name);
  if (node == nullptr) return {};
  const toml::array* list = node->as_array();
  std::vector<Section> out;
  for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
    if (!(*list)[i].is_table()) break;
    out.push_back({(*list)[i].as_table(), std::string(name)});
  }
  if (list == nullptr || out.size() != list->size()) {
    fail(node->source(), quoted(name) + " is a " + type_name(*node) + ", must be sections: [[" +
                             std::string(name) + "]] and its keys below it");
  }
  return out;
}

TomlReader::Section TomlReader::section(const Section& parent, std::string_view name) {
  if (error_ || parent.table == nullptr) return {};
  const std::string path =
      parent.path.empty() ? std::string(name) : parent.path + "." + std::string(name);
  const toml::node* node = parent.table->get(name);
  if (node == nullptr) {
    fail(parent.table->source(), "missing section [" + path + "]");
    return {};
  }
  if (!node->is_table()) {
    fail(node->source(), quoted(path) + " is a " + type_name(*node) + ", must be a section: [" +
                             path + "] and its keys below it");
    return {};
  }
  return {node->as_table(), path};
}

bool TomlReader::fail_at(const Section& section, std::string_view key, const std::string& what) {
  if (section.table == nullptr) return fail({}, what);
  const toml::node* node = section.table->get(key);
  return fail(node == nullptr ? section.table->source() : node->source(), what);
}

bool TomlReader::fail(const toml::source_region& where, const std::string& what) {
  if (error_) return false;
  // The root table begins at line 1; toml++ gives it, and implicit tables such as [state], no
  // position of its own.
  const auto line = std::max<std::uint32_t>(1, where.begin.line);
  const auto column = std::max<std::uint32_t>(1, where.begin.column);
  error_ =
      one_line(origin_ + ":" + std::to_string(line) + ":" + std::to_string(column) + ": " + what);
  return false;
}

}  // namespace interneuron::toml_reader
