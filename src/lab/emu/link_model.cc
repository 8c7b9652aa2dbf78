#include "lab/emu/link_model.h"

#include <algorithm>
#include <utility>

#include "lab/emu/channel.h"

namespace interneuron::emu {

namespace {

// Grants are a rate that is on and off in turn.
RateTrace granted(const DirectionParams& params) {
  const auto length = Duration{static_cast<std::int64_t>(
      params.grant_share * static_cast<double>(params.grant_every.count()))};
  return std::make_shared<const SteppedRate>(
      SteppedRate{{{Duration{}, params.rate.scaled(1 / params.grant_share)}, {length, DataRate{}}},
                  params.grant_every});
}

Bottleneck bottleneck_of(const DirectionParams& params, Duration origin) {
  if (params.trace) return Bottleneck(*params.trace, origin);
  const bool always = params.grant_every <= Duration{} || params.grant_share >= 1 ||
                      params.rate.bits_per_second <= 0;
  return always ? Bottleneck(params.rate) : Bottleneck(granted(params), origin);
}

bool same_rate(const DirectionParams& a, const DirectionParams& b) {
  return a.rate == b.rate && a.trace == b.trace && a.shape == b.shape &&
         a.grant_every == b.grant_every && a.grant_share == b.grant_share;
}

}  // namespace

// A heap keeps at its front what is later than nothing.
struct LinkModel::Later {
  bool operator()(const Entry& a, const Entry& b) const {
    return a.due != b.due ? a.due > b.due : a.serial > b.serial;
  }
};

// The loss stream is seeded with `seed` itself, the others with numbers derived from it.
LinkModel::LinkModel(const DirectionParams& params, std::shared_ptr<Channel> channel,
                     Direction direction, std::uint64_t seed)
    : params_(params),
      channel_(std::move(channel)),
      direction_(direction),
      bottleneck_(bottleneck_of(params, {})),
      police_(params.police),
      shape_(params.shape),
      loss_rng_(seed),
      burst_stream_(split_mix(seed ^ 1U)),
      duplicate_stream_(split_mix(seed ^ 2U)),
      corrupt_stream_(split_mix(seed ^ 3U)),
      reorder_stream_(split_mix(seed ^ 4U)),
      nat_stream_(split_mix(seed ^ 5U)),
      harq_stream_(split_mix(seed ^ 6U)) {}

bool LinkModel::enqueue(Duration now, std::size_t ip_bytes, std::uint64_t tag) {
  ++stats_.packets_in;
  stats_.bytes_in += ip_bytes;
  settle(now);
  if (refused(now, ip_bytes)) return false;
  const Duration awake = channel_->awake(now, params_.wake_after, params_.wake_by);
  const Duration leaves = admitted(ip_bytes) ? departure(awake, ip_bytes) : Duration::max();
  if (leaves == Duration::max() || leaves - now > kLongestWait) {
    ++stats_.queue_drops;
    return false;
  }
  send(leaves, ip_bytes);
  waiting_.push_back({leaves, ip_bytes});
  waiting_bytes_ += ip_bytes;
  Entry entry{.departure = leaves, .tag = tag, .serial = next_serial_++, .bytes = ip_bytes};

  // All draws before any of them decides: what is lost does not shift the draws of the rest.
  const Channel::Sample sample = channel_->at(leaves);
  const bool lost = radio_loses(sample.loss);
  const bool twice = duplicate_stream_.chance(params_.duplicate);
  entry.corrupt = corrupt_stream_.chance(params_.corrupt);
  entry.shift = shift_of(ip_bytes);
  entry.held = sent_again_for();
  if (sample.out || lost) {
    ++(sample.out ? stats_.outage_lost : stats_.lost);
    return false;
  }
  if (direction_ == Direction::kUp) channel_->touch_mapping(now);
  if (twice) {
    entry.copies = 2;
    ++stats_.duplicated;
  }
  place(entry, sample.one_way);
  if (entry.shift == Duration{}) {
    line_.push_back(entry);
  } else {
    ++stats_.reordered;
    strays_.push_back(entry);
    std::push_heap(strays_.begin(), strays_.end(), Later{});
  }
  return true;
}

// When a packet that arrives at `at` would have left the bottleneck and the shaper.
Duration LinkModel::departure(Duration at, std::size_t ip_bytes) {
  const Duration leaves = bottleneck_.departure(at, ip_bytes);
  return leaves == Duration::max() ? leaves : shape_.conforms(leaves, ip_bytes);
}

// Sends the packet of the last departure().
void LinkModel::send(Duration departure, std::size_t ip_bytes) {
  bottleneck_.send();
  // A packet that waits for the shaper holds up those behind it.
  if (params_.shape.rate.bits_per_second > 0) bottleneck_.hold_until(departure);
  shape_.take(departure, ip_bytes);
}

// Whether the path's MTU, the carrier's NAT or its policer drops the packet, before it reaches the
// queue.
bool LinkModel::refused(Duration now, std::size_t ip_bytes) {
  if (params_.mtu > 0 && ip_bytes > params_.mtu) {
    ++stats_.too_big;
    return true;
  }
  if (ip_bytes < channel_->nat().drop_below ||
      (direction_ == Direction::kDown && channel_->mapping_lost(now))) {
    ++stats_.nat_drops;
    return true;
  }
  if (police_.conforms(now, ip_bytes) > now) {
    ++stats_.policed;
    return true;
  }
  police_.take(now, ip_bytes);
  return false;
}

bool LinkModel::admitted(std::size_t ip_bytes) const {
  if (waiting_.empty()) return true;
  return waiting_bytes_ + ip_bytes <= params_.queue_bytes &&
         (params_.queue_packets == 0 || waiting_.size() < params_.queue_packets);
}

// Drawn for every packet that was sent, whatever the probability, so that two profiles with
// different loss see the same sequence of draws.
bool LinkModel::radio_loses(double loss) {
  const bool single = uniform_(loss_rng_) < params_.loss.value_or(loss);
  const bool in_burst = params_.gilbert_elliott && burst_loses();
  return single || in_burst;
}

bool LinkModel::burst_loses() {
  const GilbertElliott& ge = *params_.gilbert_elliott;
  const bool lost = burst_stream_.uniform() < (burst_ ? ge.loss_in_bad : ge.loss_in_good);
  burst_packets_ = burst_ ? burst_packets_ + 1 : 0;
  const bool may_turn = burst_stream_.uniform() < (burst_ ? ge.r : ge.p);
  const bool turns = burst_ && ge.exactly > 0 ? burst_packets_ == ge.exactly : may_turn;
  if (turns) burst_ = !burst_;
  return lost;
}

// By how much a packet comes out of its turn; 0: in order.
Duration LinkModel::shift_of(std::size_t ip_bytes) {
  const NatParams& nat = channel_->nat();
  const bool large = nat.reorder_above > 0 && ip_bytes > nat.reorder_above;
  const bool passed = large && nat_stream_.chance(nat.reorder);
  if (reorder_stream_.chance(params_.reorder)) return -params_.reorder_by;
  return passed ? nat.reorder_delay : Duration{};
}

// How long hybrid ARQ takes to bring a packet beyond its first try: the n-th try fails with the
// probability harq, so that at least n fail with its n-th power.
Duration LinkModel::sent_again_for() {
  const double draw = harq_stream_.uniform();
  Duration held{};
  double fails = params_.harq;
  for (int tries = 0; tries < DirectionParams::kHarqTries && draw < fails; ++tries) {
    held += params_.harq_by;
    fails *= params_.harq;
  }
  return held;
}

// Sets when the packet is due; one in order holds up those behind it.
void LinkModel::place(Entry& entry, Duration one_way) {
  const Duration turn = entry.departure + one_way + entry.held;
  if (entry.shift == Duration{}) {
    entry.due = last_due_ = std::max(last_due_, turn);
  } else {
    entry.due = std::max(entry.departure, turn + entry.shift);
  }
}

std::optional<Duration> LinkModel::next_delivery() const {
  if (line_.empty() && strays_.empty()) return std::nullopt;
  if (strays_.empty()) return line_.front().due;
  if (line_.empty()) return strays_.front().due;
  return std::min(line_.front().due, strays_.front().due);
}

std::optional<LinkModel::Packet> LinkModel::dequeue(Duration now) {
  const bool stray = !strays_.empty() && (line_.empty() || Later{}(line_.front(), strays_.front()));
  if (!stray && line_.empty()) return std::nullopt;
  Entry& entry = stray ? strays_.front() : line_.front();
  if (entry.due > now) return std::nullopt;
  const Packet packet = hand_out(entry);
  if (!packet.last) return packet;
  if (stray) {
    std::pop_heap(strays_.begin(), strays_.end(), Later{});
    strays_.pop_back();
  } else {
    delivered_due_ = entry.due;
    line_.pop_front();
  }
  return packet;
}

// One copy of a packet.
LinkModel::Packet LinkModel::hand_out(Entry& entry) {
  --entry.copies;
  const Packet packet{entry.tag,     entry.bytes,       entry.due,
                      entry.corrupt, entry.copies == 0, entry.lost};
  if (entry.lost) return packet;
  ++stats_.delivered;
  stats_.bytes_delivered += entry.bytes;
  if (entry.corrupt) ++stats_.corrupted;
  return packet;
}

void LinkModel::settle(Duration now) {
  while (!waiting_.empty() && waiting_.front().departure <= now) {
    waiting_bytes_ -= waiting_.front().bytes;
    waiting_.pop_front();
  }
}

std::size_t LinkModel::waiting_bytes(Duration now) const {
  std::size_t bytes = waiting_bytes_;
  for (std::size_t i = 0; i < waiting_.size() && waiting_[i].departure <= now; ++i) {
    bytes -= waiting_[i].bytes;
  }
  return bytes;
}

void LinkModel::change(Duration now, const DirectionParams& params) {
  settle(now);
  const bool other_rate = !same_rate(params, params_);
  if (params.police != params_.police) police_ = TokenBucket(params.police);
  params_ = params;
  if (other_rate) serve_again(now);

  last_due_ = delivered_due_;
  for (std::size_t i = 0; i < line_.size() && line_[i].departure <= now; ++i) {
    last_due_ = line_[i].due;
  }
  each_inside([&](Entry& entry) { place_again(entry, now); });
  std::make_heap(strays_.begin(), strays_.end(), Later{});
}

template <class Visit>
void LinkModel::each_inside(Visit&& visit) {
  for (std::size_t i = 0; i < line_.size(); ++i) visit(line_[i]);
  for (Entry& entry : strays_) visit(entry);
}

// Delay and outage again, for what has not left the bottleneck. Called in the order of entry.
void LinkModel::place_again(Entry& entry, Duration now) {
  if (entry.departure <= now) return;
  const Channel::Sample sample = channel_->at(entry.departure);
  if (sample.out && !entry.lost) give_up(entry, stats_.outage_lost);
  place(entry, sample.one_way);
}

// Departures again under the new rate, for what waits behind the packet on its way, which leaves
// when it would have.
void LinkModel::serve_again(Duration now) {
  bottleneck_ = bottleneck_of(params_, now);
  shape_ = TokenBucket(params_.shape);
  if (waiting_.empty()) return;
  bottleneck_.busy_until(waiting_.front().departure);
  shape_ = TokenBucket(params_.shape, waiting_.front().departure);
  bool too_late = false;
  for (std::size_t i = 1; i < waiting_.size(); ++i) {
    Waiting& waiting = waiting_[i];
    const Duration leaves = departure(now, waiting.bytes);
    too_late = too_late || leaves - now > kLongestWait;
    if (!too_late) send(leaves, waiting.bytes);
    waiting.dropped = too_late;
    waiting.departure = too_late ? now + kLongestWait : leaves;
  }
  const std::uint64_t first_serial = next_serial_ - waiting_.size();
  each_inside([&](Entry& entry) {
    if (entry.serial < first_serial) return;
    const Waiting& waiting = waiting_[static_cast<std::size_t>(entry.serial - first_serial)];
    entry.departure = waiting.departure;
    if (waiting.dropped && !entry.lost) give_up(entry, stats_.queue_drops);
  });
}

// A packet inside that will not arrive: it comes out marked, so that the caller frees it.
void LinkModel::give_up(Entry& entry, std::uint64_t& counter) {
  ++counter;
  // Its copy goes with it and was counted as an extra packet inside.
  if (entry.copies > 1) ++counter;
  entry.copies = 1;
  entry.lost = true;
}

void LinkModel::outage_added(Duration from, Duration to) {
  each_inside([&](Entry& entry) {
    if (entry.lost || entry.departure < from || entry.departure >= to) return;
    give_up(entry, stats_.outage_lost);
  });
}

Conditions LinkModel::conditions(Duration now) const {
  const Channel::Sample sample = channel_->at(now);
  Conditions out;
  out.one_way = sample.one_way;
  out.loss = sample.out ? 1.0 : params_.loss.value_or(sample.loss);
  out.gilbert_elliott = params_.gilbert_elliott;
  out.rate = bottleneck_.mean(now, kConditionsSpan);
  out.queue_bytes = params_.queue_bytes;
  out.queue_packets = params_.queue_packets;
  out.duplicate = params_.duplicate;
  out.corrupt = params_.corrupt;
  out.reorder = params_.reorder;
  out.reorder_by = std::min(params_.reorder_by, sample.one_way);
  out.mtu = params_.mtu;
  return out;
}

}  // namespace interneuron::emu
