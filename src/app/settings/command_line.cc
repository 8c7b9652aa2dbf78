#include "app/settings/command_line.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "app/toml/toml_reader.h"

namespace interneuron::settings {
namespace {

// The command that the arguments chose, down to the last subcommand, and everything above it: its
// options are understood there, too.
std::vector<const CLI::App*> chosen(const CLI::App& program) {
  std::vector<const CLI::App*> chain{&program};
  while (!chain.back()->get_subcommands().empty()) {
    chain.push_back(chain.back()->get_subcommands().front());
  }
  return chain;
}

// "interneuron testbed up", as the user wrote it.
std::string full_name(const std::vector<const CLI::App*>& chain) {
  std::string name = "interneuron";
  for (const CLI::App* command : chain) {
    if (command->get_parent() != nullptr) name += " " + command->get_name();
  }
  return name;
}

// Options without a description group are hidden from the help, and so from suggestions.
std::vector<std::string> option_names(const std::vector<const CLI::App*>& chain) {
  std::vector<std::string> names;
  for (const CLI::App* command : chain) {
    for (const CLI::Option* option : command->get_options()) {
      if (option->get_group().empty()) continue;
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

std::vector<std::string> command_names(const CLI::App& parent) {
  std::vector<std::string> names;
  const auto all = [](const CLI::App*) { return true; };
  for (const CLI::App* command : parent.get_subcommands(all)) names.push_back(command->get_name());
  return names;
}

std::string suggestion(const std::string& word, const std::vector<std::string>& known,
                       const std::string& command) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  if (const auto nearest = toml_reader::nearest_word(word, views)) {
    return "; did you mean '" + std::string(*nearest) + "'?";
  }
  return "; `" + command + " --help` lists them";
}

// What the arguments hold that nobody understood; empty when it is all understood.
std::string not_understood(const CLI::App& program) {
  const auto chain = chosen(program);
  const std::vector<std::string> extras = program.remaining(true);
  const auto option =
      std::ranges::find_if(extras, [](const std::string& s) { return s.starts_with('-'); });
  if (option != extras.end() && *option != "--") {
    const std::string name = option->substr(0, option->find('='));
    return "unknown option '" + name + "' of `" + full_name(chain) + "`" +
           suggestion(name, option_names(chain), full_name(chain));
  }
  if (extras.empty()) return "";
  const CLI::App& command = *chain.back();
  if (!command_names(command).empty()) {
    return "unknown command '" + extras.front() + "' of `" + full_name(chain) + "`" +
           suggestion(extras.front(), command_names(command), full_name(chain));
  }
  return "`" + full_name(chain) + "` takes no '" + extras.front() + "'; `" + full_name(chain) +
         " --help` shows what it takes";
}

}  // namespace

CLI::Validator positive_number() {
  const auto refuse = [](std::string& text) -> std::string {
    double value = 0;
    const char* end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value);
    const bool good = error == std::errc{} && rest == end && std::isfinite(value) && value > 0;
    return good ? "" : "'" + text + "': give a number above 0";
  };
  return {refuse, "POSITIVE"};
}

std::string mistake_in(const CLI::App& program, const CLI::ParseError& error) {
  const bool may_be_extra = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr ||
                            dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  const std::string extra = may_be_extra ? not_understood(program) : "";
  if (!extra.empty()) return extra;
  return std::string(error.what()) + "; `" + full_name(chosen(program)) +
         " --help` shows what it takes";
}

std::string unknown_command(const CLI::App& program, const std::string& name) {
  return "unknown command '" + name + "'" + suggestion(name, command_names(program), "interneuron");
}

}  // namespace interneuron::settings
