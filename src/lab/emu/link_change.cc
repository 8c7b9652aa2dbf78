#include "lab/emu/link_change.h"

#include <charconv>
#include <exception>

#include "lab/emu/profile_reader.h"

namespace interneuron::emu {

namespace {

std::size_t count(double value) { return static_cast<std::size_t>(value); }

constexpr NumberKey optional(NumberKey key) {
  key.optional = true;
  return key;
}

constexpr NumberKey probability(std::string_view name, std::string_view meaning) {
  return {name, meaning, 0, 1, "", true};
}

constexpr NumberKey bucket_rate(std::string_view name, std::string_view meaning) {
  return {name, meaning, 0, kMaxRateMbit, "Mbit/s", true};
}

constexpr NumberKey bucket_depth(std::string_view name, std::string_view meaning) {
  return {name, meaning, kMinQueueKbyte, 1e7, "10^3 bytes", true};
}

// A bucket of which only the rate is given holds what passes in this time.
// No measurement behind this value: buckets of 10 to 200 ms are seen.
constexpr Duration kDefaultBucket = std::chrono::milliseconds(50);

void set_bucket(TokenBucketParams& bucket, const std::optional<DataRate>& rate,
                const std::optional<std::size_t>& bytes) {
  bucket.rate = rate.value_or(bucket.rate);
  // Another rate without a depth of its own has the default one.
  bucket.bytes = bytes.value_or(rate ? 0 : bucket.bytes);
  if (bucket.bytes > 0 || bucket.rate.bits_per_second <= 0) return;
  const double held = to_seconds(kDefaultBucket) * bucket.rate.mbit() * 1e6 / 8;
  bucket.bytes = count(std::max(kMinQueueKbyte * 1e3, held));
}

// In the order in which help texts and errors list them.
constexpr std::array kDirectionKeys = {
    DirectionKey{optional(kRateKey),
                 [](DirectionChange& c, double v) { c.rate = DataRate::mbit(v); }},
    DirectionKey{{"queue_kbyte", "drop-tail limit", kMinQueueKbyte, 1e7, "10^3 bytes", true},
                 [](DirectionChange& c, double v) { c.queue_bytes = count(v * 1e3); }},
    DirectionKey{{"queue_packets", "drop-tail limit", 1, 1e7, "packets", true, true},
                 [](DirectionChange& c, double v) { c.queue_packets = count(v); }},
    DirectionKey{optional(kLossKey), [](DirectionChange& c, double v) { c.loss = v; }},
    DirectionKey{probability("duplicate", "probability that a packet comes twice"),
                 [](DirectionChange& c, double v) { c.duplicate = v; }},
    DirectionKey{probability("corrupt", "probability that a packet is damaged"),
                 [](DirectionChange& c, double v) { c.corrupt = v; }},
    DirectionKey{probability("reorder", "probability that a packet overtakes"),
                 [](DirectionChange& c, double v) { c.reorder = v; }},
    DirectionKey{{"reorder_ms", "how much earlier it arrives", 0.01, kMaxRttMs, "ms", true},
                 [](DirectionChange& c, double v) { c.reorder_by = from_ms(v); }},
    DirectionKey{{"mtu", "largest packet that passes", 68, 65'535, "IP bytes", true, true},
                 [](DirectionChange& c, double v) { c.mtu = count(v); }},
    DirectionKey{bucket_rate("police_mbit", "rate of the policer"),
                 [](DirectionChange& c, double v) { c.police_rate = DataRate::mbit(v); }},
    DirectionKey{bucket_depth("police_kbyte", "bucket of the policer"),
                 [](DirectionChange& c, double v) { c.police_bytes = count(v * 1e3); }},
    DirectionKey{bucket_rate("shape_mbit", "rate of the shaper"),
                 [](DirectionChange& c, double v) { c.shape_rate = DataRate::mbit(v); }},
    DirectionKey{bucket_depth("shape_kbyte", "bucket of the shaper"),
                 [](DirectionChange& c, double v) { c.shape_bytes = count(v * 1e3); }},
    DirectionKey{{"grant_ms", "time from one grant to the next", 0, kMaxGrantMs, "ms", true},
                 [](DirectionChange& c, double v) {
                   c.grant_every = v * 1e3 < kLeastGrantUs ? Duration{} : from_ms(v);
                 }},
    DirectionKey{{"grant_share", "part of it that a grant lasts", 0.001, 1, "", true},
                 [](DirectionChange& c, double v) { c.grant_share = v; }},
    DirectionKey{probability("harq", "probability that the radio sends a packet again"),
                 [](DirectionChange& c, double v) { c.harq = v; }},
    DirectionKey{{"harq_ms", "how long that takes", 0.01, kMaxWakeMs, "ms", true},
                 [](DirectionChange& c, double v) { c.harq_by = from_ms(v); }},
    DirectionKey{
        {"wake_after_ms", "silence after which the radio sleeps", 1, kMaxSleepMs, "ms", true},
        [](DirectionChange& c, double v) { c.wake_after = from_ms(v); }},
    DirectionKey{{"wake_ms", "how long it takes to wake up", 0, kMaxWakeMs, "ms", true},
                 [](DirectionChange& c, double v) { c.wake_by = from_ms(v); }},
};

constexpr std::size_t kKeys = kDirectionKeys.size() + 2;

constexpr std::array<std::string_view, kKeys> kChangeKeys = [] {
  std::array<std::string_view, kKeys> names{"rtt_ms", "profile"};
  for (std::size_t i = 0; i < kDirectionKeys.size(); ++i) {
    names[i + 2] = kDirectionKeys[i].key.name;
  }
  return names;
}();

const DirectionKey* find_key(std::string_view name) {
  for (const DirectionKey& key : kDirectionKeys) {
    if (key.key.name == name) return &key;
  }
  return nullptr;
}

std::vector<std::string_view> names_of_direction_keys() {
  std::vector<std::string_view> names;
  for (const DirectionKey& key : kDirectionKeys) names.push_back(key.key.name);
  return names;
}

// Null: both.
void set(LinkChange& change, const Direction* direction, const DirectionKey& key, double value) {
  for (const Direction d : {Direction::kUp, Direction::kDown}) {
    if (direction == nullptr || *direction == d) key.set(change.direction(d), value);
  }
}

// nullopt: fine.
std::optional<std::string> look_up(const ProfileResolver& resolver, const std::string& name,
                                   LinkChange& out) {
  auto found = resolver(name);
  if (const auto* error = std::get_if<ProfileError>(&found)) return error->what;
  out.profile = std::make_shared<const LinkProfile>(std::get<LinkProfile>(std::move(found)));
  return std::nullopt;
}

std::string unknown_key(std::string_view word) {
  std::vector<std::string> spellings;
  for (const std::string_view name : kChangeKeys) {
    spellings.emplace_back(name);
    if (find_key(name) == nullptr) continue;
    spellings.push_back("up." + std::string(name));
    spellings.push_back("down." + std::string(name));
  }
  const auto nearest =
      nearest_word(word, std::vector<std::string_view>(spellings.begin(), spellings.end()));
  std::string list;
  for (const std::string_view name : kChangeKeys)
    list += (list.empty() ? "" : ", ") + std::string(name);
  return "unknown key '" + std::string(word) + "'; " +
         (nearest ? "did you mean '" + std::string(*nearest) + "'?"
                  : "known keys: " + list + "; all but the first two also as up.KEY or down.KEY");
}

// One KEY=VALUE; nullopt: fine.
std::optional<std::string> read_pair(std::string_view pair, const ProfileResolver& resolver,
                                     LinkChange& out) {
  const std::size_t equals = pair.find('=');
  if (equals == std::string_view::npos) {
    return "'" + std::string(pair) + "' is no KEY=VALUE; write rtt_ms=80";
  }
  const std::string_view name = pair.substr(0, equals);
  const std::string_view text = pair.substr(equals + 1);
  if (name == "profile") return look_up(resolver, std::string(text), out);

  constexpr Direction kUp = Direction::kUp;
  constexpr Direction kDown = Direction::kDown;
  const Direction* direction = name.starts_with("up.")     ? &kUp
                               : name.starts_with("down.") ? &kDown
                                                           : nullptr;
  const DirectionKey* key = find_key(direction == nullptr ? name : name.substr(name.find('.') + 1));
  const NumberKey* limits = name == kRttKey.name ? &kRttKey : key != nullptr ? &key->key : nullptr;
  if (limits == nullptr) return unknown_key(name);

  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) {
    return "'" + std::string(name) + "' = '" + std::string(text) + "' must be a number, " +
           toml_reader::range_text(*limits);
  }
  if (const auto wrong = toml_reader::range_error(*limits, value))
    return "'" + std::string(name) + "'" + *wrong;
  if (limits == &kRttKey) {
    out.rtt = from_ms(value);
  } else {
    set(out, direction, *key, value);
  }
  return std::nullopt;
}

bool read_numbers(TomlReader& reader, const Section& section, const Direction* direction,
                  LinkChange& out) {
  for (const DirectionKey& key : kDirectionKeys) {
    double value = 0;
    if (!reader.number(section, key.key, value)) return false;
    if (reader.has(section, key.key.name)) set(out, direction, key, value);
  }
  return true;
}

}  // namespace

std::span<const DirectionKey> direction_keys() { return kDirectionKeys; }

std::span<const std::string_view> change_keys() { return kChangeKeys; }

void DirectionChange::apply_to(DirectionParams& params) const {
  if (loss) {
    params.loss = loss;
    params.gilbert_elliott.reset();
  }
  if (rate) {
    params.rate = *rate;
    params.trace.reset();
  }
  params.queue_bytes = queue_bytes.value_or(params.queue_bytes);
  params.queue_packets = queue_packets.value_or(params.queue_packets);
  params.duplicate = duplicate.value_or(params.duplicate);
  params.corrupt = corrupt.value_or(params.corrupt);
  params.reorder = reorder.value_or(params.reorder);
  params.reorder_by = reorder_by.value_or(params.reorder_by);
  params.mtu = mtu.value_or(params.mtu);
  set_bucket(params.police, police_rate, police_bytes);
  set_bucket(params.shape, shape_rate, shape_bytes);
  params.grant_every = grant_every.value_or(params.grant_every);
  params.grant_share = grant_share.value_or(params.grant_share);
  params.harq = harq.value_or(params.harq);
  params.harq_by = harq_by.value_or(params.harq_by);
  params.wake_after = wake_after.value_or(params.wake_after);
  params.wake_by = wake_by.value_or(params.wake_by);
}

std::variant<LinkChange, ProfileError> parse_change(std::span<const std::string> key_value,
                                                    const ProfileResolver& resolver) {
  try {
    LinkChange change;
    for (const std::string& pair : key_value) {
      if (auto wrong = read_pair(pair, resolver, change))
        return ProfileError{toml_reader::one_line(std::move(*wrong))};
    }
    if (key_value.empty()) return ProfileError{"no change given; write KEY=VALUE, as rtt_ms=80"};
    return change;
  } catch (const std::exception& error) {
    // The resolver has thrown.
    return ProfileError{error.what()};
  }
}

bool read_change(TomlReader& reader, const Section& section,
                 const std::vector<std::string_view>& others, const ProfileResolver& resolver,
                 LinkChange& out) {
  std::vector<std::string_view> known = others;
  known.insert(known.end(), kChangeKeys.begin(), kChangeKeys.end());
  known.insert(known.end(), {"up", "down"});
  if (!reader.only(section, known)) return false;
  if (reader.has(section, "profile")) {
    std::string name;
    if (!reader.text(section, "profile", "4g", name)) return false;
    if (const auto wrong = look_up(resolver, name, out)) {
      return reader.fail_at(section, "profile", *wrong);
    }
  }
  double rtt_ms = 0;
  if (!reader.number(section, optional(kRttKey), rtt_ms)) return false;
  if (reader.has(section, kRttKey.name)) out.rtt = from_ms(rtt_ms);
  if (!read_numbers(reader, section, nullptr, out)) return false;
  for (const Direction d : {Direction::kUp, Direction::kDown}) {
    const std::string_view name = d == Direction::kUp ? "up" : "down";
    if (!reader.has(section, name)) continue;
    const Section part = reader.section(section, name);
    if (!reader.only(part, names_of_direction_keys()) || !read_numbers(reader, part, &d, out)) {
      return false;
    }
  }
  return true;
}

}  // namespace interneuron::emu
