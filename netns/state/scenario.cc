// default_scenario(), scenario_of(), load_scenario(), profile_resolver(): which links a testbed
// has.
#include "netns/state/scenario.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>
#include <variant>

#include "netns/state/error.h"

namespace interneuron::netns {

namespace {

std::variant<std::string, emu::FileError> read_file(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) return emu::FileError{std::strerror(errno)};
  return text.str();
}

std::string require_file(const std::filesystem::path& path, const std::string& what) {
  auto text = read_file(path);
  if (const auto* error = std::get_if<emu::FileError>(&text)) {
    throw TestbedError(3, "cannot read the " + what + " " + path.string() + ": " + error->reason);
  }
  return std::get<std::string>(std::move(text));
}

emu::FileLoader loader_in(const std::filesystem::path& folder) {
  return [folder](const std::string& name) { return read_file(folder / name); };
}

// The value that a parser returned; throws its error as a TestbedError.
template <class Value>
Value require(std::variant<Value, emu::ProfileError> parsed) {
  if (const auto* error = std::get_if<emu::ProfileError>(&parsed)) {
    throw TestbedError(3, error->what);
  }
  return std::get<Value>(std::move(parsed));
}

emu::ScenarioLink load_link(const std::string& what) {
  const std::size_t equals = what.find('=');
  const bool named = equals != std::string::npos && what.find('/') > equals;
  const std::string source = named ? what.substr(equals + 1) : what;
  auto found = profile_resolver(".")(source);
  if (const auto* error = std::get_if<emu::ProfileError>(&found)) {
    throw TestbedError(is_profile_file(source) ? 3 : 2, error->what);
  }
  auto profile = std::get<emu::LinkProfile>(std::move(found));
  std::string name = named ? what.substr(0, equals) : profile.name;
  return {std::move(name), std::move(profile), 0};
}

}  // namespace

bool is_profile_file(const std::string& what) {
  return what.find('/') != std::string::npos || what.ends_with(".toml");
}

emu::ProfileResolver profile_resolver(const std::filesystem::path& folder) {
  return [folder](const std::string& what) -> std::variant<emu::LinkProfile, emu::ProfileError> {
    if (!is_profile_file(what)) {
      auto found = emu::built_in_resolver()(what);
      if (auto* error = std::get_if<emu::ProfileError>(&found)) {
        error->what += ", or name a file (./" + what + ".toml)";
      }
      return found;
    }
    const std::filesystem::path path = folder == "." ? std::filesystem::path(what) : folder / what;
    const auto text = read_file(path);
    if (const auto* error = std::get_if<emu::FileError>(&text)) {
      return emu::ProfileError{"cannot read the profile " + path.string() + ": " + error->reason};
    }
    return emu::parse_profile(std::get<std::string>(text), path.string(),
                              loader_in(path.parent_path()));
  };
}

emu::Scenario scenario_of(const std::vector<std::string>& links, std::uint64_t seed) {
  std::vector<emu::ScenarioLink> out;
  for (const std::string& link : links) {
    out.push_back(load_link(link));
    out.back().seed = emu::link_seed(seed, out.size() - 1);
  }
  return emu::plain_scenario(std::move(out), seed);
}

emu::Scenario default_scenario(std::uint64_t seed) { return scenario_of({"5g", "4g"}, seed); }

emu::Scenario load_scenario(const std::filesystem::path& file, std::optional<std::uint64_t> seed) {
  const std::string text = require_file(file, "scenario");
  emu::Scenario out =
      require(emu::parse_scenario(text, file.string(), profile_resolver(file.parent_path())));
  if (!seed) return out;
  // Links to which the file gives no seed of their own get one derived from the new seed.
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    if (out.links[i].seed == emu::link_seed(out.seed, i)) {
      out.links[i].seed = emu::link_seed(*seed, i);
    }
  }
  out.seed = *seed;
  return out;
}

}  // namespace interneuron::netns
