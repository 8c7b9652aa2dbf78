// Links as JSON: docs/schema/links.json is the authority. Durations and rates carry their unit in
// the key; what was not measured is null. Pure.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "app/watch/row.h"

namespace interneuron::watch {

using Json = nlohmann::ordered_json;

// "schema": "interneuron.links/1".
Json links_json(const LinksSnapshot& snapshot);

// What one program tells others on the same host of its links: the measured part of the above, as
// text and back. The text comes from another process and may be anything: what is not of this form
// gives an empty result, and unknown keys are ignored.
Json live_json(const LiveLinks& live);
std::optional<LiveLinks> live_from_json(const std::string& text);

}  // namespace interneuron::watch
