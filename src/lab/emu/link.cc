#include "lab/emu/link.h"

#include <algorithm>

#include "lab/emu/random.h"

namespace interneuron::emu {

namespace {

std::shared_ptr<Channel> make_channel(const LinkProfile& profile, std::uint64_t seed) {
  return std::make_shared<Channel>(std::make_shared<DelayProcess>(profile.delay, seed),
                                   profile.outages, profile.nat);
}

// Whether the rate changes within a span over which netem has only one.
bool finer_than_netem(const RateTrace& trace) {
  const auto* stepped = std::get_if<std::shared_ptr<const SteppedRate>>(&trace);
  if (stepped == nullptr) return true;
  const std::vector<RateStep>& steps = (*stepped)->steps;
  return std::adjacent_find(steps.begin(), steps.end(), [](const RateStep& a, const RateStep& b) {
           return b.at - a.at < kConditionsSpan;
         }) != steps.end();
}

}  // namespace

Link::Link(const LinkProfile& profile, std::uint64_t seed)
    : seed_(seed),
      channel_(make_channel(profile, seed)),
      models_{LinkModel(profile.up, channel_, Direction::kUp, split_mix(seed ^ 1U)),
              LinkModel(profile.down, channel_, Direction::kDown, split_mix(seed ^ 2U))} {}

void Link::change(Duration now, const LinkChange& change) {
  const LinkProfile* profile = change.profile.get();
  if (profile != nullptr) {
    channel_->replace(now,
                      std::make_shared<DelayProcess>(profile->delay, split_mix(seed_ + ++changes_)),
                      profile->outages, profile->nat);
  }
  if (change.rtt) channel_->fix_rtt(*change.rtt);
  for (const Direction d : {Direction::kUp, Direction::kDown}) {
    LinkModel& changed = *model(d);
    DirectionParams params = profile != nullptr ? profile->direction(d) : changed.params();
    change.direction(d).apply_to(params);
    changed.change(now, params);
  }
}

void Link::outage(Duration from, Duration length) {
  channel_->add_outage(from, length);
  for (LinkModel& direction : models_) direction.outage_added(from, from + length);
}

Conditions Link::conditions(Direction direction, Duration now) const {
  return models_[static_cast<std::size_t>(direction)].conditions(now);
}

std::vector<std::string> netem_cannot(const LinkProfile& profile) {
  std::vector<std::string> out;
  const auto either = [&](auto&& has) { return has(profile.up) || has(profile.down); };
  if (either([](const DirectionParams& p) { return p.trace && finer_than_netem(*p.trace); })) {
    out.emplace_back("rate opportunities finer than 20 ms (their mean is set instead)");
  }
  if (either([](const DirectionParams& p) { return p.mtu > 0; })) {
    out.emplace_back("mtu: larger packets are not dropped");
  }
  if (either([](const DirectionParams& p) {
        return p.reorder > 0 && p.reorder_by < DirectionParams::kWholeDelay;
      })) {
    out.emplace_back("reorder_ms: a reordered packet is sent at once");
  }
  const auto limits = [](const TokenBucketParams& b) { return b.rate.bits_per_second > 0; };
  if (either([&](const DirectionParams& p) { return limits(p.police); })) {
    out.emplace_back("police_mbit: nothing is dropped in front of the queue");
  }
  if (either([&](const DirectionParams& p) { return limits(p.shape); })) {
    out.emplace_back("shape_mbit: all passes at the rate of the link");
  }
  if (either([](const DirectionParams& p) { return p.grant_every > Duration{}; })) {
    out.emplace_back("grant_ms: packets leave at any time");
  }
  if (either([](const DirectionParams& p) { return p.harq > 0; })) {
    out.emplace_back("harq: the radio sends nothing again");
  }
  if (either([](const DirectionParams& p) { return p.wake_by > Duration{}; })) {
    out.emplace_back("wake_ms: the radio never sleeps");
  }
  const NatParams& nat = profile.nat;
  if (nat.drop_below > 0) out.emplace_back("nat.drop_below_bytes: small packets pass");
  if (nat.reorder_above > 0) out.emplace_back("nat.reorder_above_bytes: large packets keep order");
  if (nat.idle_timeout > Duration{}) out.emplace_back("nat.idle_timeout_s: mappings last for ever");
  return out;
}

std::vector<std::string> netem_cannot(const LinkChange& change) {
  LinkProfile after;
  // So that a change of reorder_ms alone is noticed as well.
  after.up.reorder = after.down.reorder = 1;
  if (change.profile) after = *change.profile;
  change.direction(Direction::kUp).apply_to(after.up);
  change.direction(Direction::kDown).apply_to(after.down);
  return netem_cannot(after);
}

}  // namespace interneuron::emu
