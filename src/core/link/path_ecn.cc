#include "core/link/path_ecn.h"

namespace interneuron::link {
namespace {

// Whether a counter modulo 2^32 went back: no path carries 2^31 packets between two reports.
bool went_back(std::uint32_t by) { return static_cast<std::int32_t>(by) < 0; }

}  // namespace

void PathEcn::moved() {
  PathEcn anew;
  anew.largest_ = largest_;
  anew.ect0_ = ect0_;
  anew.ect1_ = ect1_;
  anew.ce_ = ce_;
  *this = anew;
}

// What left after the tested packets has arrived, and none of them.
bool PathEcn::is_dropped(TimePoint now, const Report& report) const {
  return acknowledged_ == 0 && unheard_ >= kTestPackets && report.newest_sent > tested_ &&
         now - first_sent_ >= kDropped;
}

PathEcn::Told PathEcn::report(TimePoint now, const Report& report) {
  if (bits() == kNotEct) return {};
  acknowledged_ += report.acknowledged;
  if (is_dropped(now, report)) {
    state_ = EcnState::kDropped;
    return {};
  }
  // A report that was overtaken counts less than is acknowledged by now.
  if (report.largest < largest_) return {};
  const bool is_rewritten = report.ect0 != ect0_;
  const std::uint32_t unmarked = report.ect1 - ect1_;
  const std::uint32_t marked = report.ce - ce_;
  largest_ = report.largest;
  ect0_ = report.ect0;
  ect1_ = report.ect1;
  ce_ = report.ce;
  if (went_back(unmarked) || went_back(marked)) {
    // The peer had forgotten the path and counts anew.
    acknowledged_ = counted_ = 0;
    return {};
  }
  counted_ += std::uint64_t{unmarked} + marked;
  if (is_rewritten) {
    state_ = EcnState::kRewritten;
  } else if (counted_ < acknowledged_) {
    state_ = EcnState::kBleached;
  } else if (is_mangled(now, unmarked, marked)) {
    state_ = EcnState::kMangled;
  } else if (acknowledged_ >= kTestPackets) {
    state_ = EcnState::kWorks;
  }
  return bits() == kNotEct ? Told{} : Told{unmarked + marked, marked};
}

bool PathEcn::is_mangled(TimePoint now, std::uint32_t unmarked, std::uint32_t marked) {
  if (unmarked > 0) marked_in_a_row_ = 0;
  if (unmarked > 0 || marked == 0) return false;
  if (marked_in_a_row_ == 0) marked_since_ = now;
  marked_in_a_row_ += marked;
  return marked_in_a_row_ >= kTestPackets && now - marked_since_ >= kMangled;
}

}  // namespace interneuron::link
