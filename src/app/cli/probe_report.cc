#include "app/cli/probe.h"

#include <fmt/format.h>

namespace interneuron::cli {
namespace {

records::Json distribution_json(const probe::Distribution& d) {
  if (d.samples == 0) return nullptr;
  return {{"min_ms", to_ms(d.min)}, {"p50_ms", to_ms(d.p50)},     {"p95_ms", to_ms(d.p95)},
          {"max_ms", to_ms(d.max)}, {"mean_ms", d.mean_ns / 1e6}, {"stddev_ms", d.stddev_ns / 1e6}};
}

records::Json rate_json(const std::optional<DataRate>& rate) {
  return rate ? records::Json(rate->mbit()) : records::Json(nullptr);
}

records::Json nic_json(const ProbedNic& nic) {
  const probe::Summary& s = nic.summary;
  records::Json json{{"nic", nic.nic},
                     {"peer", nic.peer},
                     {"local", nic.local},
                     {"sent_packets", s.sent},
                     {"answered_packets", s.answered},
                     {"late_packets", s.late},
                     {"lost_up_packets", s.lost_up},
                     {"lost_down_packets", s.lost_down},
                     {"lost_packets", s.lost},
                     {"loss_percent", 100 * s.loss()},
                     {"reflector_counts", s.stateful},
                     {"loss_bursts", s.bursts},
                     {"loss_burst_mean_packets", s.mean_burst()},
                     {"loss_burst_max_packets", s.longest_burst},
                     {"duplicate_packets", s.duplicates},
                     {"reordered_packets", s.reordered},
                     {"reordered_ratio", s.reordered_ratio()},
                     {"rtt", distribution_json(s.rtt)},
                     {"delay_variation_up", distribution_json(s.variation_up)},
                     {"delay_variation_down", distribution_json(s.variation_down)},
                     {"rate_up_mbit", rate_json(s.rate_up)},
                     {"rate_down_mbit", rate_json(s.rate_down)},
                     {"trains", s.trains},
                     {"train_packets", s.train_packets},
                     {"train_answered_packets", s.train_answered}};
  if (!nic.problem.empty()) json["problem"] = nic.problem;
  return json;
}

std::string rate_text(const std::optional<DataRate>& rate) {
  return rate ? fmt::format("{:.1f}", rate->mbit()) : "-";
}

std::string loss_text(const probe::Summary& s) {
  if (s.all_lost() == 0) return "0";
  std::string text = fmt::format("{} ({:.1f} %)", s.all_lost(), 100 * s.loss());
  if (s.lost_up + s.lost_down > 0) text += fmt::format(" {}/{}", s.lost_up, s.lost_down);
  return text;
}

}  // namespace

records::Json probe_json(const ProbeOptions& options, const std::vector<ProbedNic>& nics) {
  records::Json json{
      {"schema", "interneuron.probe/1"},    {"format", options.stamp ? "stamp" : "echo"},
      {"interval_ms", options.interval_ms}, {"timeout_ms", options.timeout_ms},
      {"size_bytes", options.size},         {"nics", records::Json::array()}};
  for (const ProbedNic& nic : nics) json["nics"].push_back(nic_json(nic));
  return json;
}

records::Json reply_json(const std::string& nic, const probe::Reply& reply) {
  return {{"schema", "interneuron.probe.reply/1"},
          {"nic", nic},
          {"sequence", reply.sequence},
          {"rtt_ms", to_ms(reply.rtt)},
          {"delay_variation_up_ms", to_ms(reply.variation_up)},
          {"delay_variation_down_ms", to_ms(reply.variation_down)},
          {"late", reply.late}};
}

void print_probe_table(const ProbeOptions& options, const std::vector<ProbedNic>& nics) {
  fmt::print("packets of {} bytes every {:g} ms{}\n", options.size, options.interval_ms,
             options.stamp ? ", STAMP" : "");
  for (const ProbedNic& nic : nics) fmt::print("{} to {}\n", nic.nic, nic.peer);
  fmt::print("{:<12}{:>7}{:>20}{:>6}{:>6}{:>7}{:>28}{:>8}{:>16}{:>16}\n", "nic", "sent",
             "lost (up/down)", "late", "dup", "reord", "rtt min/p50/p95/max ms", "stddev",
             "delay var p95", "rate Mbit/s");
  fmt::print("{:<12}{:>7}{:>20}{:>6}{:>6}{:>7}{:>28}{:>8}{:>16}{:>16}\n", "", "", "", "", "", "",
             "", "ms", "up/down ms", "up/down");
  for (const ProbedNic& nic : nics) {
    const probe::Summary& s = nic.summary;
    const bool any = s.rtt.samples > 0;
    const std::string rtt = any ? fmt::format("{:.2f}/{:.2f}/{:.2f}/{:.2f}", to_ms(s.rtt.min),
                                              to_ms(s.rtt.p50), to_ms(s.rtt.p95), to_ms(s.rtt.max))
                                : "-";
    const std::string variation =
        any ? fmt::format("{:.2f}/{:.2f}", to_ms(s.variation_up.p95), to_ms(s.variation_down.p95))
            : "-";
    fmt::print("{:<12}{:>7}{:>20}{:>6}{:>6}{:>7}{:>28}{:>8}{:>16}{:>16}\n", nic.nic, s.sent,
               loss_text(s), s.late, s.duplicates, s.reordered, rtt,
               any ? fmt::format("{:.2f}", s.rtt.stddev_ns / 1e6) : "-", variation,
               rate_text(s.rate_up) + "/" + rate_text(s.rate_down));
  }
}

}  // namespace interneuron::cli
