#include "app/doctor/judge.h"

#include <fmt/format.h>

namespace interneuron::doctor {
namespace {

constexpr probe::Silence kKeepAlive{kKeepAliveSeconds};

std::string known_text(const probe::SilenceResult& flows) {
  const auto after = [](probe::Silence silence) { return fmt::format("{} s", silence.count()); };
  if (flows.survived && flows.closed) {
    return fmt::format("UDP flows are open after {} of silence, closed after {}",
                       after(*flows.survived), after(*flows.closed));
  }
  if (flows.survived) return "UDP flows are open after " + after(*flows.survived) + " of silence";
  if (flows.closed) return "UDP flows are closed after " + after(*flows.closed) + " of silence";
  return "";
}

// Why nothing can be said; empty: something can.
std::string obstacle(const NatTimeout& m) {
  const std::string known = known_text(m.flows);
  if (m.limit == probe::Silence::zero()) {
    return "--nat-timeout measures how long silent UDP flows stay open (takes a minute)";
  }
  if (!m.cut_short.empty()) return m.cut_short + (known.empty() ? "" : "; so far: " + known);
  if (!m.flows.answered) {
    return "the peer does not answer: needs `interneuron road --insecure` there, since one with "
           "keys "
           "answers only its peers, and UDP through firewalls";
  }
  if (!known.empty()) return "";
  return m.flows.refused ? "the peer has no room for later replies: others measure too, try again"
                         : "too many packets are lost to open flows";
}

}  // namespace

Finding judge_nat(const NatTimeout& measured) {
  Finding finding{"nat_timeout", measured.nic, Verdict::kNotChecked, obstacle(measured), {}};
  if (!finding.found.empty()) return finding;
  const probe::SilenceResult& flows = measured.flows;
  finding.found = known_text(flows);
  if (flows.closed && *flows.closed <= kKeepAlive) {
    finding.verdict = Verdict::kProblem;
    finding.found += fmt::format(
        "; idle metered links send every {} s: use this one without `metered`, or get a longer "
        "time-out from the carrier (another APN, IPv6)",
        kKeepAliveSeconds);
  } else if (flows.closed && *flows.closed <= 2 * kKeepAlive) {
    finding.verdict = Verdict::kWarning;
    finding.found += fmt::format(
        "; idle metered links send every {} s, so one lost packet may close them: use this one "
        "without `metered` if it is needed at once",
        kKeepAliveSeconds);
  } else if (flows.survived && *flows.survived >= kKeepAlive) {
    finding.verdict = Verdict::kOk;
    if (!flows.closed) finding.found += ", longer was not tried";
  } else {
    finding.found +=
        fmt::format("; --nat-timeout {} tells whether idle links stay open", 2 * kKeepAliveSeconds);
  }
  return finding;
}

}  // namespace interneuron::doctor
