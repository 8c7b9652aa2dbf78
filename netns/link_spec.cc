// default_links, load_link: which links a testbed has.
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>
#include <variant>

#include "netns/testbed.h"

namespace interneuron::netns {

namespace {

emu::LinkProfile parse(const std::string& text, const std::string& origin) {
  auto parsed = emu::parse_profile(text, origin);
  if (const auto* error = std::get_if<emu::ProfileError>(&parsed))
    throw TestbedError(3, error->what);
  return std::get<emu::LinkProfile>(std::move(parsed));
}

emu::LinkProfile read_file(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) throw TestbedError(3, "cannot read the profile " + path + ": " + std::strerror(errno));
  return parse(text.str(), path);
}

emu::LinkProfile find_profile(const std::string& what) {
  std::string known;
  for (const emu::BuiltInProfile& candidate : emu::built_in_profiles()) {
    if (candidate.name == what) {
      return parse(std::string(candidate.text), std::string(candidate.origin));
    }
    known += (known.empty() ? "" : ", ") + std::string(candidate.name);
  }
  if (what.find('/') != std::string::npos || what.ends_with(".toml")) return read_file(what);
  throw TestbedError(3, "no profile '" + what + "'; there are " + known + ", or name a file (./" +
                            what + ".toml)");
}

}  // namespace

LinkSpec load_link(const std::string& what) {
  const std::size_t equals = what.find('=');
  if (equals != std::string::npos && what.find('/') > equals) {
    return {what.substr(0, equals), find_profile(what.substr(equals + 1))};
  }
  emu::LinkProfile profile = find_profile(what);
  std::string name = profile.name;
  return {std::move(name), std::move(profile)};
}

std::vector<LinkSpec> default_links() { return {load_link("5g"), load_link("4g")}; }

}  // namespace interneuron::netns
