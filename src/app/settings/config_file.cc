#include "app/settings/config_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <filesystem>

#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/settings/link_options.h"
#include "app/toml/toml_reader.h"

namespace interneuron::settings {
namespace {

constexpr const char* kConfigOption = "--config";

std::string place(const std::string& file, const toml::source_region& where) {
  return file + ":" + std::to_string(where.begin.line) + ":" + std::to_string(where.begin.column);
}

// Keys and values of the file stand in the message, and its end of a line may be one of them.
[[noreturn]] void refuse(const std::string& what) {
  throw process::Failure(process::kConfiguration, toml_reader::one_line(what));
}

std::string dashed(std::string key) {
  std::ranges::replace(key, '_', '-');
  return key;
}

// A value as the command line would give it: a scalar, or a [[link]].
std::string scalar(const toml::node& node, const std::string& file, const std::string& where,
                   const std::string& key) {
  if (const toml::table* table = node.as_table(); table != nullptr && key == "link") {
    return link_table_text(*table, file);
  }
  if (const auto s = node.value_exact<std::string>()) return *s;
  if (const auto i = node.value_exact<std::int64_t>()) return std::to_string(*i);
  if (const auto b = node.value_exact<bool>()) return *b ? "true" : "false";
  if (const auto d = node.value_exact<double>()) return toml_reader::number_text(*d);
  refuse(where + ": " + key + ": give a string, a number, true or false");
}

CLI::Option* find_option(CLI::App& command, const std::string& key, const std::string& where) {
  CLI::Option* option = command.get_option_no_throw("--" + dashed(key));
  if (option != nullptr && key != "config" && key != "help" && key.find('-') == std::string::npos) {
    return option;
  }
  std::vector<std::string> names;
  for (const CLI::Option* o : command.get_options()) {
    for (std::string name : o->get_lnames()) {
      std::ranges::replace(name, '-', '_');
      if (name != "config" && name != "help") names.push_back(name);
    }
  }
  const std::vector<std::string_view> known(names.begin(), names.end());
  const auto nearest = toml_reader::nearest_word(key, known);
  refuse(where + ": unknown key '" + key + "'" +
         (nearest ? "; did you mean '" + std::string(*nearest) + "'?"
                  : "; `interneuron " + command.get_name() + " --help` lists the keys"));
}

void apply(CLI::App& command, const std::string& file, const std::string& key,
           const toml::node& node) {
  const std::string where = place(file, node.source());
  CLI::Option* option = find_option(command, key, where);
  if (option->count() > 0) return;
  std::vector<std::string> values;
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& element : *array) values.push_back(scalar(element, file, where, key));
  } else {
    values.push_back(scalar(node, file, where, key));
  }
  if (values.empty()) refuse(where + ": " + key + ": an empty list; give a value or leave it out");
  try {
    option->add_result(values);
    option->run_callback();
  } catch (const CLI::Error& error) {
    // The error names the option, which the user of a file has not written.
    std::string what = error.what();
    const std::string named = option->get_name() + ": ";
    if (what.starts_with(named)) what.erase(0, named.size());
    refuse(where + ": " + key + ": " + what);
  }
}

}  // namespace

void add_config_option(CLI::App& command) {
  command
      .add_option(kConfigOption,
                  "TOML file with these options as keys (underscores for dashes); flags win")
      ->type_name("FILE");
}

void apply_config(CLI::App& command) {
  const CLI::Option* option = command.get_option_no_throw(kConfigOption);
  if (option == nullptr || option->count() == 0) return;
  const auto file = option->as<std::string>();
  if (!std::filesystem::is_regular_file(file)) {
    refuse("config '" + file + "': no such file; give --config FILE");
  }
  toml::table table;
  try {
    table = toml::parse(process::read_whole(file, process::kConfiguration), file);
  } catch (const toml::parse_error& error) {
    refuse(place(file, error.source()) + ": " + std::string(error.description()));
  }
  for (const auto& [key, node] : table) apply(command, file, std::string(key.str()), node);
}

}  // namespace interneuron::settings
