// What figures and findings are made of, and how they are written: as a table and as JSON.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "netns/verify/assess.h"

namespace interneuron::netns::verify {

namespace {

using Json = nlohmann::ordered_json;

const char* json_name(Verdict verdict) {
  return verdict == Verdict::kFailed ? "failed" : verdict_name(verdict);
}

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json to_json(const Figure& figure) {
  return {{"figure", figure.name},
          {"unit", figure.unit},
          {"target", number(figure.target)},
          {"measured", number(figure.measured)},
          {"difference", number(figure.difference)},
          {"difference_unit", figure.difference_unit},
          {"verdict", json_name(figure.verdict)},
          {"note", figure.note}};
}

Json to_json(const LinkFindings& link) {
  Json json{{"link", link.name},
            {"profile", link.profile},
            {"window_s", to_seconds(link.window)},
            {"pings", link.pings}};
  for (const auto& [name, i] : {std::pair{"up", 0U}, std::pair{"down", 1U}}) {
    json["packets"][name] = {{"sent", link.sent[i]}, {"received", link.received[i]}};
  }
  json["figures"] = Json::array();
  for (const Figure& figure : link.figures) json["figures"].push_back(to_json(figure));
  return json;
}

// "23.412 ms"; counts without decimals.
std::string with_unit(const std::optional<double>& value, const std::string& unit) {
  if (!value) return "";
  const bool whole = unit == "packets" && *value == static_cast<double>(static_cast<long>(*value));
  return fmt::format("{:.{}f} {}", *value, whole ? 0 : unit == "ms" ? 3 : 2, unit);
}

std::string target_of(const Figure& figure) {
  // The target of a delay error is the largest value allowed, not a value to be met.
  const bool limit = figure.target && !figure.difference && figure.unit == "ms";
  return (limit ? "<= " : "") + with_unit(figure.target, figure.unit);
}

std::string difference_of(const Figure& figure) {
  if (!figure.difference) return "";
  return fmt::format("{:+.2f} {}", *figure.difference, figure.difference_unit);
}

}  // namespace

Figure without_verdict(std::string name, std::string note, Verdict verdict) {
  Figure figure;
  figure.name = std::move(name);
  figure.note = std::move(note);
  figure.verdict = verdict;
  return figure;
}

void inconclusive(Figure& figure, std::string note) {
  if (figure.verdict == Verdict::kNotMeasured) return;
  figure.verdict = Verdict::kInconclusive;
  figure.note = std::move(note);
}

const char* verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return "ok";
    case Verdict::kFailed:
      return "FAILED";
    case Verdict::kInconclusive:
      return "inconclusive";
    case Verdict::kNotMeasured:
      break;
  }
  return "not measured";
}

Verdict overall(const std::vector<std::vector<Figure>>& links) {
  Verdict worst = Verdict::kOk;
  for (const auto& figures : links) {
    for (const Figure& figure : figures) {
      if (figure.verdict == Verdict::kFailed) return Verdict::kFailed;
      if (figure.verdict == Verdict::kInconclusive) worst = Verdict::kInconclusive;
    }
  }
  return worst;
}

Verdict overall(const Findings& findings) {
  std::vector<std::vector<Figure>> figures;
  for (const LinkFindings& link : findings.links) figures.push_back(link.figures);
  return overall(figures);
}

std::string to_json(const Findings& findings) {
  Json json{{"schema", "interneuron.verify/1"},
            {"name", findings.testbed},
            {"seed", findings.seed},
            {"backend", findings.backend},
            {"verdict", json_name(overall(findings))},
            {"emulator",
             {{"lateness_mean_ms", findings.disturbance.late_mean_ms},
              {"lateness_max_ms", findings.disturbance.late_max_ms},
              {"kernel_drops", findings.disturbance.kernel_drops}}}};
  json["links"] = Json::array();
  for (const LinkFindings& link : findings.links) json["links"].push_back(to_json(link));
  return json.dump(2) + "\n";
}

std::string to_table(const Findings& findings) {
  constexpr const char* kRow = "{:<12}{:<22}{:>16}{:>16}{:>16}  {}\n";
  std::string out =
      fmt::format(kRow, "link", "figure", "target", "measured", "difference", "verdict");
  for (const LinkFindings& link : findings.links) {
    for (const Figure& f : link.figures) {
      const std::string note = f.note.empty() ? "" : " (" + f.note + ")";
      out += fmt::format(kRow, link.name, f.name, target_of(f), with_unit(f.measured, f.unit),
                         difference_of(f), verdict_name(f.verdict) + note);
    }
    out += fmt::format(
        "{:<12}{:.1f} s of profile {}: {} pings, {} of {} datagrams up, {} of {} "
        "down\n",
        link.name, to_seconds(link.window), link.profile, link.pings, link.received[0],
        link.sent[0], link.received[1], link.sent[1]);
  }
  const Disturbance& d = findings.disturbance;
  out += fmt::format(
      "testbed '{}', seed {}, {}: frames {:.3f} ms late in the mean, {:.1f} ms at "
      "most, {} dropped by the kernel\n",
      findings.testbed, findings.seed, findings.backend, d.late_mean_ms, d.late_max_ms,
      d.kernel_drops);
  return out + fmt::format("verify: {}\n", verdict_name(overall(findings)));
}

}  // namespace interneuron::netns::verify
