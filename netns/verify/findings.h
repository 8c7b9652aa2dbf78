// The result of verify, and how it is written: a table for people, JSON for programs
// (schema "interneuron.verify/1"). Pure; thread-compatible; no errors.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

struct LinkFindings {
  // "5g", or "vehicle2/5g" of a vehicle that is not the first.
  std::string name;
  std::string profile;
  // How long the link was measured.
  Duration window{};
  // Echo requests answered within the window.
  std::size_t pings = 0;
  // iperf3's datagrams, indexed by Direction.
  std::array<std::size_t, 2> sent{};
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

// Judges one link (assess()) and counts its packets.
LinkFindings summarise(const std::string& name, const std::string& profile,
                       const LinkEvidence& evidence);

Verdict overall(const Findings& findings);
nlohmann::ordered_json to_json(const Findings& findings);
// One row per figure, one line per link, and a last line "verify: " with the overall verdict.
std::string to_table(const Findings& findings);

}  // namespace interneuron::cli::verify
