// What verify says at the end: a table for people, JSON for programs. Pure.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

struct LinkFindings {
  std::string name;  // "5g", or "vehicle2/5g"
  std::string profile;
  Duration window{};
  std::size_t pings = 0;              // answered
  std::array<std::size_t, 2> sent{};  // datagrams, indexed by Direction
  std::array<std::size_t, 2> received{};
  std::vector<Figure> figures;
};

struct Findings {
  std::string testbed;
  std::uint64_t seed = 0;
  std::string backend;
  Disturbance disturbance;
  std::vector<LinkFindings> links;
};

LinkFindings summarise(const std::string& name, const std::string& profile,
                       const LinkEvidence& evidence);

Verdict overall(const Findings& findings);
nlohmann::ordered_json to_json(const Findings& findings);
// With a last line that says it all.
std::string to_table(const Findings& findings);

}  // namespace interneuron::cli::verify
