// A change of a link while it runs, from text as the command line or a scenario gives it:
//
//   rtt_ms=80            constant until the next profile=, 0..60000 ms; the rest goes on
//   profile=4g           all conditions of another profile from now on; its process begins now
//   loss rate_mbit queue_kbyte queue_packets duplicate corrupt reorder reorder_ms mtu police_mbit
//   police_kbyte shape_mbit shape_kbyte grant_ms grant_share harq harq_ms wake_after_ms wake_ms
//                        in both directions; up.KEY or down.KEY in one; meanings and ranges as in
//                        profile.h. rate_mbit replaces a stepped or traced rate; loss replaces that
//                        of the radio states and of Gilbert-Elliott; 0 turns off what police_mbit,
//                        shape_mbit, grant_ms, harq and wake_ms have turned on.
//
// `profile` applies before all others, whatever the order. Pure; never throws.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include "lab/emu/profile.h"

namespace interneuron::emu {

// The fields that are set replace those of DirectionParams, in the same units; the others stay.
struct DirectionChange {
  std::optional<double> loss;
  std::optional<DataRate> rate;
  std::optional<std::size_t> queue_bytes;
  std::optional<std::size_t> queue_packets;
  std::optional<double> duplicate;
  std::optional<double> corrupt;
  std::optional<double> reorder;
  std::optional<Duration> reorder_by;
  std::optional<std::size_t> mtu;
  std::optional<DataRate> police_rate;
  std::optional<std::size_t> police_bytes;
  std::optional<DataRate> shape_rate;
  std::optional<std::size_t> shape_bytes;
  std::optional<Duration> grant_every;
  std::optional<double> grant_share;
  std::optional<double> harq;
  std::optional<Duration> harq_by;
  std::optional<Duration> wake_after;
  std::optional<Duration> wake_by;

  void apply_to(DirectionParams& params) const;
};

struct LinkChange {
  // nullptr leaves the profile as it is.
  std::shared_ptr<const LinkProfile> profile;
  std::optional<Duration> rtt;
  // Indexed by Direction.
  std::array<DirectionChange, kDirections> directions;

  DirectionChange& direction(Direction d) { return directions[static_cast<std::size_t>(d)]; }
  const DirectionChange& direction(Direction d) const {
    return directions[static_cast<std::size_t>(d)];
  }
};

// Reads settings, each KEY=VALUE. `resolver` finds the profile of "profile=" (see profile.h). The
// error is one line that names the key, what is wrong and the remedy.
std::variant<LinkChange, ProfileError> parse_change(
    std::span<const std::string> key_value, const ProfileResolver& resolver = built_in_resolver());

// All keys, for help texts: "rtt_ms", "loss", …, without up. and down.
std::span<const std::string_view> change_keys();

}  // namespace interneuron::emu
