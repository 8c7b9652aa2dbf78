#include "app/records/run_files.h"

#include "core/base/statistics.h"

namespace interneuron::records {
namespace {

constexpr int kOtherLevels = -1;
constexpr const char* kOtherPlans = "others";

Json known(const std::optional<double>& value) {
  return value ? Json(rounded(*value)) : Json(nullptr);
}

// Counts one of `key`, or of `rest` when there are too many different ones.
template <class Key>
void count(std::map<Key, std::uint64_t>& counts, const Key& key, const Key& rest) {
  const bool room = counts.contains(key) || counts.size() < RunTally::kMaxKinds;
  ++counts[room ? key : rest];
}

Json by_name(const std::map<std::string, std::uint64_t>& counts) {
  Json out = Json::object();
  for (const auto& [name, rounds] : counts) out[name] = rounds;
  return out;
}

Json by_level(const std::map<int, std::uint64_t>& counts, const RunInfo& info) {
  Json out = Json::array();
  for (const auto& [level, rounds] : counts) {
    const auto i = static_cast<std::size_t>(level);
    out.push_back({{"level", level},
                   {"name", i < info.level_names.size() ? info.level_names[i] : ""},
                   {"rounds", rounds}});
  }
  return out;
}

Json by_link(const std::vector<LinkUse>& links) {
  Json out = Json::object();
  for (const LinkUse& link : links) {
    out[link.name] = {{"sent", link.sent_bytes},
                      {"received", link.received_bytes},
                      {"fragments_resent", link.resent_fragments},
                      {"symbols_sent", link.sent_symbols},
                      {"packets_lost", link.lost_packets}};
  }
  return out;
}

}  // namespace

void Sample::add(double value) {
  sum_ += value;
  ++count_;
  if (values_.size() < kMaxValues) {
    values_.push_back(value);
    return;
  }
  // Each value so far is kept with the same chance.
  const std::uint64_t place = std::uniform_int_distribution<std::uint64_t>(0, count_ - 1)(random_);
  if (place < values_.size()) values_[place] = value;
}

Json Sample::json() const {
  return {{"p50", rounded(percentile(values_, 0.50))},
          {"p95", rounded(percentile(values_, 0.95))},
          {"p99", rounded(percentile(values_, 0.99))},
          {"mean", rounded(count_ == 0 ? 0 : sum_ / static_cast<double>(count_))}};
}

void RunTally::add(const RoundRow& r) {
  ++rounds_;
  if (r.plan == kRefusedPlan) ++refused_;
  count(plans_, r.plan.empty() ? std::string("nothing") : r.plan, std::string(kOtherPlans));
  if (r.road) count(levels_, r.road->level, kOtherLevels);
  ++used_[r.road ? r.road->variant : "local"];
  if (!r.answered) return;
  ++answers_;
  judged_ = judged_ && r.possible.has_value();
  if (r.possible.value_or(false)) ++possible_;
  // Rounded as in rounds.csv, so that both agree to the last digit.
  const double e2e = rounded(to_ms(r.e2e));
  all_ms_.add(e2e);
  if (r.outcome == Outcome::kRemote) {
    ++on_time_;
    on_time_ms_.add(e2e);
  } else if (!r.age_rounds || *r.age_rounds > 0) {
    ++not_fresh_;
  }
}

Json RunTally::summary(const RunInfo& info) const {
  Json s;
  s["schema"] = "interneuron.run/1";
  s["seed"] = info.seeded ? Json(info.seed) : Json(nullptr);
  s["profiles"] = info.profiles;
  s["policy"] = info.policy;
  s["images"] = info.images;
  s["guard"] = info.guard;
  s["deadline_ms"] = to_ms(info.deadline);
  s["period_ms"] = to_ms(info.period);
  s["ladder"] = info.ladder;
  s["backup"] = info.backup;
  s["rounds"] = rounds_;
  s["answers"] = answers_;
  s["on_time"] = on_time_;
  s["local"] = answers_ - on_time_;
  s["local_not_fresh"] = not_fresh_;
  s["timeouts"] = rounds_ - on_time_;
  s["refused"] = refused_;
  s["best_possible"] = judged_ && rounds_ > 0 ? Json(possible_) : Json(nullptr);
  s["e2e_ms"] = on_time_ms_.json();
  s["e2e_all_ms"] = all_ms_.json();
  s["ap"] = known(info.ap);
  s["ap50"] = known(info.ap50);
  s["ar"] = known(info.ar);
  s["drawn_precision"] = known(info.drawn_precision);
  s["drawn_recall"] = known(info.drawn_recall);
  s["levels"] = by_level(levels_, info);
  s["used"] = by_name(used_);
  s["plans"] = by_name(plans_);
  s["bytes"] = by_link(info.links);
  return s;
}

Json summarise(const std::vector<RoundRow>& rows, const RunInfo& info) {
  RunTally tally;
  for (const RoundRow& row : rows) tally.add(row);
  return tally.summary(info);
}

}  // namespace interneuron::records
