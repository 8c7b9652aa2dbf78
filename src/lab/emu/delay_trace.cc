#include "lab/emu/delay_trace.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace interneuron::emu {

namespace {

// The step of the process, kDelayStep.
constexpr double kMinStepSeconds = 0.01;
constexpr double kMaxStepSeconds = 3600;
constexpr double kLongestRttMs = 60'000;
constexpr double kUnavailable = -1;
constexpr std::string_view kSourceLine = "# Source: ";
constexpr std::string_view kStepLine = "# step_s = ";

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string trace_error(std::size_t line, const std::string& what) {
  return "line " + std::to_string(line) + ": " + what;
}

// Takes the first line, without its end.
std::string_view take_line(std::string_view& text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  return line;
}

}  // namespace

std::variant<DelayTrace, std::string> parse_delay_trace(std::string_view text) {
  DelayTrace trace;
  if (!text.empty() && text.back() != '\n') {
    const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
    return trace_error(lines + 1, "the file is cut off: its last line has no end");
  }
  const std::string_view source = take_line(text);
  if (!source.starts_with(kSourceLine)) return trace_error(1, "must be \"# Source: WHERE FROM\"");
  trace.source = source.substr(kSourceLine.size());

  const std::string_view step = take_line(text);
  const auto step_s =
      step.starts_with(kStepLine) ? number(step.substr(kStepLine.size())) : std::nullopt;
  if (!step_s || !(*step_s >= kMinStepSeconds && *step_s <= kMaxStepSeconds)) {
    return trace_error(2, "must be \"# step_s = SECONDS\", 0.01 to 3600");
  }
  trace.step = from_ms(*step_s * 1e3);

  bool any = false;
  for (std::size_t line_number = 3; !text.empty(); ++line_number) {
    const std::string_view line = take_line(text);
    if (line.empty() || line.front() == '#') continue;
    const auto value = number(line);
    if (!value || !((*value >= 0 && *value <= kLongestRttMs) || *value == kUnavailable)) {
      return trace_error(line_number, "'" + std::string(line.substr(0, 20)) +
                                          "' must be a round-trip time of 0 to 60000 ms, or -1");
    }
    any = any || *value >= 0;
    trace.rtt_ms.push_back(*value);
  }
  if (trace.rtt_ms.size() < 2 || !any) {
    return std::string("holds no round-trip times; it needs at least two samples");
  }
  return trace;
}

DelayTrace::Sample DelayTrace::at(Duration t) const {
  const Duration in_lap = t % length();
  const auto i = static_cast<std::size_t>(in_lap / step);
  const std::size_t next = (i + 1) % rtt_ms.size();
  if (rtt_ms[i] < 0) {
    // What was last known: when the network returns, its delay comes from there.
    std::size_t known = i;
    for (std::size_t back = 1; rtt_ms[known] < 0; ++back) {
      known = (i + rtt_ms.size() - back) % rtt_ms.size();
    }
    return {rtt_ms[known], true};
  }
  if (rtt_ms[next] < 0) return {rtt_ms[i], false};
  const double share =
      static_cast<double>((in_lap % step).count()) / static_cast<double>(step.count());
  return {rtt_ms[i] + share * (rtt_ms[next] - rtt_ms[i]), false};
}

}  // namespace interneuron::emu
