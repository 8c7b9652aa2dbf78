// The keys of a document's parts and of the rows of rows.h, as system_fields.h has them.
#pragma once

#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/system_fields.h"

namespace interneuron::experiments {

void fields(auto& f, Of<ClockRow> auto& r) {
  f("name", r.name);
  f("kind", r.kind);
  f("system", r.system);
  f("guard", r.guard);
  f("seeds", r.seeds);
  f("rounds", r.rounds);
  f("decided_differently", r.decided_differently);
  f("differ_at_all", r.differ_at_all);
  f("timeouts", r.timeouts);
  f("timeouts_at_offset_0", r.timeouts_at_offset_0);
  f("most_disturbed", r.most_disturbed);
}

void fields(auto& f, Of<Moments> auto& r) {
  f("avg", r.avg);
  f("min", r.min);
  f("max", r.max);
  f("std", r.std);
}

void fields(auto& f, Of<NetworkRow> auto& r) {
  f("name", r.name);
  f("seeds", r.seeds);
  f("pings", r.pings);
  f("lost", r.lost);
  f("rtt_ms", r.rtt_ms);
  f("drive_mean_sd_ms", r.drive_mean_sd_ms);
  f("paper_rtt_ms", r.paper_rtt_ms);
}

void fields(auto& f, Of<ApAr> auto& r) {
  f("ap", r.ap);
  f("ar", r.ar);
}

void fields(auto& f, Of<LevelRow> auto& r) {
  f("level", r.level);
  f("name", r.name);
  f("raw", r.raw);
  f("sampled", r.sampled);
  f("lost_by_sampling", r.lost_by_sampling);
  f("median_ms", r.median_ms);
  f("p95_ms", r.p95_ms);
}

void fields(auto& f, Of<TransmissionRow::Sent> auto& r) {
  f("mean", r.mean);
  f("p50", r.p50);
  f("p95", r.p95);
}

void fields(auto& f, Of<TransmissionRow> auto& r) {
  f("network", r.network);
  f("kilobytes", r.kilobytes);
  f("seeds", r.seeds);
  f("messages", r.messages);
  f("undelivered", r.undelivered);
  f("ms", r.ms);
}

void fields(auto& f, Of<ScriptRow::Road> auto& r) {
  f("theta1_ms", r.theta1_ms);
  f("theta2_ms", r.theta2_ms);
  f("d1_ms", r.d1_ms);
  f("image", r.image);
  f("level", r.level);
  f("d1_missed", r.d1_missed);
  f("at_d1", r.at_d1);
  f("d2_missed", r.d2_missed);
  f("marks", r.marks);
}

void fields(auto& f, Of<ScriptRow> auto& r) {
  f("round", r.round);
  f("on_time", r.on_time);
  f("theta3_ms", r.theta3_ms);
  f("x", r.x);
  f.part("theta1_ms", r.road);
}

void fields(auto& f, Of<LevelTimesRow> auto& r) {
  f("name", r.name);
  f("calibrated_ms", r.calibrated_ms);
  f("calibrated_p95_ms", r.calibrated_p95_ms);
  f("measured_ms", r.measured_ms);
  f("measured_p95_ms", r.measured_p95_ms);
}

void fields(auto& f, Of<Column> auto& r) {
  f("key", r.key);
  f("title", r.title);
  f("decimals", r.decimals);
  f.flag("percent", r.percent);
}

void fields(auto& f, Of<Series> auto& r) {
  f("name", r.name);
  f("unit", r.unit);
  f("points", r.points);
}

void fields(auto& f, Of<Waterfall::Send> auto& r) {
  f("link", r.link);
  f("direction", r.direction);
  f("what", r.what);
  f("fragments", r.fragments);
  f("sent_ms", r.sent_ms);
}

void fields(auto& f, Of<Waterfall> auto& r) {
  f("round", r.round);
  f("deadline_ms", r.deadline_ms);
  f("stages", r.stages);
  f("sends", r.sends);
}

}  // namespace interneuron::experiments
