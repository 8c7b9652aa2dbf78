// The keys of the rows of system_rows.h. A visitor f gets each key with its field, in the order of
// the file: f(key, field), or f.part(key, field) for a group of keys that is there as a whole or
// not at all, told by its first one. One list serves for writing and for reading.
#pragma once

#include <concepts>
#include <type_traits>

#include "lab/eval/experiments/system_rows.h"

namespace interneuron::experiments {

// A row of this type, constant when it is written and not when it is read.
template <class T, class Type>
concept Of = std::same_as<std::remove_const_t<T>, Type>;

void fields(auto& f, Of<Times> auto& r) {
  f("mean", r.mean);
  f("p50", r.p50);
  f("p95", r.p95);
  f("p99", r.p99);
}

void fields(auto& f, Of<Traffic> auto& r) {
  f("per_round", r.per_round);
  f("kb_per_round", r.kb_per_round);
  f("links", r.links);
}

void fields(auto& f, Of<OracleFigures> auto& r) {
  f("timeouts", r.timeouts);
  f("quality", r.quality);
  f("effective_ap", r.effective_ap);
}

void fields(auto& f, Of<SystemRow::Agreement> auto& r) {
  f("agreement", r.on_time);
  f("effective_agreement", r.effective);
}

void fields(auto& f, Of<SystemRow::Sweep> auto& r) {
  f("deadline_ms", r.deadline_ms);
  f("severity", r.severity);
}

void fields(auto& f, Of<SystemRow::Handler> auto& r) {
  f("consecutive_change", r.consecutive_change);
}

void fields(auto& f, Of<SystemRow> auto& r) {
  f("name", r.name);
  f("about", r.about);
  f("guard", r.guard);
  f("policy", r.policy);
  f("baseline", r.baseline);
  f("seeds", r.seeds);
  f("rounds", r.rounds);
  f("timeouts", r.timeouts);
  f("timeouts_ci95", r.timeouts_ci95);
  f("timeouts_share", r.timeouts_share);
  f("consecutive", r.consecutive);
  f("e2e_ms", r.e2e_ms);
  f("quality", r.quality);
  f("quality_on_time", r.quality_on_time);
  f("bytes", r.bytes);
  f("ap", r.ap);
  f("ar", r.ar);
  f("effective_ap", r.effective_ap);
  f("effective_ar", r.effective_ar);
  f("oracle", r.oracle);
  f.part("agreement", r.agreement);
  f.part("deadline_ms", r.sweep);
  f.part("consecutive_change", r.handler);
}

void fields(auto& f, Of<PaperRow::MeanTime> auto& r) { f("mean", r.mean); }

void fields(auto& f, Of<PaperRow> auto& r) {
  f("name", r.name);
  f("rounds", r.rounds);
  f("timeouts", r.timeouts);
  f("timeouts_share", r.timeouts_share);
  f("timeouts_ci95", r.timeouts_ci95);
  f("e2e_ms", r.e2e_ms);
  f("ap", r.ap);
  f("ar", r.ar);
}

void fields(auto& f, Of<eval::Paired> auto& r) {
  f("mean", r.mean);
  f("ci95", r.ci95);
}

void fields(auto& f, Of<LadderRow> auto& r) {
  f("name", r.name);
  f("about", r.about);
  f("baseline", r.baseline);
  f("seeds", r.seeds);
  f("more_timeouts_per_300", r.more_timeouts_per_300);
  f("more_quality", r.more_quality);
}

void fields(auto& f, Of<Sides> auto& r) {
  f("testbed", r.testbed);
  f("sim", r.sim);
}

void fields(auto& f, Of<AgreementRow::OnTime> auto& r) {
  f("testbed", r.testbed);
  f("sim", r.sim);
  f("points", r.points);
}

void fields(auto& f, Of<AgreementRow::Median> auto& r) {
  f("testbed", r.testbed);
  f("sim", r.sim);
  f("change", r.change);
}

void fields(auto& f, Of<AgreementRow> auto& r) {
  f("name", r.name);
  f("image", r.image);
  f("on_time", r.on_time);
  f("e2e_p50_ms", r.e2e_p50_ms);
  f("uplink_ms", r.uplink_ms);
  f("compute_ms", r.compute_ms);
  f("downlink_ms", r.downlink_ms);
  f("points_aim", r.points_aim);
  f("on_time_agrees", r.on_time_agrees);
  f("e2e_agrees", r.e2e_agrees);
  f("uplink_agrees", r.uplink_agrees);
}

}  // namespace interneuron::experiments
