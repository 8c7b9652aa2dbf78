#include "lab/emu/scenario.h"

#include <algorithm>
#include <exception>

#include "lab/emu/profile_reader.h"

namespace interneuron::emu {

namespace {

// "if" and the name are a NIC's name, which has 15 characters at most.
constexpr std::size_t kLongestNicName = 13;

constexpr NumberKey kFading{"common_fading", "probability that EDGE is shared", 0, 1, ""};
constexpr NumberKey kMeanGap{"mean_gap_s", "mean time between holes", 0.1, kMaxSeconds, "s"};
constexpr NumberKey kMeanLength{"mean_length_s", "mean length of a hole", 0.01, kMaxSeconds, "s"};
constexpr NumberKey kAt{"at_s", "time since the first packet", 0, kMaxInstantS, "s"};
constexpr NumberKey kOutage{"outage_s", "length of the outage", 0.001, kMaxSeconds, "s", true};

constexpr NumberKey kCoDelTarget{
    "codel_target_ms", "how long packets may wait for good", 0.1, 1000, "ms", true};
constexpr NumberKey kMarkAbove{
    "mark_above_ms", "wait above which L4S packets are marked", 0, 1000, "ms", true};

// Reads the name of a link or cell, which no other one of `all` may have.
template <class Named>
bool read_own_name(TomlReader& reader, const Section& section, const char* what,
                   const std::vector<Named>& all, std::string& out) {
  if (!read_name(reader, section, kLongestNicName, out)) return false;
  const bool taken = std::ranges::find(all, out, &Named::name) != all.end();
  return !taken || reader.fail_at(section, "name",
                                  "'name' = \"" + out + "\" is another " + what +
                                      "'s already; choose another");
}

bool read_found_profile(TomlReader& reader, const Section& section, const ProfileResolver& resolver,
                        LinkProfile& out) {
  std::string name;
  if (!reader.text(section, "profile", "5g", name)) return false;
  auto found = resolver(name);
  if (const auto* error = std::get_if<ProfileError>(&found)) {
    return reader.fail_at(section, "profile", error->what);
  }
  out = std::get<LinkProfile>(std::move(found));
  return true;
}

bool read_cell(TomlReader& reader, const Section& section, const ProfileResolver& resolver,
               Scenario& out) {
  ScenarioCell cell;
  LinkProfile profile;
  double target_ms = 0;
  double mark_ms = 0;
  if (!reader.only(section, {"name", "profile", "codel_target_ms", "mark_above_ms"}) ||
      !read_own_name(reader, section, "cell", out.cells, cell.name) ||
      !read_found_profile(reader, section, resolver, profile) ||
      !reader.number(section, kCoDelTarget, target_ms) ||
      !reader.number(section, kMarkAbove, mark_ms)) {
    return false;
  }
  const auto params = [&](const DirectionParams& direction) {
    CellParams p{direction.rate, direction.trace, direction.queue_bytes, direction.mtu, {}, {}};
    if (target_ms > 0) p.codel = CoDelParams{.target = from_ms(target_ms)};
    if (reader.has(section, kMarkAbove.name)) p.mark_above = from_ms(mark_ms);
    return p;
  };
  cell.up = params(profile.up);
  cell.down = params(profile.down);
  out.cells.push_back(std::move(cell));
  return true;
}

bool read_cells(TomlReader& reader, const Section& root, const ProfileResolver& resolver,
                Scenario& out) {
  const std::vector<Section> sections = reader.sections(root, "cell");
  if (sections.size() > kMaxScenarioCells) {
    return reader.fail_at(root, "cell",
                          std::to_string(sections.size()) + " sections [[cell]]; at most " +
                              std::to_string(kMaxScenarioCells));
  }
  for (const Section& section : sections) {
    if (!read_cell(reader, section, resolver, out)) return false;
  }
  return !reader.error();
}

// The cell that a link names, if it names one.
bool read_shared(TomlReader& reader, const Section& section, const Scenario& scenario,
                 std::optional<std::size_t>& out) {
  if (!reader.has(section, "cell")) return true;
  std::string name;
  if (!reader.text(section, "cell", "town", name)) return false;
  const auto cell = std::ranges::find(scenario.cells, name, &ScenarioCell::name);
  if (cell == scenario.cells.end()) {
    return reader.fail_at(section, "cell",
                          "'cell' = \"" + name + "\" is no [[cell]] of this scenario; add one");
  }
  out = static_cast<std::size_t>(cell - scenario.cells.begin());
  return true;
}

bool read_link(TomlReader& reader, const Section& section, const ProfileResolver& resolver,
               Scenario& out) {
  ScenarioLink link;
  link.seed = link_seed(out.seed, out.links.size());
  if (!reader.only(section, {"name", "profile", "seed", "cell"}) ||
      !read_own_name(reader, section, "link", out.links, link.name) ||
      !read_found_profile(reader, section, resolver, link.profile) ||
      !reader.seed(section, "seed", link.seed) || !read_shared(reader, section, out, link.cell)) {
    return false;
  }
  out.links.push_back(std::move(link));
  return true;
}

bool read_links(TomlReader& reader, const Section& root, const ProfileResolver& resolver,
                Scenario& out) {
  const std::vector<Section> sections = reader.sections(root, "link");
  if (sections.empty() || sections.size() > kMaxScenarioLinks) {
    return reader.fail_at(root, "link",
                          std::to_string(sections.size()) +
                              " sections [[link]]; there must be 1 to " +
                              std::to_string(kMaxScenarioLinks));
  }
  for (const Section& section : sections) {
    if (!read_link(reader, section, resolver, out)) return false;
  }
  return true;
}

// The link that an event names; "*" is all.
bool read_target(TomlReader& reader, const Section& section, const Scenario& scenario,
                 std::optional<std::size_t>& out) {
  std::string name;
  if (!reader.text(section, "link", "*", name)) return false;
  if (name == "*") return true;
  std::vector<std::string_view> known;
  std::string list;
  for (const ScenarioLink& link : scenario.links) {
    if (link.name == name) {
      out = known.size();
      return true;
    }
    known.push_back(link.name);
    list += link.name + ", ";
  }
  const auto nearest = nearest_word(name, known);
  return reader.fail_at(section, "link",
                        "'link' = \"" + name + "\" is no link of this scenario; " +
                            (nearest ? "did you mean \"" + std::string(*nearest) + "\"?"
                                     : "there are " + list + "and \"*\" for all"));
}

bool read_event(TomlReader& reader, const Section& section, const ProfileResolver& resolver,
                Scenario& out) {
  ScenarioEvent event;
  double at_s = 0;
  double outage_s = 0;
  if (!read_change(reader, section, {"at_s", "link", "outage_s"}, resolver, event.change) ||
      !reader.number(section, kAt, at_s) || !read_target(reader, section, out, event.link) ||
      !reader.number(section, kOutage, outage_s)) {
    return false;
  }
  // at_s and link; an event must have a further key.
  constexpr std::size_t kAddress = 2;
  if (section.table->size() <= kAddress) {
    return reader.fail_at(section, "at_s",
                          "nothing happens in this [[event]]: add outage_s or a change, as rtt_ms");
  }
  event.at = seconds(at_s);
  event.outage = seconds(outage_s);
  out.events.push_back(std::move(event));
  return true;
}

bool read_optional_parts(TomlReader& reader, const Section& root, Scenario& out) {
  if (reader.has(root, "coupling")) {
    const Section coupling = reader.section(root, "coupling");
    if (!reader.only(coupling, {"common_fading"}) ||
        !reader.number(coupling, kFading, out.common_fading)) {
      return false;
    }
  }
  if (!reader.has(root, "holes")) return true;
  const Section holes = reader.section(root, "holes");
  double gap_s = 0;
  double length_s = 0;
  if (!reader.only(holes, {"mean_gap_s", "mean_length_s"}) ||
      !reader.number(holes, kMeanGap, gap_s) || !reader.number(holes, kMeanLength, length_s)) {
    return false;
  }
  out.holes = {seconds(gap_s), seconds(length_s)};
  return true;
}

bool read_scenario(TomlReader& reader, std::string_view text, const ProfileResolver& resolver,
                   Scenario& out) {
  const Section root{reader.parse(text), ""};
  if (!reader.only(
          root, {"schema", "description", "seed", "cell", "link", "coupling", "holes", "event"}) ||
      !read_schema(reader, root) ||
      (reader.has(root, "description") &&
       !reader.text(root, "description", "a tunnel", out.description)) ||
      !reader.seed(root, "seed", out.seed) || !read_cells(reader, root, resolver, out) ||
      !read_links(reader, root, resolver, out) || !read_optional_parts(reader, root, out)) {
    return false;
  }
  for (const Section& section : reader.sections(root, "event")) {
    if (!read_event(reader, section, resolver, out)) return false;
  }
  if (reader.error()) return false;
  std::stable_sort(out.events.begin(), out.events.end(),
                   [](const ScenarioEvent& a, const ScenarioEvent& b) { return a.at < b.at; });
  return true;
}

}  // namespace

std::variant<Scenario, ProfileError> parse_scenario(std::string_view toml_text,
                                                    std::string_view origin,
                                                    const ProfileResolver& resolver) {
  try {
    TomlReader reader(origin);
    Scenario scenario;
    scenario.source = source_of(toml_text);
    if (read_scenario(reader, toml_text, resolver, scenario)) return scenario;
    return ProfileError{reader.error().value_or(std::string(origin) + ": cannot be read")};
  } catch (const std::exception& error) {
    // toml++ is out of memory, or the resolver has thrown.
    return ProfileError{std::string(origin) + ": cannot be read: " + error.what()};
  }
}

Scenario plain_scenario(std::vector<ScenarioLink> links, std::uint64_t seed) {
  Scenario scenario;
  scenario.seed = seed;
  scenario.links = std::move(links);
  return scenario;
}

}  // namespace interneuron::emu
